//! What is made of a fit: which model, which of two poses, how far to trust it, and what speaks against it.
//!
//! Hypotheses are weighed by their energies: a difference of a certain share of the best energy makes one e times less
//! likely. That share, and the weights of what [`confidence`] looks at, were found on world 0001 with clean and degraded
//! masks, and are checked on world 0018 (`docs/dense-fit.md`, "How sure it is").

use nalgebra::{Matrix6, SMatrix};
use serde::Serialize;

use crate::geometry::{Camera, Extent, Pose, Rect, Vector3, wrap_angle};

use super::models::{self, Hypothesis, LEVELS, NEIGHBOURS};
use super::shape::ShapeMeasure;
use super::state::State;

/// How much more energy, as a share of the best and in cells besides, makes a hypothesis e times less likely.
const TEMPER: [f64; 2] = [0.05, 1e-3];
/// Relative difference of distances from which two poses are two.
const FARTHER: f64 = 0.1;
/// Cells below which a fit is flagged.
const LITTLE_EVIDENCE: f64 = 12.0;
/// Energy per foreground cell above which a fit is flagged as poor.
const POOR: f64 = 0.25;
/// How far a vehicle may reach beyond the mask's own outline, as a share of it. Cells end at the box, so the energy
/// knows nothing of what lies beyond.
const POOR_OVERSHOOT: f64 = 0.25;

/// In what a second pose differs from the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ModeKind {
    /// The other side faces the camera, the same end: left and right are exchanged.
    LeftAndRight,
    /// The other end faces the camera, the same side: front and back are exchanged.
    FrontAndBack,
    /// The vehicle is turned about: both are exchanged.
    TurnedAbout,
    /// The same side and end face the camera, at another angle.
    OtherAngle,
    /// Turned alike, at another distance.
    OtherDistance,
}

/// Another pose that explains the mask, too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecondMode {
    /// What it exchanges.
    pub kind: ModeKind,
    /// Its model's place in the zoo.
    pub model_index: usize,
    /// The pose.
    pub camera_from_vehicle: Pose,
    /// The size.
    pub extent: Extent,
    /// As [`DenseReport::energy`], from the level at which it was given up.
    pub energy: f64,
    /// Its probability against the first.
    pub probability: f64,
}

/// What speaks against a fit, or limits what may be made of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum DenseFlag {
    /// Fewer than 12 cells of a 28 x 28 kernel show the vehicle.
    LittleEvidence,
    /// The drawn model explains the mask badly: energy per foreground cell above 0.25, or it reaches beyond the mask's
    /// own outline by more than a quarter of that.
    PoorFit,
    /// The descent had not arrived when it was stopped.
    NotConverged,
    /// A second pose has a probability above 0.1.
    AmbiguousPose,
    /// The best model has a probability below 0.7.
    AmbiguousModel,
    /// A part of the vehicle is nearer than a metre or behind the camera.
    TooNear,
    /// A side differs from the likely size by more than 3 standard deviations.
    SizeAtPriorLimit,
    /// The bottom lies more than 4 standard deviations off the given ground.
    OffGround,
    /// Background deep inside the vehicle was taken for something unlabelled in front of it.
    HiddenByUnlabelled,
    /// The image's border cuts the vehicle.
    CutByImage,
    /// Another vehicle hides a part of the outline.
    HiddenByVehicle,
    /// The size was not given, so that the distance rests on sizes that are likely.
    SizeUnknown,
}

/// How distance and size trade off: scaling both changes no picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DepthAndSize {
    /// Standard deviation of the distance along the viewing axis, metres.
    pub depth_sd: f64,
    /// The same if the true size were known, metres.
    pub depth_sd_if_size_known: f64,
    /// Correlation of the distance's error with that of the size (the logarithm of the volume); 0 where the size was
    /// given.
    pub correlation: f64,
}

/// A pose and model that was followed, with its energy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DenseHypothesis {
    /// The model's place in the zoo.
    pub model_index: usize,
    /// The pose.
    pub camera_from_vehicle: Pose,
    /// The size.
    pub extent: Extent,
    /// Energy per foreground cell.
    pub energy: f64,
    /// 0 coarse, 1 middle, 2 fine: where it was given up. Energies of different levels do not compare.
    pub level: usize,
}

