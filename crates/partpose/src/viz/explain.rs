//! Why a vehicle was found where it was: mask, fit, residual, what else was weighed, and how sure the answer is.

mod above;
mod close_up;
mod words;

use crate::detection::Detection;
use crate::files::RgbImage;
use crate::geometry::{Camera, Cuboid, Rect};
use crate::pose::{NoPose, PoseEstimate};
use crate::vehicle::ModelZoo;

use super::canvas::{Canvas, Pen, TextStyle};
use super::scene::palette;

use close_up::CloseUp;

/// One vehicle to explain.
#[derive(Clone, Copy, Debug)]
pub struct Explanation<'a> {
    /// Written above, such as the name of the frame and the vehicle.
    pub title: &'a str,
    /// The camera of the image.
    pub camera: Camera,
    /// The photograph; the vehicle stands on dark ground where there is none or it has another size.
    pub image: Option<&'a RgbImage>,
    /// What was seen.
    pub detection: &'a Detection,
    /// What was made of it.
    pub outcome: &'a Result<PoseEstimate, NoPose>,
    /// The zoo that the estimate's models are of.
    pub zoo: &'a ModelZoo,
    /// Where the vehicle stands in truth, if that is known.
    pub truth: Option<Cuboid>,
}

/// Width of the picture.
const WIDTH: u32 = 1240;
/// Height of the title.
const HEADER: i32 = 26;
/// Width and height of a close-up, and of the caption under it.
const PANEL: [i32; 2] = [300, 232];
const CAPTION: i32 = 18;
/// Free pixels between panels.
const GAP: i32 = 8;
/// Hypotheses that are drawn.
const THUMBNAILS: usize = 6;
/// Width and height of a hypothesis' close-up, and of the lines under it.
const THUMBNAIL: [i32; 2] = [197, 128];
const LINES: i32 = 40;

/// Draws the explanation of one vehicle.
pub fn explain(explanation: &Explanation) -> RgbImage {
    let columns = words::columns(explanation);
    let words_height = words::height(&columns);
    let hypotheses = hypotheses(explanation);
    let thumbnails = if hypotheses.is_empty() { 0 } else { THUMBNAIL[1] + LINES + GAP };
    let height = HEADER + PANEL[1] + CAPTION + GAP + thumbnails + words_height + GAP;
    let mut canvas = Canvas::new([WIDTH, height as u32], palette::MARGIN);
    canvas.text([GAP, 9], explanation.title, TextStyle::plain(palette::TEXT));
    let close = CloseUp::new(explanation, PANEL);
    let found = match explanation.truth {
        Some(_) => "the fit's parts; mask white, true cuboid green",
        None => "the fit's parts; the mask's outline is white",
    };
    let above = above::caption(explanation);
    let pictures = [
        (close.mask(), "what the detector says: parts, its box yellow"),
        (close.fit(), found),
        (close.residual(), "residual: yellow contradicts, blue is unknown"),
        (above::picture(explanation, PANEL), above.as_str()),
    ];
    for (i, (picture, caption)) in pictures.iter().enumerate() {
        let at = [GAP + i as i32 * (PANEL[0] + GAP), HEADER];
        place(&mut canvas, picture, at, caption);
    }
    let top = HEADER + PANEL[1] + CAPTION + GAP;
    let small = CloseUp::new(explanation, THUMBNAIL);
    for (i, hypothesis) in hypotheses.iter().enumerate() {
        let at = [GAP + i as i32 * (THUMBNAIL[0] + GAP), top];
        place(&mut canvas, &small.hypothesis(&hypothesis.0), at, &hypothesis.1);
        let below = [at[0], at[1] + THUMBNAIL[1] + 5 + 13];
        canvas.text(below, &hypothesis.2, TextStyle::plain(palette::DIM));
    }
    words::write(&mut canvas, &columns, top + thumbnails);
    canvas.into_rgb()
}

/// A picture with a frame and a line under it.
fn place(canvas: &mut Canvas, picture: &RgbImage, at: [i32; 2], caption: &str) {
    canvas.paste(picture, at);
    let [width, height] = picture.size.map(f64::from);
    let (x, y) = (f64::from(at[0]), f64::from(at[1]));
    let frame = Rect::new(x - 0.5, y - 0.5, x + width - 0.5, y + height - 0.5);
    canvas.rectangle(&frame, Pen { color: [70, 76, 88, 255], width: 1.0 });
    let below = [at[0], at[1] + picture.size[1] as i32 + 5];
    canvas.text(below, caption, TextStyle::plain(palette::DIM));
}

/// What is drawn of hypotheses: model and cuboid, and two lines.
fn hypotheses(explanation: &Explanation) -> Vec<(close_up::Posed, String, String)> {
    let Ok(estimate) = explanation.outcome else { return Vec::new() };
    let Some(report) = &estimate.dense else { return Vec::new() };
    let name = |index: usize| estimate.candidates.get(index).map_or("", |c| c.model.as_str());
    let one = |h: &crate::pose::dense::DenseHypothesis| {
        let posed = close_up::Posed {
            model: h.model_index,
            cuboid: Cuboid { camera_from_vehicle: h.camera_from_vehicle, extent: h.extent },
        };
        let level = ["coarse", "middle", "fine"][h.level.min(2)];
        let (z, energy) = (h.camera_from_vehicle.translation.z, h.energy);
        let turn = h.camera_from_vehicle.rotation.angle_to(&estimate.camera_from_vehicle.rotation);
        let second = format!("z {z:.1} m, turned {:.0} deg, {level}", turn.to_degrees());
        (posed, format!("{} E {energy:.3}", name(h.model_index)), second)
    };
    report.hypotheses.iter().take(THUMBNAILS).map(one).collect()
}
