//! What a picture cannot show: probabilities, deviations, parts that do not agree, reasons.

use crate::geometry::Rect;
use crate::pose::dense::DenseReport;
use crate::pose::{PartVerdict, PoseEstimate, reasons};
use crate::viz::canvas::{Canvas, TextStyle};
use crate::viz::scene::palette;

use super::{Explanation, GAP};

/// Pixels a line.
const LINE: i32 = 14;
/// Characters a column holds.
const CHARACTERS: usize = 64;
/// Probability below which a second mode is not worth a line.
pub(super) const NEGLIGIBLE: f64 = 0.005;
/// Left ends of the columns.
const LEFT: [i32; 3] = [GAP, GAP + 412, GAP + 824];
/// Pixels of a bar that stands for 1.
const BAR: f64 = 90.0;
const BAR_COLOR: [u8; 4] = [90, 160, 230, 255];

/// A line of text, with a bar before it if it is a probability.
pub(super) struct Line {
    text: String,
    bar: Option<f64>,
    dim: bool,
}

impl Line {
    fn text(text: impl Into<String>) -> Self {
        Self { text: text.into(), bar: None, dim: false }
    }

    fn head(text: &str) -> Self {
        Self { text: text.to_owned(), bar: None, dim: true }
    }

    fn bar(share: f64, text: String) -> Self {
        Self { text, bar: Some(share), dim: false }
    }
}

/// Three columns: what was found, which model, what speaks against it.
pub(super) fn columns(explanation: &Explanation) -> [Vec<Line>; 3] {
    let mut against = vec![Line::head("what limits it")];
    let reasons = reasons(explanation.outcome);
    if reasons.is_empty() {
        against.push(Line::text("nothing"));
    }
    for reason in reasons {
        wrap(&mut against, &reason.words);
    }
    let Ok(estimate) = explanation.outcome else {
        return [vec![Line::text("no pose")], Vec::new(), against];
    };
    parts(&mut against, estimate);
    let mut found = vec![Line::head("what was found")];
    place(&mut found, explanation, estimate);
    let mut models = Vec::new();
    match &estimate.dense {
        Some(report) => sure(&mut found, &mut models, estimate, report),
        None => {
            models.push(Line::head("models, error in pixels"));
            for candidate in &estimate.candidates {
                let error = candidate.outcome.as_ref();
                let said = error.map_or_else(ToString::to_string, |error| format!("{error:.2}"));
                wrap(&mut models, &format!("{} {said}", candidate.model));
            }
        }
    }
    [found, models, against]
}

fn place(found: &mut Vec<Line>, explanation: &Explanation, estimate: &PoseEstimate) {
    let t = estimate.camera_from_vehicle.translation.vector;
    let e = estimate.extent;
    found.push(Line::text(format!("{} at ({:.2}, {:.2}, {:.2}) m", estimate.model, t.x, t.y, t.z)));
    found.push(Line::text(format!(
        "width {:.2}, height {:.2}, length {:.2} m",
        e.width, e.height, e.length
    )));
    if let Some(truth) = &explanation.truth {
        let own = estimate.cuboid();
        let off = truth.center() - own.center();
        found.push(Line::text(format!(
            "off the truth by ({:+.2}, {:+.2}, {:+.2}) m, 3D IoU {:.2}",
            -off.x,
            -off.y,
            -off.z,
            own.iou(truth)
        )));
    }
}