/// What the dense fit knows besides pose, size and model.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseReport {
    /// The data term per cell that shows the vehicle: 0 for a perfect fit, 1 for none.
    pub energy: f64,
    /// Cells of a 28 x 28 kernel that show the vehicle.
    pub foreground: f64,
    /// How far the vehicle reaches beyond the mask's own outline, as a share of it.
    pub overshoot: f64,
    /// Covariance of a rotation vector in camera axes about the cuboid's centre (radians, the true rotation is
    /// `exp(w) R`) and of the centre's place in the camera frame (metres).
    pub covariance: Matrix6<f64>,
    /// The same with the logarithms of width, height and length as rows 6 to 8, where they were free.
    pub covariance_with_size: Option<SMatrix<f64, 9, 9>>,
    /// How distance and size trade off.
    pub depth_and_size: DepthAndSize,
    /// Probability of each model of the zoo, in its order.
    pub model_probabilities: Vec<f64>,
    /// The best pose that is not the first.
    pub second_mode: Option<SecondMode>,
    /// The best hypotheses that were followed, the finest and best first, the estimate's own among them.
    pub hypotheses: Vec<DenseHypothesis>,
    /// The probability that estimate and truth share more than half of their volumes (3D IoU above 0.5).
    pub confidence: f64,
    /// What speaks against it.
    pub flags: Vec<DenseFlag>,
    /// The measures that were fitted beside pose and size; none unless asked for (`DenseOptions::fit_shape`), and none
    /// where the model's own are as good.
    pub shape: Vec<ShapeMeasure>,
    /// Pictures that were drawn to find it.
    pub pictures: usize,
}

/// Hypotheses that a report keeps.
const KEPT: usize = 6;

/// The best hypotheses that differ, for those who want to see what was weighed.
pub(super) fn kept(hypotheses: &[Hypothesis], foreground: f64) -> Vec<DenseHypothesis> {
    let mut kept: Vec<&Hypothesis> = Vec::new();
    for hypothesis in hypotheses {
        if kept.len() < KEPT && !kept.iter().any(|other| hypothesis.repeats(other)) {
            kept.push(hypothesis);
        }
    }
    let keep = |h: &&Hypothesis| DenseHypothesis {
        model_index: h.model,
        camera_from_vehicle: h.scored.state.pose(),
        extent: h.scored.state.extent(),
        energy: h.scored.data / foreground,
        level: h.level,
    };
    kept.iter().map(keep).collect()
}

/// The probability of each model: by its best energy against the best at the finest level that it reached.
pub(super) fn model_probabilities(hypotheses: &[Hypothesis], count: usize) -> Vec<f64> {
    let mut odds = vec![0.0; count];
    for (model, odds) in odds.iter_mut().enumerate() {
        if let Some(own) = hypotheses.iter().find(|h| h.model == model) {
            *odds = relative(hypotheses, own).exp();
        }
    }
    let sum: f64 = odds.iter().sum();
    odds.iter().map(|odds| odds / sum.max(1e-300)).collect()
}

/// Makes models less likely by what a detector says against them: `against` holds a logarithm of odds for each, in which
/// energies are expressed by the same measure that makes probabilities of them. Sorts anew.
pub(super) fn weigh_models(hypotheses: &mut [Hypothesis], against: &[f64]) {
    let mut least = [f64::INFINITY; LEVELS.len()];
    for h in hypotheses.iter() {
        least[h.level] = least[h.level].min(h.scored.energy);
    }
    for h in hypotheses.iter_mut() {
        h.scored.energy += against[h.model] * (TEMPER[0] * least[h.level] + TEMPER[1]);
    }
    models::sort(hypotheses);
}

/// The logarithm of a hypothesis' odds against the best of its level; never more than 0.
fn relative(hypotheses: &[Hypothesis], own: &Hypothesis) -> f64 {
    let of_level = hypotheses.iter().filter(|h| h.level == own.level);
    let best = of_level.map(|h| h.scored.energy).fold(f64::INFINITY, f64::min);
    ((best - own.scored.energy) / (TEMPER[0] * best + TEMPER[1])).min(0.0)
}

