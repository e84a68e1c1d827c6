//! Why a detection has no pose, or what limits the one it has: a code for programs and words for people.

use serde::Serialize;

use super::dense::{DenseFlag, DenseReport, ModeKind};
use super::{NoPose, PoseEstimate};

/// Confidence below which a dense fit's pose is called unsure.
const UNSURE: f64 = 0.5;
/// Correspondences below which a pose of points rests on too few parts.
const FEW: usize = 6;
/// Reprojection error in pixels above which a pose of points is called poor.
const POOR: f64 = 5.0;
/// Models whose errors are within this factor of the best's are not told apart by points.
const ALIKE: f64 = 1.1;

/// What is wrong, for programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ReasonCode {
    /// Too few parts, or too small a piece of the vehicle, are seen.
    TooFewParts,
    /// The box is empty.
    EmptyBox,
    /// The box shows nothing of the image.
    OutsideImage,
    /// The solver of the part centres failed.
    SolverFailed,
    /// No model could be placed.
    NoStart,
    /// There is no model.
    NoModel,
    /// The model explains the mask badly at its best pose.
    PoorFit,
    /// The descent had not arrived when it was stopped.
    NotConverged,
    /// Another pose explains the mask nearly as well.
    AmbiguousPose,
    /// Several models explain the mask nearly as well.
    ModelsDisagree,
    /// The image's border cuts the vehicle.
    Truncated,
    /// Another vehicle hides a part of the outline.
    Occluded,
    /// Something unlabelled hides a part of the vehicle.
    HiddenByUnlabelled,
    /// A side differs more from what is likely than vehicles do.
    OutsideSizePrior,
    /// The bottom lies off the given ground.
    OffGround,
    /// A part of the vehicle is nearer than a metre.
    TooNear,
    /// The size was not given, so the distance rests on likely sizes.
    SizeUnknown,
    /// The pose is more likely bad than good.
    LowConfidence,
}

/// One thing that speaks against a pose, or prevented one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Reason {
    /// For programs.
    pub code: ReasonCode,
    /// For people, with numbers.
    pub words: String,
}

impl Reason {
    fn new(code: ReasonCode, words: impl Into<String>) -> Self {
        Self { code, words: words.into() }
    }
}

/// Everything that prevented a pose or limits what may be made of it; nothing for a good pose of known size.
pub fn reasons(outcome: &Result<PoseEstimate, NoPose>) -> Vec<Reason> {
    match outcome {
        Err(no_pose) => vec![Reason::new(code_of(no_pose), no_pose.to_string())],
        Ok(estimate) => match &estimate.dense {
            Some(report) => of_dense(estimate, report),
            None => of_points(estimate),
        },
    }
}

fn code_of(no_pose: &NoPose) -> ReasonCode {
    match no_pose {
        NoPose::TooFewCorrespondences { .. } | NoPose::TooLittleEvidence { .. } => {
            ReasonCode::TooFewParts
        }
        NoPose::Solver(_) => ReasonCode::SolverFailed,
        NoPose::EmptyBox => ReasonCode::EmptyBox,
        NoPose::OutsideImage => ReasonCode::OutsideImage,
        NoPose::NoStart => ReasonCode::NoStart,
        NoPose::NoModel => ReasonCode::NoModel,
    }
}

fn of_points(estimate: &PoseEstimate) -> Vec<Reason> {
    let mut reasons = Vec::new();
    let inliers = estimate.correspondences.iter().filter(|c| c.inlier).count();
    if inliers < FEW {
        let words = format!("the pose rests on {inliers} parts");
        reasons.push(Reason::new(ReasonCode::TooFewParts, words));
    }
    if let Some(rmse) = estimate.reprojection_rmse.filter(|rmse| *rmse > POOR) {
        let words = format!("the parts' centres are missed by {rmse:.1} px");
        reasons.push(Reason::new(ReasonCode::PoorFit, words));
    }
    if let Some(other) = &estimate.alternative {
        let words =
            format!("another pose misses the parts by {:.1} px only", other.reprojection_rmse);
        reasons.push(Reason::new(ReasonCode::AmbiguousPose, words));
    }
    let error = |name: &str| {
        let own = estimate.candidates.iter().find(|c| c.model == name)?;
        own.outcome.as_ref().ok().copied()
    };
    let best = error(&estimate.model).unwrap_or(0.0);
    let alike: Vec<&str> = estimate
        .candidates
        .iter()
        .filter(|c| c.model != estimate.model)
        .filter(|c| c.outcome.as_ref().is_ok_and(|error| *error < ALIKE * best))
        .map(|c| c.model.as_str())
        .collect();
    if !alike.is_empty() {
        let words = format!("{} fits nearly as well as {}", alike.join(", "), estimate.model);
        reasons.push(Reason::new(ReasonCode::ModelsDisagree, words));
    }
    reasons
}

