//! Where a descent starts: headings all around, each placed where the vehicle's outline fits the mask's.
//!
//! For a heading and a size, an edge of the mask's outline (left, top, right or bottom) says that the extreme vertex on
//! that side lies on a plane through the camera, which is linear in the translation. Edges are used only where the mask
//! knows what lies beyond: not at the image's border, not where another vehicle begins.

use nalgebra::{Matrix3, UnitQuaternion};

use crate::geometry::{Camera, Point2, Point3, Vector3};
use crate::parts::{CHANNELS, PartMap};
use crate::pnp::{self, Correspondence, RefineOptions};

use super::priors::across;
use super::state::State;
use super::target::Target;

/// Headings that are tried: 15 degrees apart.
pub(super) const HEADINGS: usize = 24;
/// Rounds of finding the extreme vertices and placing the vehicle: where all edges are its own, and where not.
const ROUNDS: [usize; 2] = [3, 6];
/// Weight of what is only supposed, against a trusted edge.
const SUPPOSED: f64 = 0.03;

/// The outline of a mask as rays: left, top, right, bottom, and whether each is trusted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outline {
    /// x / z of left and right, y / z of top and bottom.
    edges: [f64; 4],
    trusted: [bool; 4],
}

impl Outline {
    /// `None` where no cell shows the vehicle.
    pub(super) fn new(target: &Target, camera: &Camera) -> Option<Self> {
        let m = target.cells;
        let known = |cell: usize| target.weights[cell] > 0.0;
        let shown =
            |cell: usize| if known(cell) { 1.0 - target.probabilities[cell][0] } else { 0.0 };
        let image = camera.image_rect();
        let bounds = &target.bounds;
        let mut edges = [0.0; 4];
        let mut trusted = [false; 4];
        for side in 0..4 {
            // Lines run from the outside inwards; `line` and `along` make a cell.
            let cell = |line: usize, along: usize| match side {
                0 => along * m + line,
                1 => line * m + along,
                2 => along * m + (m - 1 - line),
                _ => (m - 1 - line) * m + along,
            };
            let first = (0..m).find(|line| (0..m).any(|i| shown(cell(*line, i)) > 0.5))?;
            let rim: Vec<usize> = (0..m).filter(|i| shown(cell(first, *i)) > 0.5).collect();
            let part = match first {
                0 => 0.0,
                _ => rim.iter().map(|i| shown(cell(first - 1, *i))).fold(0.0, f32::max),
            };
            let inset = (first as f64 - f64::from(part)) / m as f64;
            let beyond = match (first, side) {
                (0, 0) => bounds.x_min > image.x_min + 1.0,
                (0, 1) => bounds.y_min > image.y_min + 1.0,
                (0, 2) => bounds.x_max < image.x_max - 1.0,
                (0, _) => bounds.y_max < image.y_max - 1.0,
                _ => 2 * rim.iter().filter(|i| known(cell(first - 1, **i))).count() > rim.len(),
            };
            let pixel = match side {
                0 => bounds.x_min + inset * bounds.width(),
                1 => bounds.y_min + inset * bounds.height(),
                2 => bounds.x_max - inset * bounds.width(),
                _ => bounds.y_max - inset * bounds.height(),
            };
            edges[side] = camera.ray(&Point2::new(pixel, pixel))[side % 2];
            trusted[side] = beyond;
        }
        Some(Self { edges, trusted })
    }

    /// Whether the distance follows from edges alone.
    fn tells_distance(&self) -> bool {
        let [left, top, right, bottom] = self.trusted;
        (left && right) || (top && bottom)
    }

    /// The same, with one of the sides left, top, right and bottom taken for something else's.
    #[must_use]
    pub(super) fn without(&self, side: usize) -> Self {
        let mut trusted = self.trusted;
        trusted[side] = false;
        Self { trusted, ..*self }
    }

    /// Whether every edge is the vehicle's own.
    pub(super) fn is_whole(&self) -> bool {
        self.trusted.iter().all(|trusted| *trusted)
    }