/// The likeliest hypothesis that is turned by more than 30 degrees against the best, or a tenth of its distance away,
/// and did not become another on the way to finer levels.
pub(super) fn second_mode(hypotheses: &[Hypothesis], foreground: f64) -> Option<SecondMode> {
    let first = hypotheses.first()?;
    let own = &first.scored.state;
    let second = hypotheses
        .iter()
        .filter(|h| !is_near(own, &h.scored.state))
        .filter(|h| {
            // What went on to a finer level is judged there.
            let mut finer = hypotheses.iter().filter(|other| other.level > h.level);
            !finer.any(|other| is_near(&h.scored.state, &other.scored.state))
        })
        .max_by(|a, b| against(hypotheses, own, a).total_cmp(&against(hypotheses, own, b)))?;
    let odds = against(hypotheses, own, second).exp();
    let state: &State = &second.scored.state;
    Some(SecondMode {
        kind: kind(own, state),
        model_index: second.model,
        camera_from_vehicle: state.pose(),
        extent: state.extent(),
        energy: second.scored.data / foreground,
        probability: odds / (1.0 + odds),
    })
}

/// Whether two poses are one mode.
fn is_near(a: &State, b: &State) -> bool {
    a.rotation.angle_to(&b.rotation) <= NEIGHBOURS
        && (a.center - b.center).norm() <= FARTHER * a.center.norm()
}

/// The logarithm of a hypothesis' odds against what became the best, at the level where it was given up; never more
/// than 0.
fn against(hypotheses: &[Hypothesis], best: &State, own: &Hypothesis) -> f64 {
    let of_level = hypotheses.iter().filter(|h| h.level == own.level);
    let line = of_level.filter(|h| is_near(best, &h.scored.state)).map(|h| h.scored.energy);
    let best = line.fold(f64::INFINITY, f64::min);
    if !best.is_finite() {
        return relative(hypotheses, own);
    }
    ((best - own.scored.energy) / (TEMPER[0] * best + TEMPER[1])).min(0.0)
}

/// What is exchanged between two poses of a vehicle.
fn kind(first: &State, second: &State) -> ModeKind {
    let (a, b) = (heading(first), heading(second));
    if first.rotation.angle_to(&second.rotation) <= NEIGHBOURS {
        return ModeKind::OtherDistance;
    }
    // The second is near what is seen with sides, ends or both exchanged, or near none of them.
    let exchanged = [
        (ModeKind::OtherAngle, a),
        (ModeKind::LeftAndRight, -a),
        (ModeKind::FrontAndBack, std::f64::consts::PI - a),
        (ModeKind::TurnedAbout, std::f64::consts::PI + a),
    ];
    let miss = |angle: f64| wrap_angle(angle - b).abs();
    let nearest = exchanged.into_iter().min_by(|p, q| miss(p.1).total_cmp(&miss(q.1)));
    nearest.map_or(ModeKind::OtherAngle, |(kind, _)| kind)
}

/// The vehicle's heading against the line of sight, about its own down axis: 0 where its rear is seen.
fn heading(state: &State) -> f64 {
    let sight = state.rotation.inverse() * state.center;
    -sight.x.atan2(sight.z)
}

/// What [`confidence`] looks at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Evidence {
    /// Energy per foreground cell.
    pub(super) energy: f64,
    pub(super) foreground: f64,
    pub(super) overshoot: f64,
    /// Probability of the best model.
    pub(super) model: f64,
    /// Probability of the first mode against the second.
    pub(super) mode: f64,
    /// Standard deviation of the distance, as a share of the vehicle's length.
    pub(super) depth: f64,
    /// Standard deviation of the heading, radians.
    pub(super) turn: f64,
}

impl Evidence {
    pub(super) const COUNT: usize = 8;

    /// What the logistic model multiplies, 1 first.
    pub(super) fn features(&self) -> [f64; Self::COUNT] {
        [
            1.0,
            self.energy.clamp(0.005, 1.0).ln(),
            self.foreground.clamp(1.0, 784.0).ln(),
            self.overshoot.clamp(0.0, 0.5),
            self.model.clamp(0.01, 0.99).ln(),
            self.mode.clamp(0.01, 0.99).ln(),
            self.depth.clamp(1e-3, 3.0).ln(),
            self.turn.clamp(1e-3, 1.0).ln(),
        ]
    }
}

