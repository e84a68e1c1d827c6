//! The fit of every model of a zoo to one detection (paper, § III-D).

use serde::{Deserialize, Serialize};

use crate::detection::Detection;
use crate::geometry::{Camera, Cuboid, Extent, Point2, Point3, Pose, Rect, Vector3, wrap_angle};
use crate::parts::{PartClass, PartMap, Scaling};
use crate::pnp::PnpError;
use crate::render::LabelRenderer;
use crate::vehicle::{Mesh, ModelZoo};

use super::dense::{DenseFit, DenseOptions, DensePriors, DenseReport, DenseZoo, SizePrior};
use super::fit::{self, Fit, Problem};
use super::observed::{self, PartState, Placed};
use super::ranking::Ranking;
use super::visible::{self, View, Viewpoint};
use super::{Center2d, Center3d, PartFilters, model_centers, part_evidence};

/// Fewest correspondences that are fitted (paper, § III-D).
pub(super) const MIN_CORRESPONDENCES: usize = 4;
/// Rounds of drawing the model at its pose and solving again.
const VISIBLE_ROUNDS: usize = 4;
/// Viewpoints of the table that are followed up for each model.
const VISIBLE_STARTS: usize = 3;
/// Largest angle between a viewpoint of the table and the pose solved from it; beyond it the two contradict.
const VIEWPOINT_TOLERANCE: f64 = 0.45;
/// Smallest share of the drawn vehicle's samples for a part's centre to count as seen.
const MIN_VISIBLE_SHARE: f64 = 0.002;

/// How a pose is found from correspondences.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PnpMethod {
    /// The paper's.
    Epnp,
    /// All minima of the algebraic error, the best first.
    Sqpnp,
    /// P3P on triples with outliers rejected, refined on the inliers.
    Ransac,
    /// No correspondences: the drawn model against every probability ([`super::dense`]). Scaling, centres, filters and
    /// `refine` have no say in it.
    Dense,
}

/// How a pose is estimated; the defaults are the paper's last row of Table V.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PoseOptions {
    /// How kernels become masks.
    pub scaling: Scaling,
    /// O2D.
    pub center_2d: Center2d,
    /// O3D.
    pub center_3d: Center3d,
    /// Which parts may speak.
    pub filters: PartFilters,
    /// Solver.
    pub method: PnpMethod,
    /// What models are compared by; the dense fit always weighs all evidence.
    pub ranking: Ranking,
    /// Whether Levenberg-Marquardt with a robust loss and each part's own covariance follows.
    pub refine: bool,
    /// Seed of whatever is random (only RANSAC with many points is).
    pub seed: u64,
    /// What the dense fit supposes; of no account to the others.
    pub dense: DenseOptions,
}

impl Default for PoseOptions {
    fn default() -> Self {
        Self {
            scaling: Scaling::Bilinear,
            center_2d: Center2d::Rectangle,
            center_3d: Center3d::Cuboid,
            filters: PartFilters::ALL,
            method: PnpMethod::Epnp,
            ranking: Ranking::Error,
            refine: false,
            seed: 0,
            dense: DenseOptions::default(),
        }
    }
}

/// Where the size of the vehicle comes from; one image alone cannot tell it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExtentSource {
    /// Every model keeps its own.
    Model,
    /// Every model is scaled per axis to this extent, as the paper does with the true one.
    Given(Extent),
    /// Every model is scaled by one factor to the volume of this extent, and keeps its shape.
    GivenUniform(Extent),
    /// Every model starts with the likely size, to which [`Detection::size`] adds what was seen, and is stretched by what
    /// the mask says. Only the dense fit can; the others take the size that was seen, else the model's own.
    Free(SizePrior),
}

impl ExtentSource {
    /// The factors per axis for a model of extent `model`.
    pub fn scale(&self, model: &Extent) -> Vector3 {
        match self {
            Self::Model => Vector3::repeat(1.0),
            Self::Free(prior) => prior.mean.map_or(Vector3::repeat(1.0), |mean| mean.ratio(model)),
            Self::Given(extent) => extent.ratio(model),
            Self::GivenUniform(extent) => {
                Vector3::repeat((extent.volume() / model.volume()).cbrt())
            }
        }
    }
}

/// A correspondence as it was used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartCorrespondence {
    /// The part.
    pub part: PartClass,
    /// Its centre in the image, pixels.
    pub point_in_image: Point2,
    /// Its centre on the scaled model, metres in the vehicle frame.
    pub point_in_vehicle: Point3,
    /// Distance of the centre's projection from `point_in_image`, pixels.
    pub residual: f64,
    /// Whether the fit counts it as right.
    pub inlier: bool,
}

