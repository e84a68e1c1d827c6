//! From an image to a model's input, and from places in the input back to the image.

use ort::value::{DynValue, Tensor};
use partpose::files::RgbImage;
use partpose::geometry::Rect;

use crate::OnnxError;
use crate::mapping::{
    BoxFormat, ChannelOrder, InputMapping, Layout, OutputMapping, PixelOrigin, Resize,
};

/// Pixels of an input at most.
const MOST_PIXELS: usize = 1 << 26;

/// How an image lies in the input, width before height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    /// The input.
    pub(crate) size: [usize; 2],
    /// Where the image begins in it.
    pub(crate) offset: [usize; 2],
    /// The image in it.
    pub(crate) scaled: [usize; 2],
    /// The image itself.
    pub(crate) original: [u32; 2],
}

impl Placement {
    pub(crate) fn new(original: [u32; 2], resize: Resize) -> Result<Self, OnnxError> {
        let sides = original.map(|side| f64::from(side.max(1)));
        let by = |scale: f64| sides.map(|side| ((side * scale).round() as usize).max(1));
        let (size, offset, scaled) = match resize {
            Resize::Keep { shorter, longer } => {
                let [least, most] = [sides[0].min(sides[1]), sides[0].max(sides[1])];
                let wanted = if shorter > 0 { f64::from(shorter) / least } else { 1.0 };
                let limit = if longer > 0 { f64::from(longer) / most } else { f64::INFINITY };
                let scaled = by(wanted.min(limit));
                (scaled, [0, 0], scaled)
            }
            Resize::Stretch { size } => {
                let size = size.map(|side| side as usize);
                (size, [0, 0], size)
            }
            Resize::Letterbox { size, .. } => {
                let scale = f64::min(f64::from(size[0]) / sides[0], f64::from(size[1]) / sides[1]);
                let size = size.map(|side| side as usize);
                let fitted = by(scale);
                let scaled = [0, 1].map(|i| fitted[i].min(size[i]));
                (size, [0, 1].map(|i| (size[i] - scaled[i]) / 2), scaled)
            }
        };
        let [width, height] = size;
        if width.saturating_mul(height) > MOST_PIXELS {
            return Err(OnnxError::TooLarge { width, height, limit: MOST_PIXELS });
        }
        Ok(Self { size, offset, scaled, original })
    }

    /// A place of the input, counted from the edge of its first pixel, in the image, counted from the first pixel's middle.
    fn in_image(&self, axis: usize, at: f64) -> f64 {
        let scale = f64::from(self.original[axis]) / self.scaled[axis] as f64;
        (at - self.offset[axis] as f64) * scale - 0.5
    }

    /// A box in the input's pixels, as [`Rect`] has it: the middle of pixel i is i.
    pub(crate) fn in_input(&self, values: [f32; 4], mapping: &OutputMapping) -> Rect {
        let mut v = values.map(f64::from);
        if mapping.box_format == BoxFormat::CornersYx {
            v = [v[1], v[0], v[3], v[2]];
        }
        if mapping.box_shares {
            let [width, height] = self.size.map(|side| side as f64);
            v = [v[0] * width, v[1] * height, v[2] * width, v[3] * height];
        }
        let [x0, y0, x1, y1] = match mapping.box_format {
            BoxFormat::Corners | BoxFormat::CornersYx => v,
            BoxFormat::Centre => {
                [v[0] - 0.5 * v[2], v[1] - 0.5 * v[3], v[0] + 0.5 * v[2], v[1] + 0.5 * v[3]]
            }
            BoxFormat::CornerAndSize => [v[0], v[1], v[0] + v[2], v[1] + v[3]],
        };
        let shift = if mapping.pixel_origin == PixelOrigin::Corner { 0.5 } else { 0.0 };
        Rect::new(x0 - shift, y0 - shift, x1 - shift, y1 - shift)
    }

    /// A box of the input in the image.
    pub(crate) fn rect_in_image(&self, rect: &Rect) -> Rect {
        let x = |at: f64| self.in_image(0, at + 0.5);
        let y = |at: f64| self.in_image(1, at + 0.5);
        Rect::new(x(rect.x_min), y(rect.y_min), x(rect.x_max), y(rect.y_max))
    }
}