    /// How far a vehicle reaches beyond the trusted edges, as a share of the outline's width or height; 0 if nowhere.
    /// `vertices` are in half-extent units.
    pub(super) fn overshoot(&self, vertices: &[Vector3], state: &State) -> f64 {
        let [left, top, right, bottom] = self.edges;
        let sizes = [right - left, bottom - top].map(|size| size.max(1e-9));
        let mut most = 0.0f64;
        for vertex in vertices {
            let p = state.center + state.rotation * vertex.component_mul(&state.half);
            let inverse = 1.0 / p.z.max(0.1);
            let seen = [p.x * inverse, p.y * inverse];
            for side in (0..4).filter(|side| self.trusted[*side]) {
                let axis = side % 2;
                let beyond = seen[axis] - self.edges[side];
                most = most.max(if side < 2 { -beyond } else { beyond } / sizes[axis]);
            }
        }
        most
    }

    /// The vehicle of half-sides `half` turned by `rotation`, placed by its outline. `vertices` are in half-extent
    /// units; `nearer` scales the distance that is supposed where edges do not tell it.
    pub(super) fn place(
        &self,
        vertices: &[Vector3],
        rotation: &UnitQuaternion<f64>,
        half: &Vector3,
        nearer: f64,
    ) -> Option<State> {
        let matrix = rotation.to_rotation_matrix();
        let matrix = matrix.matrix() * Matrix3::from_diagonal(half);
        let arms: Vec<Vector3> = vertices.iter().map(|p| matrix * p).collect();
        let [left, top, right, bottom] = self.edges;
        // A level vehicle is about as high as its body, seen from anywhere.
        let supposed = nearer * (2.0 * half.y / (bottom - top).max(1e-6) + half.x);
        let mut center =
            Vector3::new(0.5 * (left + right), 0.5 * (top + bottom), 1.0) * supposed.max(2.0);
        for _ in 0..ROUNDS[usize::from(!self.is_whole())] {
            let reach = self.extremes(&arms, &center);
            let mut hessian = Matrix3::zeros();
            let mut gradient = Vector3::zeros();
            let mut add = |row: Vector3, value: f64, weight: f64| {
                hessian += row * row.transpose() * weight;
                gradient += row * (value * weight);
            };
            for side in 0..4 {
                let weight = if self.trusted[side] { 1.0 } else { SUPPOSED };
                let (ray, arm) = (self.edges[side], reach[side]);
                let mut row = Vector3::new(0.0, 0.0, -ray);
                row[side % 2] = 1.0;
                add(row, ray * arm.z - arm[side % 2], weight);
            }
            if !self.tells_distance() {
                add(Vector3::z() / supposed, 1.0, SUPPOSED);
            }
            let solved = hessian.cholesky()?.solve(&gradient);
            center = solved;
            if !(center.z > 1.0) {
                center.z = 1.0f64.max(0.3 * supposed);
            }
        }
        let state = State { rotation: *rotation, center, half: *half };
        state.is_usable().then_some(state)
    }

    /// The offsets that appear farthest left, up, right and down; what lies beyond an edge that is not trusted cannot
    /// be seen, and is no end of the others.
    fn extremes(&self, arms: &[Vector3], center: &Vector3) -> [Vector3; 4] {
        let infinity = f64::INFINITY;
        let mut best = [infinity, infinity, -infinity, -infinity];
        let mut found = [Vector3::zeros(); 4];
        let open: [f64; 4] = std::array::from_fn(|side| match (self.trusted[side], side < 2) {
            (false, _) => self.edges[side],
            (true, true) => -infinity,
            (true, false) => infinity,
        });
        for arm in arms {
            let p = center + arm;
            let inverse = 1.0 / p.z.max(0.1);
            let (x, y) = (p.x * inverse, p.y * inverse);
            let in_columns = x >= open[0] && x <= open[2];
            let in_rows = y >= open[1] && y <= open[3];
            for (side, value, counts) in
                [(0, -x, in_rows), (1, -y, in_columns), (2, x, in_rows), (3, y, in_columns)]
            {
                let better = if side < 2 { -value < best[side] } else { value > best[side] };
                if counts && better {
                    best[side] = if side < 2 { -value } else { value };
                    found[side] = *arm;
                }
            }
        }
        found
    }
}

