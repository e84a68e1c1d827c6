//! Lines on the ground that streets and vehicles follow.

use nalgebra::{Translation3, UnitQuaternion};
use partpose::geometry::{Point3, Pose, Vector3};

/// Distance of the points that are kept, metres.
const STEP: f64 = 1.0;

/// A curve by its length, with a direction and a slope everywhere; straight on beyond its ends.
///
/// Kept as points a metre apart: 32 bytes for every metre that a sequence is long.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    /// Length along the path of the first point.
    start: f64,
    /// Position and heading (0 along z, a quarter turn along x) of every point.
    points: Vec<(Point3, f64)>,
}

impl Path {
    /// A path from `start` to `end`; `heading` and `height` (metres above the ground of the origin) are given along
    /// it. It passes through the origin at length 0, where `start <= 0`.
    pub(crate) fn new(
        range: [f64; 2],
        heading: impl Fn(f64) -> f64,
        height: impl Fn(f64) -> f64,
    ) -> Self {
        let [start, end] = range;
        let count = ((end - start) / STEP).ceil().max(1.0) as usize;
        let mut points = Vec::with_capacity(count + 1);
        let mut at = Point3::origin();
        for i in 0..=count {
            let s = start + i as f64 * STEP;
            let angle = heading(s);
            points.push((Point3::new(at.x, -height(s), at.z), angle));
            // The direction half a step ahead: the mid-point rule.
            let (sin, cos) = heading(s + 0.5 * STEP).sin_cos();
            at += Vector3::new(sin, 0.0, cos) * STEP;
        }
        let mut path = Self { start, points };
        let origin = path.pose(0.0).translation.vector;
        for (point, _) in &mut path.points {
            point.x -= origin.x;
            point.z -= origin.z;
        }
        path
    }

    /// A path along points, which are joined by straight lines.
    pub(crate) fn through(line: &[Point3], start: f64) -> Self {
        let mut points: Vec<(Point3, f64)> = Vec::new();
        let mut left = 0.0;
        for pair in line.windows(2) {
            let step = pair[1] - pair[0];
            let length = step.norm();
            if length < 1e-9 {
                continue;
            }
            let angle = step.x.atan2(step.z);
            while left < length {
                points.push((pair[0] + step * (left / length), angle));
                left += STEP;
            }
            left -= length;
        }
        if points.is_empty() {
            points.push((line.first().copied().unwrap_or_else(Point3::origin), 0.0));
        }
        Self { start, points }
    }

    /// How far the points reach.
    pub(crate) fn range(&self) -> [f64; 2] {
        [self.start, self.start + (self.points.len() - 1) as f64 * STEP]
    }

    /// The frame at a length: x right, y down, z along the path, sloped as the path is.
    pub(crate) fn pose(&self, s: f64) -> Pose {
        let last = self.points.len() - 1;
        let at = (s - self.start) / STEP;
        let i = (at.floor().max(0.0) as usize).min(last.saturating_sub(1));
        let t = at - i as f64;
        let ((a, angle_a), (b, angle_b)) = (self.points[i], self.points[(i + 1).min(last)]);
        let turn = partpose::geometry::wrap_angle(angle_b - angle_a);
        let within = t.clamp(0.0, 1.0);
        let angle = angle_a + turn * within;
        let mut position = a + (b - a) * within;
        let slope = self.slope(s);
        if !(0.0..=1.0).contains(&t) || last == 0 {
            // Beyond the ends: straight on.
            let beyond = if last == 0 { at } else { t - within } * STEP;
            position += Vector3::new(angle.sin(), 0.0, angle.cos()) * beyond;
        }
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle)
            * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), slope.atan());
        Pose::from_parts(Translation3::from(position.coords), rotation)
    }

    /// The frame beside the path, `right` metres from it at the same height.
    pub(crate) fn beside(&self, s: f64, right: f64) -> Pose {
        self.pose(s) * Translation3::new(right, 0.0, 0.0)
    }

    /// Metres that the path rises a metre.
    fn slope(&self, s: f64) -> f64 {
        let height = |s: f64| {
            let last = self.points.len() - 1;
            let at = ((s - self.start) / STEP).clamp(0.0, last as f64);
            let i = (at.floor() as usize).min(last.saturating_sub(1));
            let (a, b) = (self.points[i].0.y, self.points[(i + 1).min(last)].0.y);
            -(a + (b - a) * (at - i as f64))
        };
        // Over a wheelbase, so that the slope has no steps.
        0.5 * (height(s + 1.0) - height(s - 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_passes_through_the_origin_and_keeps_its_length() {
        let path =
            Path::new([-50.0, 200.0], |s| 0.4 * (s / 40.0).sin(), |s| 2.0 * (s / 60.0).sin());
        assert!(path.pose(0.0).translation.vector.norm() < 1e-9);
        let mut length = 0.0;
        for i in 0..100 {
            let [a, b] = [i, i + 1].map(|i| path.pose(f64::from(i)).translation.vector);
            length += (b - a).xz().norm();
        }
        assert!((length - 100.0).abs() < 0.2, "{length}");
    }

    #[test]
    fn the_frame_looks_along_the_path() {
        let path = Path::new([-10.0, 100.0], |_| 0.3, |s| 0.05 * s);
        let pose = path.pose(20.5);
        let ahead = pose.rotation * Vector3::z();
        let step = (path.pose(21.0).translation.vector - pose.translation.vector).normalize();
        assert!((ahead - step).norm() < 1e-3, "{ahead} {step}");
        assert!(ahead.y < 0.0, "up is negative");
    }

    #[test]
    fn points_are_joined_and_go_on_beyond_the_end() {
        let line = [[0.0, 0.0, 0.0], [0.0, 0.0, 10.0], [10.0, 0.0, 10.0]].map(Point3::from);
        let path = Path::through(&line, 0.0);
        let end = path.pose(25.0).translation.vector;
        assert!((end - Vector3::new(15.0, 0.0, 10.0)).norm() < 0.1, "{end}");
    }
}
