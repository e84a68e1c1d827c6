//! Overlaps of all detections of a frame with all its labels, computed once for every pass that needs them.

use super::{KittiFrame, KittiMetric, KittiObject};

/// Intersection over union by label and detection, and what the areas to ignore cover.
pub(super) struct Overlaps {
    detections: usize,
    union: Vec<f64>,
    /// Share of a detection's own area that lies in a `DontCare` label; rows of other labels are zero.
    covered: Vec<f64>,
}

impl Overlaps {
    pub(super) fn union(&self, label: usize, detection: usize) -> f64 {
        self.union[label * self.detections + detection]
    }

    pub(super) fn covered(&self, label: usize, detection: usize) -> f64 {
        self.covered[label * self.detections + detection]
    }
}

pub(super) fn overlaps(frame: &KittiFrame, metric: KittiMetric) -> Overlaps {
    let detections = frame.detections.len();
    let mut union = Vec::with_capacity(frame.labels.len() * detections);
    let mut covered = Vec::with_capacity(frame.labels.len() * detections);
    for label in &frame.labels {
        let ignored = is_dont_care(label);
        for detection in &frame.detections {
            union.push(if ignored { 0.0 } else { overlap(metric, detection, label) });
            // Areas to ignore have no 3D box.
            let area = detection.bounds.area();
            let share = if ignored && metric == KittiMetric::Image && area > 0.0 {
                let shared = detection.bounds.intersection(&label.bounds);
                shared.map_or(0.0, |shared| shared.area() / area)
            } else {
                0.0
            };
            covered.push(share);
        }
    }
    Overlaps { detections, union, covered }
}

pub(super) fn is_dont_care(label: &KittiObject) -> bool {
    label.category.eq_ignore_ascii_case("DontCare")
}

fn overlap(metric: KittiMetric, a: &KittiObject, b: &KittiObject) -> f64 {
    match metric {
        KittiMetric::Image => a.bounds.iou(&b.bounds),
        KittiMetric::BirdsEye => {
            let shared = shared_ground(a, b);
            ratio(shared, ground(a) + ground(b) - shared)
        }
        KittiMetric::Volume => {
            let [top_a, top_b] = [a, b].map(|object| object.location[1] - object.size[0]);
            let height = a.location[1].min(b.location[1]) - top_a.max(top_b);
            if height <= 0.0 {
                return 0.0;
            }
            let shared = shared_ground(a, b) * height;
            ratio(shared, ground(a) * a.size[0] + ground(b) * b.size[0] - shared)
        }
    }
}

fn ratio(shared: f64, union: f64) -> f64 {
    if union > 0.0 { shared / union } else { 0.0 }
}

/// Area of the footprint, square metres.
fn ground(object: &KittiObject) -> f64 {
    object.size[1] * object.size[2]
}

/// Area that two footprints share: one rectangle clipped by the sides of the other (Sutherland and Hodgman, 1974).
fn shared_ground(a: &KittiObject, b: &KittiObject) -> f64 {
    let distance = (a.location[0] - b.location[0]).hypot(a.location[2] - b.location[2]);
    let reach = |object: &KittiObject| 0.5 * object.size[1].hypot(object.size[2]);
    if distance > reach(a) + reach(b) || ground(a) <= 0.0 || ground(b) <= 0.0 {
        return 0.0;
    }
    // In the frame of b, whose sides are then parallel to the axes.
    let (sin, cos) = b.rotation_y.sin_cos();
    let to_b = |[x, z]: [f64; 2]| {
        let [x, z] = [x - b.location[0], z - b.location[2]];
        [cos * x - sin * z, sin * x + cos * z]
    };
    let mut polygon: Vec<[f64; 2]> = corners(a).map(to_b).to_vec();
    for (axis, half) in [(0, 0.5 * b.size[2]), (1, 0.5 * b.size[1])] {
        for sign in [1.0, -1.0] {
            polygon = clip(&polygon, |point| sign * point[axis] - half);
        }
    }
    area(&polygon)
}

/// Corners of the footprint as x and z in the camera frame.
fn corners(object: &KittiObject) -> [[f64; 2]; 4] {
    let (sin, cos) = object.rotation_y.sin_cos();
    let [half_width, half_length] = [0.5 * object.size[1], 0.5 * object.size[2]];
    [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)].map(|(along, across)| {
        let [l, w] = [along * half_length, across * half_width];
        [cos * l + sin * w + object.location[0], cos * w - sin * l + object.location[2]]
    })
}

