//! Drawing on RGB images: anti-aliased lines and areas, text, pasted pictures.
//!
//! Positions are pixels whose centres lie at integer coordinates, as everywhere; the drawing library puts corners
//! there.

use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Stroke, Transform,
};

use crate::files::RgbImage;
use crate::geometry::{Point2, Rect};

use super::font;

/// Red, green, blue, opacity.
pub(super) type Rgba = [u8; 4];

/// How far beyond the picture lines are kept, in pixels.
const MARGIN: f64 = 16.0;

pub(super) struct Canvas {
    pixmap: Pixmap,
}

/// A line's look.
#[derive(Clone, Copy)]
pub(super) struct Pen {
    pub(super) color: Rgba,
    /// In pixels.
    pub(super) width: f32,
}

/// A text's look.
#[derive(Clone, Copy)]
pub(super) struct TextStyle {
    pub(super) color: [u8; 3],
    /// Pixels a dot of the font.
    pub(super) scale: i32,
    /// Colour of an outline one dot wide.
    pub(super) outline: Option<[u8; 3]>,
}

impl TextStyle {
    pub(super) const fn plain(color: [u8; 3]) -> Self {
        Self { color, scale: 1, outline: None }
    }

    pub(super) const fn outlined(color: [u8; 3], outline: [u8; 3]) -> Self {
        Self { color, scale: 1, outline: Some(outline) }
    }
}

/// Width and height of a line of text, in pixels.
pub(super) fn text_size(text: &str, scale: i32) -> [i32; 2] {
    let count = text.chars().count() as i32;
    [(count * font::ADVANCE - 1).max(0) * scale, font::HEIGHT * scale]
}

impl Canvas {
    /// A picture of one colour, at least one pixel large.
    pub(super) fn new(size: [u32; 2], [r, g, b]: [u8; 3]) -> Self {
        let [width, height] = size.map(|side| side.clamp(1, 1 << 14));
        let mut pixmap = Pixmap::new(width, height).expect("neither empty nor huge");
        pixmap.fill(Color::from_rgba8(r, g, b, 255));
        Self { pixmap }
    }

    pub(super) fn size(&self) -> [u32; 2] {
        [self.pixmap.width(), self.pixmap.height()]
    }

    pub(super) fn into_rgb(self) -> RgbImage {
        let size = self.size();
        // Every pixel is opaque, so nothing needs to be divided by its opacity.
        let pixels = self.pixmap.data().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        RgbImage { size, pixels }
    }

    /// Puts a picture with its upper left pixel at a position; what overlaps the border is cut off.
    pub(super) fn paste(&mut self, image: &RgbImage, at: [i32; 2]) {
        let width = image.size[0].max(1) as usize;
        for (y, row) in image.pixels.chunks_exact(3 * width).enumerate() {
            for (x, rgb) in row.chunks_exact(3).enumerate() {
                self.blend(at[0] + x as i32, at[1] + y as i32, [rgb[0], rgb[1], rgb[2]], 1.0);
            }
        }
    }

    /// Mixes a colour into a pixel; nothing happens outside of the picture.
    pub(super) fn blend(&mut self, x: i32, y: i32, color: [u8; 3], opacity: f32) {
        let [width, height] = self.size().map(|side| side as i32);
        if x < 0 || y < 0 || x >= width || y >= height {
            return;
        }
        let start = 4 * (y * width + x) as usize;
        let pixel = &mut self.pixmap.data_mut()[start..start + 3];
        for (old, new) in pixel.iter_mut().zip(color) {
            let mixed = f32::from(*old) + (f32::from(new) - f32::from(*old)) * opacity;
            *old = mixed.round() as u8;
        }
    }

    pub(super) fn line(&mut self, from: &Point2, to: &Point2, pen: Pen) {
        let [width, height] = self.size().map(f64::from);
        let bounds = Rect::new(-MARGIN, -MARGIN, width + MARGIN, height + MARGIN);
        let Some([from, to]) = clip_line(from, to, &bounds) else { return };
        let mut path = PathBuilder::new();
        path.move_to(corner(from.x), corner(from.y));
        path.line_to(corner(to.x), corner(to.y));
        let Some(path) = path.finish() else { return };
        let stroke = Stroke {
            width: pen.width,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            ..Stroke::default()
        };
        self.pixmap.stroke_path(&path, &paint(pen.color), &stroke, Transform::identity(), None);
    }

    /// Lines through the points and back to the first.
    pub(super) fn outline(&mut self, points: &[Point2], pen: Pen) {
        for (i, point) in points.iter().enumerate() {
            self.line(point, &points[(i + 1) % points.len()], pen);
        }
    }

    pub(super) fn rectangle(&mut self, rect: &Rect, pen: Pen) {
        self.outline(&corners(rect), pen);
    }

    /// Fills a convex polygon.
    pub(super) fn fill(&mut self, points: &[Point2], color: Rgba) {
        let [width, height] = self.size().map(f64::from);
        let bounds = Rect::new(-MARGIN, -MARGIN, width + MARGIN, height + MARGIN);
        let points = clip_polygon(points, &bounds);
        let mut path = PathBuilder::new();
        for (i, point) in points.iter().enumerate() {
            if i == 0 {
                path.move_to(corner(point.x), corner(point.y));
            } else {
                path.line_to(corner(point.x), corner(point.y));
            }
        }
        path.close();
        let Some(path) = path.finish() else { return };
        let identity = Transform::identity();
        self.pixmap.fill_path(&path, &paint(color), FillRule::Winding, identity, None);
    }