/// Cells of the kernel that a part must fill to have a centre.
const LEAST_PART: f32 = 1.5;
/// Share of a part that may lie next to the unseen.
const MOST_CUT: f32 = 0.2;

/// The poses that centres of parts tell of: the best of [`pnp::solve`] and its other mode.
///
/// Centres lie: of a part that is seen in part, or at a slant. Far from the image's middle and near the camera they
/// are still a better start than the outline.
pub(super) fn from_centers(
    target: &Target,
    camera: &Camera,
    centers: &PartMap<Point3>,
    half: &Vector3,
) -> Vec<State> {
    let m = target.cells;
    let mut sums = [[0.0f32; 4]; CHANNELS];
    for cell in 0..m * m {
        let weight = target.weights[cell];
        if weight == 0.0 {
            continue;
        }
        let (x, y) = (cell % m, cell / m);
        let unseen = |dx: isize, dy: isize| {
            let (x, y) = (x as isize + dx, y as isize + dy);
            let inside = (0..m as isize).contains(&x) && (0..m as isize).contains(&y);
            inside && target.weights[y as usize * m + x as usize] == 0.0
        };
        let is_cut = [(-1, 0), (1, 0), (0, -1), (0, 1)].iter().any(|(dx, dy)| unseen(*dx, *dy))
            || target.is_at_border(camera, x, y);
        for (sum, q) in sums.iter_mut().zip(&target.probabilities[cell]) {
            let share = weight * q;
            sum[0] += share;
            sum[1] += share * x as f32;
            sum[2] += share * y as f32;
            sum[3] += if is_cut { share } else { 0.0 };
        }
    }
    let cell = [target.bounds.width() / m as f64, target.bounds.height() / m as f64];
    let pairs: Vec<Correspondence> = centers
        .iter()
        .filter_map(|(class, center)| {
            let [mass, x, y, cut] = sums[usize::from(class.id())];
            if !(mass >= LEAST_PART) || cut > MOST_CUT * mass {
                return None;
            }
            let pixel = Point2::new(
                target.bounds.x_min + (f64::from(x / mass) + 0.5) * cell[0],
                target.bounds.y_min + (f64::from(y / mass) + 0.5) * cell[1],
            );
            let point = Point3::from(center.coords.component_mul(half));
            Some(Correspondence { point_in_image: pixel, point_in_object: point })
        })
        .collect();
    let sigma = 0.03 * (target.bounds.width() + target.bounds.height());
    let options = RefineOptions { sigma, max_iterations: 10, ..Default::default() };
    let Ok(solution) = pnp::solve(&pairs, camera, &options) else { return Vec::new() };
    let modes = [Some(solution.best), solution.second].into_iter().flatten();
    modes
        .map(|mode| State {
            rotation: mode.refinement.pose.rotation,
            center: mode.refinement.pose.translation.vector,
            half: *half,
        })
        .filter(State::is_usable)
        .collect()
}

/// The rotation of an upright vehicle with a heading: 0 looks the camera's way.
pub(super) fn upright(down: &Vector3, heading: f64) -> UnitQuaternion<f64> {
    let [a, _] = across(down);
    // A forward axis that is as near to the camera's as uprightness lets it be.
    let ahead = (Vector3::z() - down * down.z).try_normalize(1e-6).unwrap_or(a);
    let right = down.cross(&ahead);
    let forward = ahead * heading.cos() + right * heading.sin();
    let side = down.cross(&forward);
    let matrix = Matrix3::from_columns(&[side, *down, forward]);
    UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(matrix))
}
