//! Results as KITTI label text: one line a vehicle, 16 columns, as KITTI's own evaluation reads them.
//!
//! KITTI knows a yaw only: pitch and roll of a pose are lost here, which the JSON results keep. Lines can be read
//! back with the reader of KITTI data sets.

use std::f64::consts::FRAC_PI_2;

use crate::geometry::{Cuboid, EulerAngles, Rect, Vector3, wrap_angle};

/// A vehicle to write.
#[derive(Clone, Debug, PartialEq)]
pub struct KittiRow {
    /// `Car`, `Van`, `Truck`.
    pub category: String,
    /// Truncated share, 0 to 1; `None`, as for most results, becomes -1.
    pub truncation: Option<f64>,
    /// 0 visible, 1 partly, 2 largely occluded, 3 unknown; `None` becomes -1.
    pub occluded: Option<u8>,
    /// The 2D box, pixels.
    pub bounds: Rect,
    /// Pose and extent.
    pub cuboid: Cuboid,
    /// The more certain the higher.
    pub score: f64,
}

/// The lines of one image's file.
///
/// `offset` is [`crate::dataset::KittiCalibration::offset`] where the images are KITTI's, whose labels live in the
/// frame of another camera, else zero.
pub fn kitti_text(rows: &[KittiRow], offset: &Vector3) -> String {
    rows.iter().map(|row| row_text(row, offset)).collect()
}

/// One line, its end included.
pub(super) fn row_text(row: &KittiRow, offset: &Vector3) -> String {
    let pose = &row.cuboid.camera_from_vehicle;
    let place = pose.translation.vector - offset;
    let angles = EulerAngles::from_rotation(&pose.rotation.to_rotation_matrix());
    // rotation_y = 0 faces right; our vehicles face along z where their yaw is 0.
    let yaw = wrap_angle(angles.y - FRAC_PI_2);
    let alpha = wrap_angle(yaw - place.x.atan2(place.z));
    let category: String =
        row.category.chars().map(|c| if c.is_whitespace() { '_' } else { c }).collect();
    let truncation =
        row.truncation.map_or("-1".to_owned(), |truncation| format!("{truncation:.2}"));
    let occluded = row.occluded.map_or(-1, i16::from);
    let (bounds, extent) = (&row.bounds, &row.cuboid.extent);
    format!(
        "{category} {truncation} {occluded} {alpha:.4} {:.2} {:.2} {:.2} {:.2} \
         {:.4} {:.4} {:.4} {:.4} {:.4} {:.4} {yaw:.4} {:.6}\n",
        bounds.x_min,
        bounds.y_min,
        bounds.x_max,
        bounds.y_max,
        extent.height,
        extent.width,
        extent.length,
        place.x,
        place.y,
        place.z,
        row.score,
    )
}

#[cfg(test)]
mod tests {
    use std::fs;

    use nalgebra::UnitQuaternion;
    use proptest::prelude::*;

    use super::*;
    use crate::dataset::{Dataset, VehicleLabel};
    use crate::geometry::{Extent, Pose};

    const P2: &str = "P2: 700 0 600 35 0 700 180 0.7 0 0 1 0.001\n";

    fn row(place: [f64; 3], yaw: f64, extent: [f64; 3]) -> KittiRow {
        let rotation = EulerAngles { x: 0.0, y: yaw, z: 0.0 }.to_rotation();
        KittiRow {
            category: "Car".to_owned(),
            truncation: None,
            occluded: None,
            bounds: Rect::new(10.25, 20.5, 300.75, 200.0),
            cuboid: Cuboid {
                camera_from_vehicle: Pose::from_parts(
                    Vector3::from(place).into(),
                    UnitQuaternion::from_rotation_matrix(&rotation),
                ),
                extent: Extent::new(extent[0], extent[1], extent[2]),
            },
            score: 0.9,
        }
    }

    /// Writes a row as the label of a frame and reads the frame.
    fn round_trip(row: &KittiRow, calibration: &str, offset: &Vector3) -> VehicleLabel {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in [
            ("label_2", kitti_text(std::slice::from_ref(row), offset).as_str()),
            ("calib", calibration),
        ] {
            let folder = folder.path().join("training").join(name);
            fs::create_dir_all(&folder).unwrap();
            fs::write(folder.join("000000.txt"), text).unwrap();
        }
        let dataset = Dataset::open(folder.path()).unwrap();
        let frames = dataset.frames(&dataset.sequences()[0]).unwrap();
        frames[0].vehicles[0].clone()
    }

    #[test]
    fn line_has_the_columns_of_kitti() {
        let row = row([-2.0, 1.6, 12.0], 0.0, [1.7, 1.5, 4.1]);
        let text = kitti_text(&[row], &Vector3::zeros());
        let expected = "Car -1 -1 -1.4056 10.25 20.50 300.75 200.00 \
                        1.5000 1.7000 4.1000 -2.0000 1.6000 12.0000 -1.5708 0.900000\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn a_category_stays_one_word() {
        let row =
            KittiRow { category: "fire engine".to_owned(), ..row([0.0, 1.0, 9.0], 0.0, [1.0; 3]) };
        assert_eq!(kitti_text(&[row], &Vector3::zeros()).split_whitespace().count(), 16);
    }

    #[test]
    fn offset_between_the_cameras_is_undone() {
        let row = row([-2.0, 1.6, 12.0], 0.7, [1.7, 1.5, 4.1]);
        let calibration = crate::dataset::KittiCalibration::parse("c".as_ref(), P2).unwrap();
        let back = round_trip(&row, P2, &calibration.offset);
        let apart = back.cuboid.camera_from_vehicle.translation.vector
            - row.cuboid.camera_from_vehicle.translation.vector;
        assert!(apart.norm() < 1e-4);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn lines_survive_a_round_trip(
            place in [-9.0..9.0f64, 0.5..2.0, 5.0..60.0],
            yaw in -3.1..3.1f64,
            extent in [1.0..3.0f64, 1.0..3.0, 3.0..6.0],
        ) {
            let row = row(place, yaw, extent);
            let identity = "P2: 700 0 600 0 0 700 180 0 0 0 1 0\n";
            let back = round_trip(&row, identity, &Vector3::zeros());
            // Four decimals are written.
            let change = row.cuboid.camera_from_vehicle.inverse() * back.cuboid.camera_from_vehicle;
            prop_assert!(change.translation.vector.norm() < 1e-4);
            prop_assert!(change.rotation.angle() < 1e-4);
            prop_assert!(back.cuboid.extent.l1_distance(&row.cuboid.extent) < 3e-4);
            prop_assert!((back.bounds.x_min - row.bounds.x_min).abs() < 0.01);
        }
    }
}
