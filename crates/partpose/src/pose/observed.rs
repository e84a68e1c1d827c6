//! What a mask shows of each part of a vehicle, against its model at the estimated pose.
//!
//! The model is drawn on the cells of the kernel. A part agrees with it if the mask has it where the model has it, give
//! or take a cell; it is missing (a mirror that is folded or torn off) if the model should show it and the mask does
//! not, displaced (an open door) if the mask has it elsewhere, unexpected if the model should not show it.
//!
//! Small parts, such as mirrors of one to four cells, are judged by how reliable the mask is around them: with a share r
//! of what is drawn nearby labelled otherwise, a part of n cells is missed by chance about `r^(1 + n / 4)` of the time
//! (errors of masks reach over about four cells). It is called missing only where that is rare.

use serde::Serialize;

use crate::detection::Detection;
use crate::geometry::{Camera, Point2, Point3, Pose, Rect, Vector3};
use crate::parts::{CHANNELS, PartClass, Scaling};
use crate::render::{Instance, LabelImage, LabelRenderer, RenderOptions};
use crate::vehicle::Mesh;

/// Samples a side that the model is drawn on, about.
const SAMPLES: usize = 112;
/// Cells of a 28 x 28 kernel below which a part is not there, and below which nothing is concluded from it.
const LEAST: [f64; 2] = [0.3, 1.5];
/// Share of the drawn area below which a part is missing.
const MISSING: f64 = 0.2;
/// Agreement below which a part is displaced.
const DISPLACED: f64 = 0.35;
/// Cells of a 28 x 28 kernel from which a part can be called missing.
const SMALLEST: f64 = 0.5;
/// Chance of missing a part that is there above which it is not called missing.
const CHANCE: f64 = 0.05;
/// Cells over which errors of masks reach: about 2 x 2.
const CORRELATED: f64 = 4.0;
/// How far around a part the mask's reliability is looked at, cells of a 28 x 28 kernel.
const AROUND: f64 = 3.0;

/// Turns about the vehicle's axes to the right and down, radians, under which a part must stay in sight.
const TURNS: [[f64; 2]; 4] = [[0.0, 0.06], [0.0, -0.06], [0.03, 0.0], [-0.03, 0.0]];

/// What becomes of one part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PartVerdict {
    /// The mask has it where the model has it.
    Agrees,
    /// The model should show it, the mask does not.
    Missing,
    /// The mask has it elsewhere.
    Displaced,
    /// The mask has it though the model should not show it.
    Unexpected,
    /// The model shows it where nothing is known of the mask: behind another vehicle, outside the image.
    Hidden,
    /// Too few cells, or too unreliable ones, to tell.
    TooSmall,
}

/// One part as mask and model have it.
#[derive(Clone, Debug, PartialEq)]
pub struct PartState {
    /// Which part.
    pub part: PartClass,
    /// Whether mask and model agree.
    pub verdict: PartVerdict,
    /// 0 to 1: the harmonic mean of how much of the drawn part the mask has, and of the mask's part the model has.
    pub agreement: f64,
    /// The rectangle around its pixels in the mask; `None` where the mask does not show it.
    pub bounds: Option<Rect>,
    /// Where its middle is seen, pixels.
    pub point_in_image: Option<Point2>,
    /// What the mask shows of it, square pixels.
    pub area: f64,
    /// Mean probability of the part where the mask has it.
    pub probability: f64,
    /// What the model at its pose shows of it within the box, square pixels.
    pub area_of_model: f64,
    /// The share of that of which the mask says anything.
    pub known_share: f64,
    /// The middle of its visible surface on the model, camera frame, metres; `None` where the model does not show it.
    pub point_in_camera: Option<Point3>,
    /// The same in the vehicle frame.
    pub point_in_vehicle: Option<Point3>,
}

/// A model where it was found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) scale: Vector3,
    pub(super) camera_from_vehicle: Pose,
    pub(super) is_closed: bool,
}