/// How one model of the zoo fared.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Name of the model.
    pub model: String,
    /// What models are compared by, or why there is no pose: the root mean square reprojection error in pixels, where
    /// an outlier of RANSAC counts as far as its threshold; with the dense fit the energy per foreground cell.
    pub outcome: Result<f64, NoPose>,
}

/// Another pose that explains the same correspondences nearly as well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alternative {
    /// The pose.
    pub camera_from_vehicle: Pose,
    /// As [`PoseEstimate::reprojection_rmse`].
    pub reprojection_rmse: f64,
}

/// A vehicle's pose, size and model.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseEstimate {
    /// Name of the model with the lowest error.
    pub model: String,
    /// Its place in the zoo.
    pub model_index: usize,
    /// The pose.
    pub camera_from_vehicle: Pose,
    /// Size of the scaled model.
    pub extent: Extent,
    /// Factors per axis that the model is scaled with.
    pub scale: Vector3,
    /// Root mean square distance of projections and centres over the inliers, pixels; `None` without correspondences.
    pub reprojection_rmse: Option<f64>,
    /// The pose on the other side of the ambiguity that nearly flat parts leave, where it fits almost as well.
    pub alternative: Option<Alternative>,
    /// What was used; nothing with the dense fit.
    pub correspondences: Vec<PartCorrespondence>,
    /// All models in the order of the zoo.
    pub candidates: Vec<Candidate>,
    /// What only the dense fit knows.
    pub dense: Option<DenseReport>,
    /// What the mask shows of each part; empty until [`PoseEstimator::observe`] has looked.
    pub parts: Vec<PartState>,
}

impl PoseEstimate {
    /// The predicted 3D box.
    pub fn cuboid(&self) -> Cuboid {
        Cuboid { camera_from_vehicle: self.camera_from_vehicle, extent: self.extent }
    }
}

/// Why a detection has no pose.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoPose {
    /// The paper's *unfittable*.
    #[error(
        "{found} parts are left to fit of {seen} seen, at least {MIN_CORRESPONDENCES} are needed"
    )]
    TooFewCorrespondences {
        /// Parts that mask and model share after the filters.
        found: usize,
        /// Parts that the mask shows.
        seen: usize,
    },
    /// The solver found none.
    #[error(transparent)]
    Solver(#[from] PnpError),
    /// The box has no area.
    #[error("the box of the detection is empty")]
    EmptyBox,
    /// The box shows nothing of the image.
    #[error("the box of the detection lies outside the image")]
    OutsideImage,
    /// Too little of the vehicle is seen for the dense fit.
    #[error("{found:.1} cells of a 28 x 28 mask show the vehicle, too few to fit")]
    TooLittleEvidence {
        /// Cells that show it, in cells of a 28 x 28 kernel.
        found: f64,
    },
    /// The dense fit could not place any model: no start lies in front of the camera.
    #[error("no model could be placed in front of the camera")]
    NoStart,
    /// The zoo has no model.
    #[error("there is no model to fit")]
    NoModel,
}

/// What the estimator needs of a model, computed once: the paper's lookup table.
#[derive(Clone, Debug)]
struct ModelEntry {
    name: String,
    extent: Extent,
    mesh: Mesh,
    is_closed: bool,
    centers: PartMap<Point3>,
    viewpoints: Vec<Viewpoint>,
}

/// Fits the models of a zoo to detections.
#[derive(Clone, Debug)]
pub struct PoseEstimator {
    options: PoseOptions,
    models: Vec<ModelEntry>,
    dense: Option<DenseZoo>,
}

impl PoseEstimator {
    /// Computes the tables of all models.
    pub fn new(zoo: &ModelZoo, options: &PoseOptions) -> Self {
        let entry = |model: &crate::vehicle::VehicleModel| ModelEntry {
            name: model.name().to_owned(),
            extent: model.extent(),
            mesh: model.mesh().clone(),
            is_closed: model.mesh().is_closed() && model.mesh().volume() > 0.0,
            centers: model_centers(model, options.center_3d),
            viewpoints: match options.center_3d {
                Center3d::Visible => visible::viewpoint_table(model, options.center_2d),
                Center3d::Mass | Center3d::Cuboid => Vec::new(),
            },
        };
        let dense =
            (options.method == PnpMethod::Dense).then(|| DenseZoo::new(zoo, &options.dense));
        Self { options: *options, models: zoo.models.iter().map(entry).collect(), dense }
    }

    /// The options it was made with.
    pub fn options(&self) -> &PoseOptions {
        &self.options
    }

