//! What is told of an annotation: a table of parts, a line, and the record beside the model.

use std::fmt::Write;

use partpose::annotate::Annotation;
use partpose::parts::{PartClass, PartMap};

/// Areas of a part in square metres.
#[derive(Clone, Copy, Default)]
struct Areas {
    given: f64,
    transferred: f64,
    /// Transferred area times confidence.
    sure: f64,
}

fn areas(annotation: &Annotation) -> PartMap<Areas> {
    let mesh = annotation.model.mesh();
    let mut areas: PartMap<Areas> = PartMap::default();
    for (i, face) in mesh.faces.iter().enumerate() {
        let [a, b, c] = face.map(|index| mesh.vertices[index as usize]);
        let area = 0.5 * (b - a).cross(&(c - a)).norm();
        let part = mesh.parts[i];
        let mut sum = areas.get(part).copied().unwrap_or_default();
        if annotation.transferred[i] {
            sum.transferred += area;
            sum.sure += area * f64::from(annotation.confidence[i]);
        } else {
            sum.given += area;
        }
        areas.insert(part, sum);
    }
    areas
}

/// Part by part what was given and what was transferred, with the mean confidence of the latter.
pub(super) fn parts(annotation: &Annotation) -> String {
    let areas = areas(annotation);
    let mut text = "part          given m2  transferred m2  confidence\n".to_owned();
    for part in PartClass::ALL {
        let Areas { given, transferred, sure } = areas.get(part).copied().unwrap_or_default();
        let confidence =
            if transferred > 0.0 { format!("{:.2}", sure / transferred) } else { "-".to_owned() };
        let name = part.name();
        let _ = writeln!(text, "{name:<12}  {given:>8.3}  {transferred:>14.3}  {confidence:>10}");
    }
    text
}

/// Parts whose transferred faces are less sure than `limit` on average.
pub(super) fn unsure(annotation: &Annotation, limit: f64) -> Vec<(PartClass, f64)> {
    let areas = areas(annotation);
    let transferred = areas.iter().filter(|(_, areas)| areas.transferred > 0.0);
    let means = transferred.map(|(part, areas)| (part, areas.sure / areas.transferred));
    means.filter(|(_, mean)| *mean < limit).collect()
}

/// One line: how much was transferred, how sure, from where.
pub(super) fn summary(annotation: &Annotation) -> String {
    let (mut given, mut transferred, mut sure) = (0.0, 0.0, 0.0);
    for (_, areas) in areas(annotation).iter() {
        given += areas.given;
        transferred += areas.transferred;
        sure += areas.sure;
    }
    let share = 100.0 * transferred / (given + transferred).max(1e-12);
    let sources: Vec<String> = annotation
        .sources
        .iter()
        .map(|source| format!("`{}` {:.0} %", source.name, 100.0 * source.weight))
        .collect();
    let mut text = format!(
        "transferred {transferred:.2} m2 ({share:.0} % of the surface), mean confidence {:.2}, from {}",
        sure / f64::max(transferred, 1e-12),
        sources.join(", "),
    );
    if annotation.hidden_area > 0.0 {
        let _ = write!(text, "; left out {:.2} m2 that nobody sees", annotation.hidden_area);
    }
    text
}

/// The record: which faces of the file, in its order, were transferred, and how sure each of them is.
pub(super) fn record(annotation: &Annotation) -> String {
    let runs: Vec<(bool, usize)> =
        annotation.transferred.chunk_by(|a, b| a == b).map(|run| (run[0], run.len())).collect();
    let percent = |value: &f32| (100.0 * value).round() as u8;
    let sources: Vec<serde_json::Value> = annotation
        .sources
        .iter()
        .map(|source| {
            let round = |value: f64| (1e4 * value).round() / 1e4;
            serde_json::json!({
                "name": source.name,
                "body_style": source.body_style,
                "distance": round(source.distance),
                "residual": round(source.residual),
                "weight": round(source.weight),
            })
        })
        .collect();
    let transferred = annotation.transferred.iter().zip(&annotation.confidence);
    let confidence: Vec<u8> =
        transferred.filter(|(is, _)| **is).map(|(_, confidence)| percent(confidence)).collect();
    let record = serde_json::json!({
        "version": env!("CARGO_PKG_VERSION"),
        "model": annotation.model.name(),
        "sources": sources,
        "faces": annotation.transferred.len(),
        "transferred_runs": runs,
        "confidence_percent": confidence,
    });
    record.to_string() + "\n"
}