/// The parts that mask or model show, in the order of ids.
pub(super) fn part_states(
    camera: &Camera,
    detection: &Detection,
    placed: &Placed,
) -> Vec<PartState> {
    let cells = Cells::new(camera, detection, placed);
    PartClass::ALL.into_iter().filter_map(|part| cells.state(part)).collect()
}

/// Model and mask on the same cells.
struct Cells<'a> {
    detection: &'a Detection,
    /// Cells a side, samples a side of a cell.
    m: usize,
    s: usize,
    camera: Camera,
    vehicle_from_camera: Pose,
    picture: LabelImage,
    /// The labels at poses that are turned a little: what is seen at a grazing angle comes and goes.
    turned: Vec<Vec<u8>>,
    /// How much of each cell is known.
    known: Vec<f64>,
    /// Square pixels of a cell.
    area: f64,
    mask: crate::parts::PartMask,
}

impl<'a> Cells<'a> {
    fn new(camera: &Camera, detection: &'a Detection, placed: &Placed) -> Self {
        let m = detection.probabilities.size();
        let s = SAMPLES.div_ceil(m).max(1);
        let close = camera.crop(&detection.bounds, [(m * s) as u32; 2]);
        let mut renderer = LabelRenderer::default();
        let options = RenderOptions { cull_back_faces: placed.is_closed };
        let mut draw = |turn: Vector3| {
            let turn = nalgebra::UnitQuaternion::from_scaled_axis(turn);
            let instance = Instance {
                mesh: placed.mesh,
                scale: placed.scale,
                camera_from_vehicle: placed.camera_from_vehicle * turn,
                id: 1,
            };
            renderer.render(&close, &[instance], &options).clone()
        };
        let turned = TURNS.map(|[x, y]| draw(Vector3::new(x, y, 0.0)).parts).into();
        let picture = draw(Vector3::zeros());
        let bounds = &detection.bounds;
        let [width, height] = [bounds.width() / m as f64, bounds.height() / m as f64];
        let image = camera.image_rect();
        let known = |cell: usize| {
            let x = bounds.x_min + (cell % m) as f64 * width;
            let y = bounds.y_min + (cell / m) as f64 * height;
            let inside = Rect::new(x, y, x + width, y + height).intersection(&image);
            let inside = inside.map_or(0.0, |part| part.area() / (width * height));
            let unknown = detection.unknown.as_ref().and_then(|u| u.get(cell)).copied();
            (1.0 - f64::from(unknown.unwrap_or(0.0))).min(inside).clamp(0.0, 1.0)
        };
        Self {
            detection,
            m,
            s,
            camera: close,
            vehicle_from_camera: placed.camera_from_vehicle.inverse(),
            picture,
            turned,
            known: (0..m * m).map(known).collect(),
            area: width * height,
            mask: detection.part_mask(camera.size, Scaling::Bilinear),
        }
    }

    /// `None` for a part that neither shows.
    fn state(&self, part: PartClass) -> Option<PartState> {
        let drawn = self.drawn(part);
        let seen: Vec<f64> = self
            .detection
            .probabilities
            .channel(usize::from(part.id()))
            .iter()
            .zip(&self.known)
            .map(|(q, known)| f64::from(*q) * known)
            .collect();
        let known: Vec<f64> = drawn.share.iter().zip(&self.known).map(|(d, k)| d * k).collect();
        let [sum_drawn, sum_known, sum_seen] =
            [&drawn.share, &known, &seen].map(|values| values.iter().sum::<f64>());
        let reference = (28.0 / self.m as f64).powi(2);
        if (sum_drawn.max(sum_seen)) * reference < LEAST[0] {
            return None;
        }
        let recall = self.overlap(&known, &seen);
        let precision = self.overlap(&seen, &drawn.share);
        let agreement = if recall + precision > 0.0 {
            2.0 * recall * precision / (recall + precision)
        } else {
            0.0
        };
        let (least, most) = self.at_any_turn(part);
        let known_share = if sum_drawn > 0.0 { sum_known / sum_drawn } else { 0.0 };
        let sums = Sums {
            drawn: sum_drawn,
            least: least * known_share,
            most,
            known: sum_known,
            seen: sum_seen,
        };
        let verdict = sums.times(reference).verdict(agreement, self.confusion(&drawn.share));
        let squares: f64 = seen.iter().map(|q| q * q).sum();
        Some(PartState {
            part,
            verdict,
            agreement,
            bounds: self.bounds_of(part),
            point_in_image: (sum_seen * reference >= LEAST[0]).then(|| self.middle(&seen)),
            area: sum_seen * self.area,
            probability: if sum_seen > 0.0 { squares / sum_seen } else { 0.0 },
            area_of_model: sum_drawn * self.area,
            known_share,
            point_in_camera: drawn.middle,
            point_in_vehicle: drawn.middle.map(|point| self.vehicle_from_camera * point),
        })
    }