    /// Pose, size and model of a detection.
    pub fn estimate(
        &self,
        camera: &Camera,
        detection: &Detection,
        extent: &ExtentSource,
    ) -> Result<PoseEstimate, NoPose> {
        self.estimate_with(camera, detection, extent, &DensePriors::default())
    }

    /// The same with what is known of the scene; only the dense fit makes use of it.
    pub fn estimate_with(
        &self,
        camera: &Camera,
        detection: &Detection,
        extent: &ExtentSource,
        priors: &DensePriors,
    ) -> Result<PoseEstimate, NoPose> {
        if detection.bounds.area() <= 0.0 {
            return Err(NoPose::EmptyBox);
        }
        if detection.bounds.intersection(&camera.image_rect()).is_none() {
            return Err(NoPose::OutsideImage);
        }
        if let Some(dense) = &self.dense {
            return self.dense_estimate(dense.fit(camera, detection, extent, priors)?);
        }
        // Points cannot stretch a model: what is seen of the size is taken as it is.
        let extent = &match (extent, &detection.size) {
            (ExtentSource::Free(_), Some(seen)) => ExtentSource::Given(seen.extent),
            (extent, _) => *extent,
        };
        let mask = detection.part_mask(camera.size, self.options.scaling);
        let mut parts = part_evidence(&mask, self.options.center_2d);
        let seen = parts.len();
        self.options.filters.apply(&mut parts, &detection.bounds, camera.size);
        if parts.len() < MIN_CORRESPONDENCES {
            return Err(NoPose::TooFewCorrespondences { found: parts.len(), seen });
        }
        let problem = Problem { camera, detection, parts };
        let mut renderer = LabelRenderer::default();
        let fits: Vec<Result<Fit, NoPose>> = self
            .models
            .iter()
            .map(|model| self.fit(model, &problem, extent.scale(&model.extent), &mut renderer))
            .collect();
        self.choose(fits, &problem, extent)
    }

    /// What the detection's mask shows of each part, against the estimate's model at its pose; kept in
    /// [`PoseEstimate::parts`].
    pub fn observe(&self, camera: &Camera, detection: &Detection, estimate: &mut PoseEstimate) {
        let Some(model) = self.models.get(estimate.model_index) else { return };
        let placed = Placed {
            mesh: &model.mesh,
            scale: estimate.scale,
            camera_from_vehicle: estimate.camera_from_vehicle,
            is_closed: model.is_closed,
        };
        estimate.parts = observed::part_states(camera, detection, &placed);
    }

    /// The model that least speaks against; of equals the first.
    fn choose(
        &self,
        fits: Vec<Result<Fit, NoPose>>,
        problem: &Problem,
        extent: &ExtentSource,
    ) -> Result<PoseEstimate, NoPose> {
        let camera = problem.camera;
        let against = |index: &usize| {
            let error = fits[*index].as_ref().map_or(f64::INFINITY, |fit| fit.error);
            let model = (self.models[*index].name.as_str(), &self.models[*index].extent);
            self.options.ranking.against(error, model, problem.detection, extent)
        };
        let best = (0..fits.len()).min_by(|a, b| against(a).total_cmp(&against(b)));
        let best = best.ok_or(NoPose::NoModel)?;
        let candidates = self.models.iter().zip(&fits).map(|(model, fit)| Candidate {
            model: model.name.clone(),
            outcome: fit.as_ref().map(|fit| fit.error).map_err(NoPose::clone),
        });
        let candidates = candidates.collect();
        let fit = fits.into_iter().nth(best).ok_or(NoPose::NoModel)??;
        let model = &self.models[best];
        let alternative = fit::alternative(&fit, camera);
        let scale = extent.scale(&model.extent);
        let size = model.extent.to_vector().component_mul(&scale);
        let correspondences =
            fit.correspondences.iter().zip(&fit.inliers).map(|((part, c), inlier)| {
                let projected = camera.project(&(fit.camera_from_vehicle * c.point_in_object));
                PartCorrespondence {
                    part: *part,
                    point_in_image: c.point_in_image,
                    point_in_vehicle: c.point_in_object,
                    residual: projected
                        .map_or(f64::INFINITY, |pixel| (pixel - c.point_in_image).norm()),
                    inlier: *inlier,
                }
            });
        Ok(PoseEstimate {
            model: model.name.clone(),
            model_index: best,
            camera_from_vehicle: fit.camera_from_vehicle,
            extent: Extent::new(size.x, size.y, size.z),
            scale,
            reprojection_rmse: Some(fit.rmse),
            alternative,
            correspondences: correspondences.collect(),
            candidates,
            dense: None,
            parts: Vec::new(),
        })
    }