/// The part of a convex polygon where `height` is not positive.
fn clip(polygon: &[[f64; 2]], height: impl Fn(&[f64; 2]) -> f64) -> Vec<[f64; 2]> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, point) in polygon.iter().enumerate() {
        let next = &polygon[(i + 1) % polygon.len()];
        let (here, there) = (height(point), height(next));
        if here <= 0.0 {
            kept.push(*point);
        }
        if (here <= 0.0) != (there <= 0.0) {
            let share = here / (here - there);
            kept.push([0, 1].map(|axis| point[axis] + share * (next[axis] - point[axis])));
        }
    }
    kept
}

fn area(polygon: &[[f64; 2]]) -> f64 {
    let Some(first) = polygon.first() else { return 0.0 };
    let twice: f64 = polygon
        .windows(2)
        .map(|pair| {
            let [a, b] = [0, 1].map(|i| [pair[i][0] - first[0], pair[i][1] - first[1]]);
            a[0] * b[1] - a[1] * b[0]
        })
        .sum();
    0.5 * twice.abs()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    use nalgebra::UnitQuaternion;
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::{Cuboid, EulerAngles, Extent, Pose, Rect, Vector3};

    fn object(size: [f64; 3], location: [f64; 3], rotation_y: f64) -> KittiObject {
        let bounds = Rect::new(0.0, 0.0, 1.0, 1.0);
        KittiObject {
            category: "Car".to_owned(),
            truncation: 0.0,
            occlusion: 0.0,
            alpha: 0.0,
            bounds,
            size,
            location,
            rotation_y,
            score: 0.0,
        }
    }

    #[test]
    fn a_square_turned_by_an_eighth_shares_an_octagon() {
        let a = object([1.0; 3], [3.0, 1.0, 9.0], 0.0);
        let b = object([1.0; 3], [3.0, 1.0, 9.0], FRAC_PI_4);
        assert!((shared_ground(&a, &b) - 2.0 * (2f64.sqrt() - 1.0)).abs() < 1e-12);
    }

    #[test]
    fn boxes_that_only_touch_share_nothing() {
        let a = object([1.0, 2.0, 4.0], [0.0; 3], 0.0);
        let b = object([1.0, 2.0, 4.0], [4.0, 0.0, 0.0], 0.0);
        assert!(overlap(KittiMetric::BirdsEye, &a, &b).abs() < 1e-12);
        let above = object([1.0, 2.0, 4.0], [0.0, -1.0, 0.0], 0.0);
        assert!(overlap(KittiMetric::Volume, &a, &above).abs() < 1e-12);
        assert!((overlap(KittiMetric::Volume, &a, &a) - 1.0).abs() < 1e-12);
    }

    fn cuboid(object: &KittiObject) -> Cuboid {
        let yaw = object.rotation_y + FRAC_PI_2;
        let rotation = EulerAngles { x: 0.0, y: yaw, z: 0.0 }.to_rotation();
        let [height, width, length] = object.size;
        let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
        let place = Vector3::from(object.location);
        let camera_from_vehicle = Pose::from_parts(place.into(), rotation);
        Cuboid { camera_from_vehicle, extent: Extent::new(width, height, length) }
    }

    fn any_object() -> impl Strategy<Value = KittiObject> {
        let range = |a: f64, b: f64| [a..b, a..b, a..b];
        (range(0.5, 5.0), range(-2.0, 2.0), -4.0..4.0f64).prop_map(|(s, p, ry)| object(s, p, ry))
    }

    proptest! {
        #[test]
        fn overlap_is_that_of_the_cuboids(a in any_object(), b in any_object()) {
            let expected = cuboid(&a).iou(&cuboid(&b));
            prop_assert!((overlap(KittiMetric::Volume, &a, &b) - expected).abs() < 1e-9);
            let flat = |object: &KittiObject| KittiObject {
                size: [1.0, object.size[1], object.size[2]],
                location: [object.location[0], 0.0, object.location[2]],
                ..object.clone()
            };
            let expected = cuboid(&flat(&a)).iou(&cuboid(&flat(&b)));
            prop_assert!((overlap(KittiMetric::BirdsEye, &a, &b) - expected).abs() < 1e-9);
        }
    }
}