fn sure(
    found: &mut Vec<Line>,
    models: &mut Vec<Line>,
    estimate: &PoseEstimate,
    report: &DenseReport,
) {
    let sd = |i: usize| report.covariance[(i, i)].max(0.0).sqrt();
    found.push(Line::text(format!(
        "sd sideways {:.2}, up {:.2}, depth {:.2} m",
        sd(3),
        sd(4),
        sd(5)
    )));
    found.push(Line::text(format!(
        "sd about right {:.1}, down {:.1}, ahead {:.1} deg",
        sd(0).to_degrees(),
        sd(1).to_degrees(),
        sd(2).to_degrees()
    )));
    let d = &report.depth_and_size;
    if d.correlation > 0.0 {
        found.push(Line::text(format!(
            "depth and size correlate by {:.2}; sd {:.2} m if the size were known",
            d.correlation, d.depth_sd_if_size_known
        )));
    }
    found.push(Line::text(format!(
        "energy {:.3} a cell, {:.0} cells show the vehicle",
        report.energy, report.foreground
    )));
    found.push(Line::bar(report.confidence, format!("confidence {:.2}", report.confidence)));
    models.push(Line::head("models"));
    let mut likely: Vec<(f64, &str)> = report
        .model_probabilities
        .iter()
        .zip(&estimate.candidates)
        .map(|(probability, candidate)| (*probability, candidate.model.as_str()))
        .collect();
    likely.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (probability, name) in likely.iter().take(6) {
        models.push(Line::bar(*probability, format!("{probability:.2} {name}")));
    }
    if let Some(second) = report.second_mode.filter(|second| second.probability >= NEGLIGIBLE) {
        models.push(Line::head("second mode"));
        let turn = second
            .camera_from_vehicle
            .rotation
            .angle_to(&estimate.camera_from_vehicle.rotation)
            .to_degrees();
        let z = second.camera_from_vehicle.translation.z;
        let what = format!("{:?}", second.kind).chars().fold(String::new(), |mut text, c| {
            if c.is_uppercase() && !text.is_empty() {
                text.push(' ');
            }
            text.extend(c.to_lowercase());
            text
        });
        models.push(Line::bar(
            second.probability,
            format!("{:.2} {what}, {turn:.0} deg, z {z:.1} m", second.probability),
        ));
    }
}

/// Parts that do not agree, by verdict.
fn parts(lines: &mut Vec<Line>, estimate: &PoseEstimate) {
    if estimate.parts.is_empty() {
        return;
    }
    let agreeing = estimate.parts.iter().filter(|p| p.verdict == PartVerdict::Agrees).count();
    lines.push(Line::head("parts"));
    lines.push(Line::text(format!("{agreeing} agree with the model")));
    let verdicts = [
        (PartVerdict::Missing, "missing"),
        (PartVerdict::Displaced, "displaced"),
        (PartVerdict::Unexpected, "unexpected"),
        (PartVerdict::Hidden, "hidden"),
    ];
    for (verdict, name) in verdicts {
        let of: Vec<&str> = estimate
            .parts
            .iter()
            .filter(|part| part.verdict == verdict)
            .map(|part| part.part.name())
            .collect();
        if !of.is_empty() {
            wrap(lines, &format!("{name}: {}", of.join(", ")));
        }
    }
}

/// Breaks a text between words.
fn wrap(lines: &mut Vec<Line>, text: &str) {
    let mut line = String::new();
    for word in text.split_whitespace() {
        if !line.is_empty() && line.len() + word.len() + 1 > CHARACTERS {
            lines.push(Line::text(std::mem::take(&mut line)));
            line.push_str("  ");
        }
        if !line.trim().is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    lines.push(Line::text(line));
}

/// Rows that the columns need.
pub(super) fn height(columns: &[Vec<Line>; 3]) -> i32 {
    columns.iter().map(Vec::len).max().unwrap_or(0) as i32 * LINE + GAP
}

pub(super) fn write(canvas: &mut Canvas, columns: &[Vec<Line>; 3], top: i32) {
    for (column, left) in columns.iter().zip(LEFT) {
        for (row, line) in column.iter().enumerate() {
            let y = top + 4 + row as i32 * LINE;
            let mut x = left;
            if let Some(share) = line.bar {
                let (from, middle) = (f64::from(x), f64::from(y));
                let full = Rect::new(from, middle - 1.0, from + BAR, middle + 8.0);
                canvas.fill_rectangle(&full, [52, 56, 66, 255]);
                let filled = Rect { x_max: from + BAR * share.clamp(0.0, 1.0), ..full };
                canvas.fill_rectangle(&filled, BAR_COLOR);
                x += BAR as i32 + 8;
            }
            let color = if line.dim { palette::DIM } else { palette::TEXT };
            canvas.text([x, y], &line.text, TextStyle::plain(color));
        }
    }
}