    fn dense_estimate(&self, fit: DenseFit) -> Result<PoseEstimate, NoPose> {
        let model = self.models.get(fit.model).ok_or(NoPose::NoModel)?;
        let candidate = |(model, energy): (&ModelEntry, &Result<f64, NoPose>)| Candidate {
            model: model.name.clone(),
            outcome: energy.clone(),
        };
        Ok(PoseEstimate {
            model: model.name.clone(),
            model_index: fit.model,
            camera_from_vehicle: fit.camera_from_vehicle,
            extent: fit.extent,
            scale: fit.extent.ratio(&model.extent),
            reprojection_rmse: None,
            alternative: None,
            correspondences: Vec::new(),
            candidates: self.models.iter().zip(&fit.candidates).map(candidate).collect(),
            dense: Some(fit.report),
            parts: Vec::new(),
        })
    }

    fn fit(
        &self,
        model: &ModelEntry,
        problem: &Problem,
        scale: Vector3,
        renderer: &mut LabelRenderer,
    ) -> Result<Fit, NoPose> {
        let scaled = model.centers.map(|_, center| scaled_point(center, &scale));
        let fixed = fit::solve(problem, &scaled, &self.options);
        if self.options.center_3d != Center3d::Visible {
            return fixed;
        }
        let mut best = Err(NoPose::TooFewCorrespondences { found: 0, seen: problem.parts.len() });
        for start in self.visible_starts(model, problem, &scale, fixed.as_ref().ok()) {
            let refined = self.follow_visible(model, problem, &scale, start, renderer);
            best = fit::better(best, refined);
        }
        // Without any viewpoint that works the fixed centres are better than nothing.
        best.or(fixed)
    }

    /// Poses to start from: those of the table's most consistent viewpoints, and that of the fixed centres.
    fn visible_starts(
        &self,
        model: &ModelEntry,
        problem: &Problem,
        scale: &Vector3,
        fixed: Option<&Fit>,
    ) -> Vec<Pose> {
        let mut starts: Vec<(f64, Pose)> = Vec::new();
        for viewpoint in &model.viewpoints {
            let mut points = viewpoint.parts.clone();
            points.retain(|_, (_, share)| *share > MIN_VISIBLE_SHARE);
            let points = points.map(|_, (point, _)| scaled_point(point, scale));
            let Ok(fit) = fit::solve(problem, &points, &self.options) else { continue };
            let turn = wrap_angle(visible::azimuth(&fit.camera_from_vehicle) - viewpoint.azimuth);
            if turn.abs() < VIEWPOINT_TOLERANCE {
                starts.push((fit.score(), fit.camera_from_vehicle));
            }
        }
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        starts.truncate(VISIBLE_STARTS);
        starts
            .into_iter()
            .map(|(_, pose)| pose)
            .chain(fixed.map(|fit| fit.camera_from_vehicle))
            .collect()
    }

    /// Draws the model at its pose, takes the centres that are seen, solves again, a few times over.
    fn follow_visible(
        &self,
        model: &ModelEntry,
        problem: &Problem,
        scale: &Vector3,
        start: Pose,
        renderer: &mut LabelRenderer,
    ) -> Result<Fit, NoPose> {
        let image = problem.camera.image_rect();
        let window: Rect = problem.detection.bounds;
        let known = |pixel: &Point2| visible::knows(problem.detection, &image, pixel);
        let mut best = Err(NoPose::TooFewCorrespondences { found: 0, seen: problem.parts.len() });
        let mut camera_from_vehicle = start;
        for _ in 0..VISIBLE_ROUNDS {
            let view = View {
                camera: problem.camera,
                mesh: &model.mesh,
                scale: *scale,
                camera_from_vehicle,
                is_closed: model.is_closed,
            };
            let seen =
                visible::visible_parts(&view, &window, self.options.center_2d, known, renderer);
            let points = seen.map(|_, part| part.point_in_vehicle);
            let fit = match fit::solve(problem, &points, &self.options) {
                Ok(fit) => fit,
                Err(reason) => return best.or(Err(reason)),
            };
            let moved = (fit.camera_from_vehicle.translation.vector
                - camera_from_vehicle.translation.vector)
                .norm();
            camera_from_vehicle = fit.camera_from_vehicle;
            best = fit::better(best, Ok(fit));
            if moved < 1e-3 * camera_from_vehicle.translation.vector.norm() {
                break;
            }
        }
        best
    }
}

fn scaled_point(point: &Point3, scale: &Vector3) -> Point3 {
    Point3::from(point.coords.component_mul(scale))
}