/// The image as the model takes it.
pub(crate) fn input(
    image: &RgbImage,
    placement: &Placement,
    mapping: &InputMapping,
) -> Result<DynValue, ort::Error> {
    let [width, height] = placement.size;
    let area = width * height;
    let fill = match mapping.resize {
        Resize::Letterbox { fill, .. } => fill,
        _ => 0.0,
    };
    let mut values = vec![fill; 3 * area];
    let axes = [0, 1].map(|i| axis(placement.original[i] as usize, placement.scaled[i]));
    let row_length = 3 * placement.original[0] as usize;
    let [columns, rows] = &axes;
    for (y, (top, bottom, down)) in rows.iter().enumerate() {
        let [upper, lower] =
            [*top, *bottom].map(|row| &image.pixels[row * row_length..][..row_length]);
        let first = (y + placement.offset[1]) * width + placement.offset[0];
        for (x, (left, right, along)) in columns.iter().enumerate() {
            for channel in 0..3 {
                let across = |row: &[u8]| {
                    let [left, right] = [*left, *right].map(|x| f32::from(row[3 * x + channel]));
                    left + along * (right - left)
                };
                let above = across(upper);
                values[channel * area + first + x] = above + down * (across(lower) - above);
            }
        }
    }
    if !mapping.bytes {
        for (channel, plane) in values.chunks_mut(area).enumerate() {
            let [mean, deviation] = [mapping.mean[channel], mapping.deviation[channel]];
            for value in plane {
                *value = (*value - mean) / deviation;
            }
        }
    }
    if mapping.channels == ChannelOrder::Bgr {
        let (red, rest) = values.split_at_mut(area);
        red.swap_with_slice(&mut rest[area..]);
    }
    let shape = match mapping.layout {
        Layout::Nchw => vec![1, 3, height, width],
        Layout::Chw => vec![3, height, width],
        Layout::Nhwc => {
            values = (0..area).flat_map(|i| [0, 1, 2].map(|c| values[c * area + i])).collect();
            vec![1, height, width, 3]
        }
    };
    if mapping.bytes {
        let bytes: Vec<u8> = values.iter().map(|v| v.round().clamp(0.0, 255.0) as u8).collect();
        Ok(Tensor::from_array((shape, bytes))?.into_dyn())
    } else {
        Ok(Tensor::from_array((shape, values))?.into_dyn())
    }
}

/// For each place on the scaled axis the two it lies between and the share of the second; pixels are areas.
fn axis(from: usize, to: usize) -> Vec<(usize, usize, f32)> {
    let last = from.saturating_sub(1);
    let place = |i: usize| {
        let at = ((i as f64 + 0.5) * from as f64 / to as f64 - 0.5).clamp(0.0, last as f64);
        let low = at as usize;
        (low, (low + 1).min(last), (at - low as f64) as f32)
    };
    (0..to).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_come_back_from_a_letterbox() {
        let resize = Resize::Letterbox { size: [640, 640], fill: 114.0 };
        let placement = Placement::new([1280, 320], resize).unwrap();
        assert_eq!((placement.scaled, placement.offset), ([640, 160], [0, 240]));
        let mapping = OutputMapping { box_format: BoxFormat::Centre, ..Default::default() };
        // The lower right quarter of the image.
        let rect = placement.in_input([480.0, 360.0, 320.0, 80.0], &mapping);
        let rect = placement.rect_in_image(&rect);
        assert_eq!(rect, Rect::new(639.5, 159.5, 1279.5, 319.5));
    }

    #[test]
    fn formats_of_boxes_mean_the_same() {
        let placement = Placement::new([100, 50], Resize::Stretch { size: [200, 100] }).unwrap();
        let rect = |format, box_shares, values| {
            let mapping = OutputMapping { box_format: format, box_shares, ..Default::default() };
            placement.in_input(values, &mapping)
        };
        let expected = Rect::new(19.5, 29.5, 59.5, 79.5);
        assert_eq!(rect(BoxFormat::Corners, false, [20.0, 30.0, 60.0, 80.0]), expected);
        assert_eq!(rect(BoxFormat::CornersYx, false, [30.0, 20.0, 80.0, 60.0]), expected);
        assert_eq!(rect(BoxFormat::Centre, false, [40.0, 55.0, 40.0, 50.0]), expected);
        assert_eq!(rect(BoxFormat::CornerAndSize, false, [20.0, 30.0, 40.0, 50.0]), expected);
        let shares = rect(BoxFormat::CornersYx, true, [0.3, 0.1, 0.8, 0.3]);
        assert!((shares.x_min - 19.5).abs() < 1e-5 && (shares.y_max - 79.5).abs() < 1e-5);
    }

    #[test]
    fn an_input_that_no_memory_holds_is_refused() {
        let resize = Resize::Stretch { size: [u32::MAX, u32::MAX] };
        assert!(matches!(Placement::new([10, 10], resize), Err(OnnxError::TooLarge { .. })));
    }
}
