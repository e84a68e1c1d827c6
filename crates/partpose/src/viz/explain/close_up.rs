//! Close-ups of a vehicle's box: its mask, a model drawn over it, and where the two contradict.

use crate::files::RgbImage;
use crate::geometry::{Camera, Cuboid, Point2, Rect};
use crate::parts::{BACKGROUND, PartClass, PartMask, Scaling};
use crate::render::{Instance, LabelImage, render_labels};
use crate::viz::canvas::{Canvas, Pen};
use crate::viz::scene::palette;

use super::Explanation;

/// What is shown around the box, as a share of its sides.
const AROUND: f64 = 0.14;
/// Most picture pixels an image pixel becomes.
const LARGEST: f64 = 14.0;
/// Opacity of parts over a photograph and over plain ground.
const OPACITY: [f64; 2] = [0.55, 0.85];

/// A model as it was placed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Posed {
    /// Place in the zoo.
    pub(super) model: usize,
    pub(super) cuboid: Cuboid,
}

/// The surroundings of a box, enlarged.
pub(super) struct CloseUp<'a> {
    explanation: &'a Explanation<'a>,
    size: [u32; 2],
    /// The camera of the close-up.
    camera: Camera,
    /// What it shows of the image, pixels.
    window: Rect,
    mask: PartMask,
}

impl<'a> CloseUp<'a> {
    pub(super) fn new(explanation: &'a Explanation<'a>, size: [i32; 2]) -> Self {
        let bounds = &explanation.detection.bounds;
        let size = size.map(|side| side.max(8) as u32);
        let [width, height] = [bounds.width(), bounds.height()].map(|side| side.max(1.0));
        let [wide, high] = size.map(f64::from);
        let around = 1.0 + 2.0 * AROUND;
        let scale = (wide / (around * width)).min(high / (around * height)).min(LARGEST);
        let center = bounds.center();
        let half = [0.5 * wide / scale, 0.5 * high / scale];
        let window = Rect::new(
            center.x - half[0],
            center.y - half[1],
            center.x + half[0],
            center.y + half[1],
        );
        let camera = explanation.camera.crop(&window, size);
        let mask = explanation.detection.part_mask(explanation.camera.size, Scaling::Bilinear);
        Self { explanation, size, camera, window, mask }
    }

    /// The photograph or plain ground, with parts where `part` gives one.
    fn ground(&self, part: impl Fn(usize, i32, i32) -> u8) -> RgbImage {
        let image = self.explanation.image.filter(|i| i.size == self.explanation.camera.size);
        let opacity = OPACITY[usize::from(image.is_none())];
        let mut pixels = Vec::with_capacity(3 * (self.size[0] * self.size[1]) as usize);
        for y in 0..self.size[1] {
            for x in 0..self.size[0] {
                let at = self.in_image(f64::from(x), f64::from(y));
                let (u, v) = (at.x.round() as i32, at.y.round() as i32);
                let inside = u >= 0
                    && v >= 0
                    && u < self.explanation.camera.size[0] as i32
                    && v < self.explanation.camera.size[1] as i32;
                let below = match image {
                    _ if !inside => [0; 3],
                    Some(image) => {
                        let start = 3 * (v as usize * image.size[0] as usize + u as usize);
                        [image.pixels[start], image.pixels[start + 1], image.pixels[start + 2]]
                    }
                    None => palette::GROUND,
                };
                let index = (y * self.size[0] + x) as usize;
                let label = if inside { part(index, u, v) } else { BACKGROUND };
                let color = PartClass::from_id(label)
                    .map_or(below, |part| mixed(below, part.color(), opacity));
                pixels.extend(color);
            }
        }
        RgbImage { size: self.size, pixels }
    }

    /// Where a pixel of the close-up lies in the image.
    fn in_image(&self, x: f64, y: f64) -> Point2 {
        let share = |at: f64, side: u32| (at + 0.5) / f64::from(side);
        Point2::new(
            self.window.x_min + share(x, self.size[0]) * self.window.width(),
            self.window.y_min + share(y, self.size[1]) * self.window.height(),
        )
    }

