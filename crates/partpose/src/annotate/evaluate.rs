//! How well labels are transferred: strip a labelled model, annotate it from the others, compare.

use crate::vehicle::{Mesh, PartialModel, VehicleModel};

use super::outside::Seen;
use super::{AnnotateError, AnnotateOptions, Sources, Transfer, transfer};

/// Agreement of transferred labels with the true ones, as shares of area.
#[derive(Clone, Debug, PartialEq)]
pub struct Agreement {
    /// The model that was stripped.
    pub name: String,
    /// Its body style.
    pub body_style: String,
    /// The sources that voted, best first.
    pub sources: Vec<String>,
    /// Of what can be seen from the horizon or above.
    pub outside: f64,
    /// Of the whole surface.
    pub all: f64,
    /// Area-weighted mean of the confidence, of what can be seen.
    pub confidence: f64,
    /// For ten bins of confidence: area seen and the part of it that is right, square metres.
    pub reliability: [[f64; 2]; 10],
    /// For each part (by index) true area, transferred area, area where both agree; of what can be seen.
    pub parts: [[f64; 3]; 29],
}

/// Strips each model and transfers labels to it from the models of other body styles.
///
/// A model for which no source is left, or that cannot be annotated, is told with the reason.
pub fn leave_style_out(
    targets: &[VehicleModel],
    sources: &Sources,
    options: &AnnotateOptions,
    progress: &mut dyn FnMut(usize),
) -> Vec<(String, Result<Agreement, AnnotateError>)> {
    let mut results = Vec::new();
    for (i, model) in targets.iter().enumerate() {
        progress(i);
        let others = sources.retained(|source| source.body_style() != model.body_style());
        results.push((model.name().to_owned(), agreement(model, &others, options)));
    }
    progress(targets.len());
    results
}

/// Strips a model of its labels and compares what the sources give it.
pub fn agreement(
    model: &VehicleModel,
    sources: &Sources,
    options: &AnnotateOptions,
) -> Result<Agreement, AnnotateError> {
    let Mesh { vertices, faces, parts } = model.mesh().clone();
    let partial = PartialModel {
        name: model.name().to_owned(),
        category: model.category().to_owned(),
        body_style: String::from("unknown"),
        extent: model.extent(),
        vertices,
        faces,
        parts: vec![None; parts.len()],
    };
    // Which parts a vehicle has is known to whoever annotates it.
    let mut options = options.clone();
    options.without.extend(model.missing_parts());
    let transfer = transfer(&partial, sources, &options)?;
    Ok(compare(model, &transfer))
}

fn compare(model: &VehicleModel, transfer: &Transfer) -> Agreement {
    let truth = &model.mesh().parts;
    let mut agreement = Agreement {
        name: model.name().to_owned(),
        body_style: model.body_style().to_owned(),
        sources: transfer.sources.iter().map(|source| source.name.clone()).collect(),
        outside: 0.0,
        all: 0.0,
        confidence: 0.0,
        reliability: [[0.0; 2]; 10],
        parts: [[0.0; 3]; 29],
    };
    let (mut seen_area, mut all_area) = (0.0, 0.0);
    for (i, origin) in transfer.surface.origins.iter().enumerate() {
        let area = transfer.surface.area(i);
        let (given, found) = (truth[*origin as usize], transfer.parts[i]);
        let right = if given == found { area } else { 0.0 };
        all_area += area;
        agreement.all += right;
        if transfer.seen[i] != Seen::FromAbove {
            continue;
        }
        seen_area += area;
        agreement.outside += right;
        let confidence = f64::from(transfer.confidence[i]);
        agreement.confidence += confidence * area;
        let bin = &mut agreement.reliability[((10.0 * confidence) as usize).min(9)];
        bin[0] += area;
        bin[1] += right;
        agreement.parts[given.index()][0] += area;
        agreement.parts[found.index()][1] += area;
        agreement.parts[given.index()][2] += right;
    }
    agreement.all /= all_area.max(1e-12);
    agreement.outside /= f64::max(seen_area, 1e-12);
    agreement.confidence /= f64::max(seen_area, 1e-12);
    agreement
}