/// Weights of [`Evidence::features`].
const WEIGHTS: [f64; Evidence::COUNT] = [-1.37, 1.33, 0.11, -0.24, 0.67, 0.47, -1.91, -0.74];

/// The probability that the fit is good: logistic in its evidence.
pub(super) fn confidence(evidence: &Evidence) -> f64 {
    let sum: f64 = evidence.features().iter().zip(WEIGHTS).map(|(a, b)| a * b).sum();
    let probability = 1.0 / (1.0 + (-sum).exp());
    if probability.is_finite() { probability } else { 0.0 }
}

/// What is needed to say what speaks against a fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Suspicion {
    pub(super) evidence: Evidence,
    pub(super) converged: bool,
    /// Depth of the cuboid's nearest corner, metres.
    pub(super) nearest: f64,
    /// Standard deviations.
    pub(super) size_deviation: f64,
    /// Standard deviations.
    pub(super) ground_deviation: f64,
    /// Share of the vehicle behind something unlabelled.
    pub(super) hidden: f64,
    /// What cuts the outline, if anything does.
    pub(super) cut: Option<DenseFlag>,
    pub(super) size_is_unknown: bool,
}

impl Suspicion {
    pub(super) fn flags(&self) -> Vec<DenseFlag> {
        let e = &self.evidence;
        let raised = [
            (e.foreground < LITTLE_EVIDENCE, DenseFlag::LittleEvidence),
            (e.energy > POOR || e.overshoot > POOR_OVERSHOOT, DenseFlag::PoorFit),
            (!self.converged, DenseFlag::NotConverged),
            (e.mode < 0.9, DenseFlag::AmbiguousPose),
            (e.model < 0.7, DenseFlag::AmbiguousModel),
            (self.nearest < 1.0, DenseFlag::TooNear),
            (self.size_deviation > 3.0, DenseFlag::SizeAtPriorLimit),
            (self.ground_deviation > 4.0, DenseFlag::OffGround),
            (self.hidden > 0.0, DenseFlag::HiddenByUnlabelled),
            (self.size_is_unknown, DenseFlag::SizeUnknown),
        ];
        let raised = raised.into_iter().filter(|(raised, _)| *raised).map(|(_, flag)| flag);
        raised.chain(self.cut).collect()
    }
}

/// Whether a box reaches the image's border.
pub(super) fn is_cut(bounds: &Rect, camera: &Camera) -> bool {
    let image = camera.image_rect();
    bounds.x_min <= image.x_min + 1.0
        || bounds.y_min <= image.y_min + 1.0
        || bounds.x_max >= image.x_max - 1.0
        || bounds.y_max >= image.y_max - 1.0
}

/// How distance and size trade off, from the covariance of both.
pub(super) fn depth_and_size(
    covariance: &SMatrix<f64, 9, 9>,
    depth_variance_if_known: f64,
    is_free: bool,
) -> DepthAndSize {
    const DEPTH: usize = 5;
    let variance = covariance[(DEPTH, DEPTH)];
    let known = depth_variance_if_known.min(variance).max(0.0);
    if !is_free {
        // The error of a size that was not fitted moves the distance the same way.
        let share = if variance > 0.0 { (1.0 - known / variance).max(0.0).sqrt() } else { 0.0 };
        return DepthAndSize {
            depth_sd: variance.sqrt(),
            depth_sd_if_size_known: known.sqrt(),
            correlation: share,
        };
    }
    let sizes = covariance.fixed_view::<3, 3>(6, 6).into_owned();
    let with = covariance.fixed_view::<1, 3>(DEPTH, 6).into_owned();
    let mean = Vector3::repeat(1.0 / 3.0);
    let scale = (mean.transpose() * sizes * mean)[0];
    let correlation = (with * mean)[0] / (variance * scale).sqrt();
    let explained = sizes.cholesky().map_or(0.0, |c| (with * c.solve(&with.transpose()))[0]);
    DepthAndSize {
        depth_sd: variance.sqrt(),
        depth_sd_if_size_known: (variance - explained).max(0.0).sqrt(),
        correlation: if correlation.is_finite() { correlation.clamp(-1.0, 1.0) } else { 0.0 },
    }
}
