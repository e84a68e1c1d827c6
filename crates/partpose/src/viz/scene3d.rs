//! Posed vehicles in space, for the 3D page and the GLB scene.

use crate::formats::{PosedImage, PosedVehicle};
use crate::geometry::{Cuboid, EulerAngles};

/// One image with what is known of it.
#[derive(Clone, Debug)]
pub struct SceneFrame {
    /// Camera, and the vehicles that were found.
    pub found: PosedImage,
    /// The vehicles that are there, where that is known.
    pub truths: Vec<PosedVehicle>,
    /// The picture as the bytes of a PNG or JPEG file.
    pub photo: Option<Vec<u8>>,
}

/// Least overlap of boxes in the image for a true vehicle to be the one that was found.
const SAME: f64 = 0.3;

impl SceneFrame {
    /// The true vehicle that one that was found stands for: the one whose cuboid it shares most volume with, else the
    /// one whose box overlaps most.
    pub fn truth_of(&self, vehicle: &PosedVehicle) -> Option<&PosedVehicle> {
        let best = |score: &dyn Fn(&PosedVehicle) -> f64, least: f64| {
            let scored = self.truths.iter().map(|truth| (score(truth), truth));
            let best = scored.max_by(|a, b| a.0.total_cmp(&b.0));
            best.filter(|(score, _)| *score > least).map(|(_, truth)| truth)
        };
        best(&|truth| truth.cuboid.iou(&vehicle.cuboid), 0.0)
            .or_else(|| best(&|truth| truth.bounds.iou(&vehicle.bounds), SAME))
    }

    /// What is to be said of a vehicle, as names and values.
    pub fn facts(&self, vehicle: &PosedVehicle) -> Vec<(&'static str, String)> {
        let pose = &vehicle.cuboid.camera_from_vehicle;
        let place = &pose.translation.vector;
        let angles = EulerAngles::from_rotation(&pose.rotation.to_rotation_matrix());
        let degrees = |angle: f64| format!("{:.1}°", angle.to_degrees());
        let extent = &vehicle.cuboid.extent;
        let mut facts = vec![
            ("model", vehicle.model.clone()),
            ("category", vehicle.category.clone()),
            ("score", format!("{:.3}", vehicle.score)),
            ("place x, y, z", format!("{:.2}, {:.2}, {:.2} m", place.x, place.y, place.z)),
            ("distance", format!("{:.2} m", place.norm())),
            ("yaw", degrees(angles.y)),
            ("pitch, roll", format!("{}, {}", degrees(angles.x), degrees(angles.z))),
            (
                "width, height, length",
                format!("{:.2}, {:.2}, {:.2} m", extent.width, extent.height, extent.length),
            ),
        ];
        if let Some(track) = &vehicle.track {
            facts.push(("track", track.id.to_string()));
        }
        if let Some(rmse) = vehicle.reprojection_rmse {
            facts.push(("reprojection", format!("{rmse:.2} px")));
        }
        if let Some(confidence) = vehicle.confidence {
            facts.push(("confidence", format!("{confidence:.3}")));
        }
        if let Some(truth) = self.truth_of(vehicle) {
            facts.extend(deviation(&vehicle.cuboid, &truth.cuboid));
            if truth.model != vehicle.model {
                facts.push(("true model", truth.model.clone()));
            }
        }
        facts
    }
}

fn deviation(found: &Cuboid, truth: &Cuboid) -> [(&'static str, String); 3] {
    let (a, b) = (&found.camera_from_vehicle, &truth.camera_from_vehicle);
    let apart = (a.translation.vector - b.translation.vector).norm();
    let turned = a.rotation.angle_to(&b.rotation).to_degrees();
    [
        ("3D IoU with the truth", format!("{:.3}", found.iou(truth))),
        ("off by", format!("{apart:.2} m")),
        ("turned by", format!("{turned:.1}°")),
    ]
}