    /// The share of what is drawn around a part that the mask labels otherwise.
    fn confusion(&self, own: &[f64]) -> f64 {
        let m = self.m as isize;
        let reach = (AROUND * self.m as f64 / 28.0).round().max(1.0) as isize;
        let near = |cell: usize, far: isize| {
            let (x, y) = ((cell as isize) % m, (cell as isize) / m);
            let line = move |at: isize| (at - far).max(0)..=(at + far).min(m - 1);
            line(y).any(|j| line(x).any(|i| own[(j * m + i) as usize] > 0.0))
        };
        let (mut wrong, mut all) = (0.0, 0.0);
        for cell in 0..self.m * self.m {
            let known = self.known[cell];
            // The part itself says nothing of how reliable its surroundings are.
            if known == 0.0 || near(cell, 0) || !near(cell, reach) {
                continue;
            }
            let mut right = 0.0;
            let mut drawn = [0.0f64; CHANNELS];
            self.samples_of(cell, |label| drawn[usize::from(label)] += 1.0);
            let samples = (self.s * self.s) as f64;
            for (label, drawn) in drawn.iter().enumerate().filter(|(_, drawn)| **drawn > 0.0) {
                let q = self.detection.probabilities.channel(label)[cell];
                right += (drawn / samples).min(f64::from(q));
            }
            wrong += known * (1.0 - right).max(0.0);
            all += known;
        }
        // Without surroundings nothing is known of them.
        if all > 0.0 { wrong / all } else { 1.0 }
    }

    /// Hands over the labels that are drawn on a cell.
    fn samples_of(&self, cell: usize, mut take: impl FnMut(u8)) {
        let n = self.m * self.s;
        let start = (cell / self.m) * self.s * n + (cell % self.m) * self.s;
        for row in 0..self.s {
            self.picture.parts[start + row * n..][..self.s].iter().for_each(|label| take(*label));
        }
    }

    /// The least and the most that is drawn of a part at the pose and slightly turned against it, cells.
    fn at_any_turn(&self, part: PartClass) -> (f64, f64) {
        let count = |labels: &Vec<u8>| -> usize {
            labels.iter().map(|label| usize::from(*label == part.id())).sum()
        };
        let counts = self.turned.iter().chain([&self.picture.parts]).map(count);
        let (least, most) =
            counts.fold((usize::MAX, 0), |(least, most), n| (least.min(n), most.max(n)));
        let per_sample = 1.0 / (self.s * self.s) as f64;
        (least as f64 * per_sample, most as f64 * per_sample)
    }

    fn drawn(&self, part: PartClass) -> Drawn {
        let n = self.m * self.s;
        let mut share = vec![0.0; self.m * self.m];
        let per_sample = 1.0 / (self.s * self.s) as f64;
        let (mut sum, mut count) = (Vector3::zeros(), 0usize);
        for (at, label) in self.picture.parts.iter().enumerate() {
            if *label != part.id() {
                continue;
            }
            let (x, y) = (at % n, at / n);
            share[y / self.s * self.m + x / self.s] += per_sample;
            let ray = self.camera.ray(&Point2::new(x as f64, y as f64));
            sum += ray * f64::from(self.picture.depths[at]);
            count += 1;
        }
        let middle = (count > 0).then(|| Point3::from(sum / count as f64));
        Drawn { share, middle }
    }