    /// Where a pixel of the image lies in the close-up.
    fn here(&self, at: &Point2) -> Point2 {
        Point2::new(
            (at.x - self.window.x_min) / self.window.width() * f64::from(self.size[0]) - 0.5,
            (at.y - self.window.y_min) / self.window.height() * f64::from(self.size[1]) - 0.5,
        )
    }

    /// The parts of the mask, and the box.
    pub(super) fn mask(&self) -> RgbImage {
        let ground = self.ground(|_, u, v| self.mask.at(u, v));
        let mut canvas = self.canvas(&ground);
        let b = &self.explanation.detection.bounds;
        let low = self.here(&Point2::new(b.x_min, b.y_min));
        let high = self.here(&Point2::new(b.x_max, b.y_max));
        let color = palette::with_opacity(palette::DETECTION, 200);
        canvas.rectangle(&Rect::new(low.x, low.y, high.x, high.y), Pen { color, width: 1.0 });
        canvas.into_rgb()
    }

    /// The estimate's parts, the mask's outline, and the true cuboid if it is known.
    pub(super) fn fit(&self) -> RgbImage {
        let picture = match self.explanation.outcome {
            Ok(estimate) => {
                self.posed(&Posed { model: estimate.model_index, cuboid: estimate.cuboid() })
            }
            Err(_) => self.ground(|_, _, _| BACKGROUND),
        };
        let mut canvas = self.canvas(&picture);
        self.outline_mask(&mut canvas);
        if let Some(truth) = &self.explanation.truth {
            self.cuboid(&mut canvas, truth, palette::TRUTH);
        }
        canvas.into_rgb()
    }

    /// Another model or pose, and the mask's outline.
    pub(super) fn hypothesis(&self, posed: &Posed) -> RgbImage {
        let mut canvas = self.canvas(&self.posed(posed));
        self.outline_mask(&mut canvas);
        canvas.into_rgb()
    }

    fn posed(&self, posed: &Posed) -> RgbImage {
        let drawn = self.drawn(&self.camera, posed);
        self.ground(|index, _, _| drawn.as_ref().map_or(BACKGROUND, |d| d.parts[index]))
    }

    fn drawn(&self, camera: &Camera, posed: &Posed) -> Option<LabelImage> {
        let model = self.explanation.zoo.models.get(posed.model)?;
        let instance = Instance {
            mesh: model.mesh(),
            scale: posed.cuboid.extent.ratio(&model.extent()),
            camera_from_vehicle: posed.cuboid.camera_from_vehicle,
            id: 1,
        };
        Some(render_labels(camera, &[instance]))
    }

    /// How far mask and model contradict in each cell.
    pub(super) fn residual(&self) -> RgbImage {
        let detection = self.explanation.detection;
        let m = detection.probabilities.size();
        let s = 112usize.div_ceil(m).max(2);
        let close = self.explanation.camera.crop(&detection.bounds, [(m * s) as u32; 2]);
        let drawn = self.explanation.outcome.as_ref().ok().and_then(|estimate| {
            let posed = Posed { model: estimate.model_index, cuboid: estimate.cuboid() };
            self.drawn(&close, &posed)
        });
        let unknown = |cell: usize| {
            detection.unknown.as_ref().and_then(|u| u.get(cell)).is_some_and(|u| *u > 0.75)
        };
        let cells: Vec<Option<f64>> = (0..m * m)
            .map(|cell| (!unknown(cell)).then(|| self.contradiction(drawn.as_ref(), cell, m, s)))
            .collect();
        let mut picture = self.ground(|_, _, _| BACKGROUND);
        let bounds = &detection.bounds;
        for (index, pixel) in picture.pixels.chunks_exact_mut(3).enumerate() {
            let (x, y) = (index as u32 % self.size[0], index as u32 / self.size[0]);
            let at = self.in_image(f64::from(x), f64::from(y));
            let image = self.explanation.camera.image_rect();
            if !bounds.contains(&at) || !image.contains(&at) {
                for value in pixel.iter_mut() {
                    *value /= 3;
                }
                continue;
            }
            let line = |at: f64, low: f64, length: f64| {
                (((at - low) / length * m as f64) as usize).min(m - 1)
            };
            let cell = line(at.y, bounds.y_min, bounds.height()) * m
                + line(at.x, bounds.x_min, bounds.width());
            pixel.copy_from_slice(&cells[cell].map_or([40, 70, 130], heat));
        }
        let mut canvas = self.canvas(&picture);
        self.outline_mask(&mut canvas);
        canvas.into_rgb()
    }