fn of_dense(estimate: &PoseEstimate, report: &DenseReport) -> Vec<Reason> {
    let mut reasons = Vec::new();
    if report.confidence < UNSURE {
        let words = format!(
            "the probability of a good pose (3D IoU above 0.5) is {:.2}",
            report.confidence
        );
        reasons.push(Reason::new(ReasonCode::LowConfidence, words));
    }
    let of_flag = |flag: &DenseFlag| {
        let (code, words) = words_of(*flag, estimate, report);
        Reason::new(code, words)
    };
    reasons.extend(report.flags.iter().map(of_flag));
    reasons
}

fn words_of(
    flag: DenseFlag,
    estimate: &PoseEstimate,
    report: &DenseReport,
) -> (ReasonCode, String) {
    match flag {
        DenseFlag::LittleEvidence => (
            ReasonCode::TooFewParts,
            format!("only {:.1} cells of a 28 x 28 mask show the vehicle", report.foreground),
        ),
        DenseFlag::PoorFit => (
            ReasonCode::PoorFit,
            format!(
                "the model explains the mask badly: energy {:.2} a cell, {:.0} % beyond the outline",
                report.energy,
                100.0 * report.overshoot
            ),
        ),
        DenseFlag::NotConverged => {
            (ReasonCode::NotConverged, "the fit was still improving when it was stopped".to_owned())
        }
        DenseFlag::AmbiguousPose => (ReasonCode::AmbiguousPose, second_in_words(report)),
        DenseFlag::AmbiguousModel => {
            (ReasonCode::ModelsDisagree, models_in_words(estimate, report))
        }
        DenseFlag::TooNear => {
            (ReasonCode::TooNear, "a part of the vehicle is nearer than 1 m".to_owned())
        }
        DenseFlag::SizeAtPriorLimit => {
            let e = estimate.extent;
            let words = format!(
                "{:.2} x {:.2} x {:.2} m (width, height, length) is more than 3 standard deviations from likely",
                e.width, e.height, e.length
            );
            (ReasonCode::OutsideSizePrior, words)
        }
        DenseFlag::OffGround => {
            (ReasonCode::OffGround, "the wheels do not stand on the given ground".to_owned())
        }
        DenseFlag::HiddenByUnlabelled => (
            ReasonCode::HiddenByUnlabelled,
            "something without a label seems to hide a part of the vehicle".to_owned(),
        ),
        DenseFlag::CutByImage => {
            (ReasonCode::Truncated, "the border of the image cuts the vehicle".to_owned())
        }
        DenseFlag::HiddenByVehicle => {
            (ReasonCode::Occluded, "something hides a part of the vehicle's outline".to_owned())
        }
        DenseFlag::SizeUnknown => {
            let d = &report.depth_and_size;
            let words = format!(
                "the size was not given: the distance is known to {:.2} m (to {:.2} m if it were)",
                d.depth_sd, d.depth_sd_if_size_known
            );
            (ReasonCode::SizeUnknown, words)
        }
    }
}

fn second_in_words(report: &DenseReport) -> String {
    let Some(second) = &report.second_mode else { return String::new() };
    let what = match second.kind {
        ModeKind::LeftAndRight => "left and right could be exchanged",
        ModeKind::FrontAndBack => "front and back could be exchanged",
        ModeKind::TurnedAbout => "the vehicle could be turned about",
        ModeKind::OtherAngle => "the vehicle could stand at another angle",
        ModeKind::OtherDistance => "the vehicle could stand at another distance",
    };
    format!("{what}: probability {:.2}", second.probability)
}

fn models_in_words(estimate: &PoseEstimate, report: &DenseReport) -> String {
    let mut models: Vec<(f64, &str)> = report
        .model_probabilities
        .iter()
        .zip(&estimate.candidates)
        .map(|(probability, candidate)| (*probability, candidate.model.as_str()))
        .collect();
    models.sort_by(|a, b| b.0.total_cmp(&a.0));
    let said = models.iter().take(3).map(|(probability, name)| format!("{name} {probability:.2}"));
    format!("models disagree: {}", said.collect::<Vec<_>>().join(", "))
}