    /// How much of `own` has `other` in the same cell or one beside it, 0 to 1.
    fn overlap(&self, own: &[f64], other: &[f64]) -> f64 {
        let m = self.m as isize;
        let near = |cell: usize| {
            let (x, y) = ((cell as isize) % m, (cell as isize) / m);
            let mut sum = 0.0;
            for j in (y - 1).max(0)..=(y + 1).min(m - 1) {
                for i in (x - 1).max(0)..=(x + 1).min(m - 1) {
                    sum += other[(j * m + i) as usize];
                }
            }
            sum
        };
        let (mut met, mut all) = (0.0, 0.0);
        for (cell, own) in own.iter().enumerate().filter(|(_, own)| **own > 0.0) {
            met += own.min(near(cell));
            all += own;
        }
        if all > 0.0 { met / all } else { 0.0 }
    }

    /// The mean place of cells, pixels.
    fn middle(&self, weights: &[f64]) -> Point2 {
        let bounds = &self.detection.bounds;
        let (mut sum, mut all) = (nalgebra::Vector2::zeros(), 0.0);
        for (cell, weight) in weights.iter().enumerate() {
            let x = ((cell % self.m) as f64 + 0.5) / self.m as f64;
            let y = ((cell / self.m) as f64 + 0.5) / self.m as f64;
            sum += nalgebra::Vector2::new(x, y) * *weight;
            all += weight;
        }
        let middle = sum / all.max(1e-12);
        Point2::new(
            bounds.x_min + middle.x * bounds.width(),
            bounds.y_min + middle.y * bounds.height(),
        )
    }

    /// The rectangle around the pixels that bear the part.
    fn bounds_of(&self, part: PartClass) -> Option<Rect> {
        let [x0, y0] = self.mask.origin.map(f64::from);
        let mut bounds: Option<[f64; 4]> = None;
        for (j, row) in self.mask.rows().enumerate() {
            let Some(first) = row.iter().position(|label| *label == part.id()) else { continue };
            let last = row.iter().rposition(|label| *label == part.id()).unwrap_or(first);
            let (left, right, y) = (x0 + first as f64, x0 + last as f64, y0 + j as f64);
            let b = bounds.unwrap_or([left, y, right, y]);
            bounds = Some([b[0].min(left), b[1], b[2].max(right), y]);
        }
        bounds.map(|[left, top, right, bottom]| Rect::from_inclusive(left, top, right, bottom))
    }
}

/// A part on the drawn model.
struct Drawn {
    /// Share of each cell.
    share: Vec<f64>,
    /// Middle of the visible surface, camera frame.
    middle: Option<Point3>,
}

/// Cells of a 28 x 28 kernel that a part takes.
#[derive(Clone, Copy, Debug)]
struct Sums {
    drawn: f64,
    /// Drawn where something is known, at the turn that shows least of it.
    least: f64,
    /// Drawn at the turn that shows most of it.
    most: f64,
    known: f64,
    seen: f64,
}

impl Sums {
    fn times(self, factor: f64) -> Self {
        Self {
            drawn: self.drawn * factor,
            least: self.least * factor,
            most: self.most * factor,
            known: self.known * factor,
            seen: self.seen * factor,
        }
    }

    /// `confusion` is the share of the mask around that is wrong.
    fn verdict(&self, agreement: f64, confusion: f64) -> PartVerdict {
        if self.known < SMALLEST && self.seen < LEAST[1] {
            let hidden = self.drawn >= LEAST[1] && self.known < 0.5 * self.drawn;
            return if hidden { PartVerdict::Hidden } else { PartVerdict::TooSmall };
        }
        let chance = confusion.powf(1.0 + self.least / CORRELATED);
        if agreement >= DISPLACED {
            PartVerdict::Agrees
        } else if self.least >= SMALLEST && self.seen < MISSING * self.least {
            if chance < CHANCE { PartVerdict::Missing } else { PartVerdict::TooSmall }
        } else if self.least.max(self.seen) < LEAST[1] {
            PartVerdict::TooSmall
        } else if self.most < MISSING * self.seen {
            PartVerdict::Unexpected
        } else {
            PartVerdict::Displaced
        }
    }
}