    pub(super) fn fill_rectangle(&mut self, rect: &Rect, color: Rgba) {
        self.fill(&corners(rect), color);
    }

    pub(super) fn disc(&mut self, center: &Point2, radius: f32, color: Rgba) {
        let path = PathBuilder::from_circle(corner(center.x), corner(center.y), radius);
        let Some(path) = path else { return };
        let identity = Transform::identity();
        self.pixmap.fill_path(&path, &paint(color), FillRule::Winding, identity, None);
    }

    /// Writes a line of text; `at` is its upper left pixel.
    pub(super) fn text(&mut self, at: [i32; 2], text: &str, style: TextStyle) {
        if let Some(color) = style.outline {
            for dy in -1..=1 {
                for dx in -1..=1 {
                    let shifted = [at[0] + dx * style.scale, at[1] + dy * style.scale];
                    self.glyphs(shifted, text, TextStyle { color, ..style });
                }
            }
        }
        self.glyphs(at, text, style);
    }

    fn glyphs(&mut self, at: [i32; 2], text: &str, style: TextStyle) {
        for (i, character) in text.chars().enumerate() {
            for row in 0..font::HEIGHT * style.scale {
                for column in 0..font::WIDTH * style.scale {
                    if font::ink(character, column / style.scale, row / style.scale) {
                        let x = at[0] + i as i32 * font::ADVANCE * style.scale + column;
                        self.blend(x, at[1] + row, style.color, 1.0);
                    }
                }
            }
        }
    }
}

fn corners(rect: &Rect) -> [Point2; 4] {
    [
        Point2::new(rect.x_min, rect.y_min),
        Point2::new(rect.x_max, rect.y_min),
        Point2::new(rect.x_max, rect.y_max),
        Point2::new(rect.x_min, rect.y_max),
    ]
}

fn corner(center: f64) -> f32 {
    (center + 0.5) as f32
}

fn paint([r, g, b, a]: Rgba) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, a);
    paint
}

/// Signed distances inside the four sides of a rectangle.
fn depths(point: &Point2, bounds: &Rect) -> [f64; 4] {
    [point.x - bounds.x_min, bounds.x_max - point.x, point.y - bounds.y_min, bounds.y_max - point.y]
}

/// The part of a line in a rectangle.
fn clip_line(from: &Point2, to: &Point2, bounds: &Rect) -> Option<[Point2; 2]> {
    let mut range = [0.0f64, 1.0f64];
    for (a, b) in depths(from, bounds).into_iter().zip(depths(to, bounds)) {
        match (a >= 0.0, b >= 0.0) {
            (true, true) => {}
            (true, false) => range[1] = range[1].min(a / (a - b)),
            (false, true) => range[0] = range[0].max(a / (a - b)),
            (false, false) => return None,
        }
    }
    let at = |s: f64| from + (to - from) * s;
    (range[0] <= range[1]).then(|| [at(range[0]), at(range[1])])
}

/// The part of a convex polygon in a rectangle (Sutherland and Hodgman, 1974).
fn clip_polygon(points: &[Point2], bounds: &Rect) -> Vec<Point2> {
    let mut polygon = points.to_vec();
    for side in 0..4 {
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, point) in polygon.iter().enumerate() {
            let next = &polygon[(i + 1) % polygon.len()];
            let (a, b) = (depths(point, bounds)[side], depths(next, bounds)[side]);
            if a >= 0.0 {
                kept.push(*point);
            }
            if (a >= 0.0) != (b >= 0.0) {
                kept.push(point + (next - point) * (a / (a - b)));
            }
        }
        polygon = kept;
    }
    polygon
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thin_line_through_pixel_centres_stays_in_their_row() {
        let mut canvas = Canvas::new([9, 5], [0; 3]);
        let pen = Pen { color: [255; 4], width: 1.0 };
        canvas.line(&Point2::new(-50.0, 2.0), &Point2::new(1e7, 2.0), pen);
        let image = canvas.into_rgb();
        let lit: Vec<usize> = (0..45).filter(|i| image.pixels[3 * i] > 0).collect();
        assert_eq!(lit, (18..27).collect::<Vec<_>>());
    }

    #[test]
    fn nothing_outside_of_the_picture_is_drawn_or_panics() {
        let mut canvas = Canvas::new([4, 4], [0; 3]);
        let pen = Pen { color: [255; 4], width: 2.0 };
        for value in [f64::NAN, f64::INFINITY, -1e9, 1e9] {
            let far = Point2::new(value, value);
            canvas.line(&far, &Point2::new(value, 300.0), pen);
            canvas.fill(&[far, far, Point2::new(value, -1e12)], [255; 4]);
            canvas.disc(&far, 3.0, [255; 4]);
        }
        canvas.text([-100, 300], "away", TextStyle::outlined([255; 3], [200; 3]));
        canvas.paste(&RgbImage { size: [2, 1], pixels: vec![9; 6] }, [-2, 0]);
        assert!(canvas.into_rgb().pixels.iter().all(|value| *value == 0));
    }

    #[test]
    fn polygon_is_cut_at_the_border() {
        let bounds = Rect::new(0.0, 0.0, 10.0, 10.0);
        let big = corners(&Rect::new(-100.0, -100.0, 100.0, 100.0));
        let cut = clip_polygon(&big, &bounds);
        assert_eq!(Rect::around(&cut), Some(bounds));
    }
}
