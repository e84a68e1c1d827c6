//! How well models of other vehicles stand in for those that a data set shows.
//!
//! A model made without the data set, such as a parametric sedan, takes the place of a mesh of the same body style: at the
//! true pose, scaled to the true extent, its silhouette and parts are compared with the masks, by the rules of
//! [`measure_quality`]. Nothing is fitted.

use crate::dataset::Frame;
use crate::parts::PartClass;
use crate::vehicle::{ModelError, VehicleModel};

use super::Progress;
use super::quality::{QualityOptions, ViewQuality, measure_quality};
use super::view::UNKNOWN;

/// Compares models with the views of a mesh name each; results carry the mesh name.
///
/// Of several models with one mesh name, the first is taken.
pub fn measure_stand_ins(
    frames: &[Frame],
    pairs: &[(&VehicleModel, &str)],
    options: &QualityOptions,
    observer: &mut dyn FnMut(Progress),
) -> Result<Vec<ViewQuality>, ModelError> {
    let renamed = pairs.iter().map(|(model, mesh_name)| {
        let (category, style) = (model.category(), model.body_style());
        VehicleModel::new(mesh_name, category, style, model.extent(), model.mesh().clone())
    });
    let models: Vec<VehicleModel> = renamed.collect::<Result<_, _>>()?;
    Ok(measure_quality(frames, &models, &|_, _| true, options, observer))
}

/// How one part of the masks is met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartAgreement {
    /// The part as annotated.
    pub part: PartClass,
    /// Its pixels in all views.
    pub pixels: u64,
    /// How many of them are rendered as the same part.
    pub right: u64,
    /// What the others are rendered as most often (`None`: background), and how many of them.
    pub instead: (Option<PartClass>, u64),
}

/// Every annotated part of some views, in the order of ids; parts that no view shows are left out.
pub fn part_agreements(views: &[&ViewQuality]) -> Vec<PartAgreement> {
    const IDS: usize = PartClass::COUNT + 1;
    let mut counts = vec![[0u64; IDS]; IDS];
    for view in views {
        for (observed, rendered) in view.observed.iter().zip(&view.rendered) {
            if *observed != UNKNOWN {
                counts[usize::from(*observed).min(IDS - 1)][usize::from(*rendered).min(IDS - 1)] +=
                    1;
            }
        }
    }
    let agreement = |part: PartClass| {
        let own = usize::from(part.id());
        let row = &counts[own];
        let instead = (0..IDS).filter(|other| *other != own).max_by_key(|other| row[*other])?;
        Some(PartAgreement {
            part,
            pixels: row.iter().sum(),
            right: row[own],
            instead: (PartClass::from_id(instead as u8), row[instead]),
        })
    };
    let all = PartClass::ALL.into_iter().filter_map(agreement);
    all.filter(|agreement| agreement.pixels > 0).collect()
}