    /// Half the squared difference of probabilities and drawn shares in a cell, 0 to 1.
    fn contradiction(&self, drawn: Option<&LabelImage>, cell: usize, m: usize, s: usize) -> f64 {
        let Some(drawn) = drawn else { return 0.0 };
        let mut shares = [0.0f64; PartClass::COUNT + 1];
        let per_sample = 1.0 / (s * s) as f64;
        for y in 0..s {
            for x in 0..s {
                let at = ((cell / m) * s + y) * m * s + (cell % m) * s + x;
                shares[usize::from(drawn.parts[at])] += per_sample;
            }
        }
        let probabilities = &self.explanation.detection.probabilities;
        let squares = shares.iter().enumerate().map(|(channel, share)| {
            (share - f64::from(probabilities.channel(channel)[cell])).powi(2)
        });
        0.5 * squares.sum::<f64>()
    }

    fn canvas(&self, picture: &RgbImage) -> Canvas {
        let mut canvas = Canvas::new(self.size, palette::GROUND);
        canvas.paste(picture, [0, 0]);
        canvas
    }

    /// A white line where the mask ends.
    fn outline_mask(&self, canvas: &mut Canvas) {
        let shown = |x: i32, y: i32| {
            let at = self.in_image(f64::from(x), f64::from(y));
            self.mask.at(at.x.round() as i32, at.y.round() as i32) != BACKGROUND
        };
        for y in 0..self.size[1] as i32 {
            for x in 0..self.size[0] as i32 {
                if shown(x, y) != shown(x + 1, y) || shown(x, y) != shown(x, y + 1) {
                    canvas.blend(x, y, palette::PREDICTED, 0.85);
                }
            }
        }
    }

    fn cuboid(&self, canvas: &mut Canvas, cuboid: &Cuboid, color: [u8; 3]) {
        const EDGES: [[usize; 2]; 12] = [
            [0, 1],
            [1, 3],
            [3, 2],
            [2, 0],
            [4, 5],
            [5, 7],
            [7, 6],
            [6, 4],
            [0, 4],
            [1, 5],
            [2, 6],
            [3, 7],
        ];
        let corners = cuboid.corners();
        let near: Vec<Option<Point2>> = corners
            .iter()
            .map(|corner| self.explanation.camera.project(corner).map(|at| self.here(&at)))
            .collect();
        let pen = Pen { color: palette::with_opacity(color, 170), width: 1.0 };
        for [a, b] in EDGES {
            if let (Some(a), Some(b)) = (near[a], near[b]) {
                canvas.line(&a, &b, pen);
            }
        }
    }
}

fn mixed(below: [u8; 3], above: [u8; 3], opacity: f64) -> [u8; 3] {
    std::array::from_fn(|i| {
        (f64::from(below[i]) * (1.0 - opacity) + f64::from(above[i]) * opacity).round() as u8
    })
}

/// From dark over red to yellow.
fn heat(value: f64) -> [u8; 3] {
    let v = value.clamp(0.0, 1.0).sqrt();
    let channel = |low: f64| (255.0 * ((v - low) / 0.5).clamp(0.0, 1.0)) as u8;
    [channel(0.05).max(26), channel(0.5).max(24), 30]
}
