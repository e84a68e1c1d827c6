//! Results as the CSV of the BOP benchmark, and models as its PLY files.
//!
//! Hodan et al.: *BOP: Benchmark for 6D Object Pose Estimation*, ECCV 2018. Lengths are millimetres. A BOP pose has no
//! size: the extent of a result is lost here, and with it the scale at which its model was fitted.

use std::collections::BTreeMap;
use std::fmt::Write;

use rayon::prelude::*;
use serde::Serialize;

use super::read_results::PosedImage;
use crate::geometry::Point3;
use crate::vehicle::VehicleModel;

/// What `models_info.json` says of a model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BopModelInfo {
    /// Largest distance of two vertices, millimetres.
    pub diameter: f64,
    /// Least x, millimetres.
    pub min_x: f64,
    /// Least y, millimetres.
    pub min_y: f64,
    /// Least z, millimetres.
    pub min_z: f64,
    /// Extent along x, millimetres.
    pub size_x: f64,
    /// Extent along y, millimetres.
    pub size_y: f64,
    /// Extent along z, millimetres.
    pub size_z: f64,
}

/// Scene and image of a name in the benchmark's layout: `000002/rgb/000007.png` is image 7 of scene 2.
pub fn bop_image_ids(name: &str) -> Option<[u32; 2]> {
    let parts: Vec<&str> = name.split('/').collect();
    let [.., scene, _, image] = parts.as_slice() else { return None };
    let image = image.split('.').next()?;
    Some([scene.parse().ok()?, image.parse().ok()?])
}

/// The lines of a results file: `scene_id,im_id,obj_id,score,R,t,time`, for images with the ids of scene and image.
///
/// Vehicles whose model has no id are left out.
pub fn bop_csv(images: &[([u32; 2], &PosedImage)], ids: &BTreeMap<String, u32>) -> String {
    let mut text = "scene_id,im_id,obj_id,score,R,t,time\n".to_owned();
    for ([scene, image_id], image) in images {
        for vehicle in &image.vehicles {
            let Some(id) = ids.get(&vehicle.model) else { continue };
            let pose = &vehicle.cuboid.camera_from_vehicle;
            let rotation = pose.rotation.to_rotation_matrix().into_inner().transpose();
            let numbers = |values: &mut dyn Iterator<Item = f64>| {
                values.map(|value| value.to_string()).collect::<Vec<_>>().join(" ")
            };
            // Columns of the transposed matrix are rows of the matrix.
            let rotation = numbers(&mut rotation.iter().copied());
            let place = numbers(&mut pose.translation.vector.iter().map(|value| 1000.0 * value));
            // Writing to a string does not fail.
            let _ =
                writeln!(text, "{scene},{image_id},{id},{},{rotation},{place},-1", vehicle.score);
        }
    }
    text
}

/// A model as PLY text, in millimetres, in the vehicle frame.
pub fn bop_ply(model: &VehicleModel) -> String {
    let mesh = model.mesh();
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertices.len(),
        mesh.faces.len()
    );
    for p in &mesh.vertices {
        let _ = writeln!(text, "{:.4} {:.4} {:.4}", 1000.0 * p.x, 1000.0 * p.y, 1000.0 * p.z);
    }
    for [a, b, c] in &mesh.faces {
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    text
}

/// Diameter and bounds of a model.
pub fn bop_model_info(model: &VehicleModel) -> BopModelInfo {
    let points = &model.mesh().vertices;
    let farthest = |(i, a): (usize, &Point3)| {
        points[i..].iter().map(|b| (a - b).norm_squared()).fold(0.0, f64::max)
    };
    let squared = points.par_iter().enumerate().map(farthest).reduce(|| 0.0, f64::max);
    let ends = |axis: usize| {
        let values = points.iter().map(|point| 1000.0 * point[axis]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        })
    };
    let [x, y, z] = [ends(0), ends(1), ends(2)];
    BopModelInfo {
        diameter: 1000.0 * squared.sqrt(),
        min_x: x[0],
        min_y: y[0],
        min_z: z[0],
        size_x: x[1] - x[0],
        size_y: y[1] - y[0],
        size_z: z[1] - z[0],
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::eval::bop::{parse_estimates, parse_ply_vertices};
    use crate::formats::read_results::tests::posed;
    use crate::vehicle::ModelZoo;

    #[test]
    fn lines_are_read_back_as_they_were() {
        let image = posed();
        let ids = BTreeMap::from([("sedan".to_owned(), 4)]);
        let text = bop_csv(&[([1, 7], &image)], &ids);
        let found = parse_estimates(Path::new("a.csv"), &text).unwrap();
        assert_eq!(found.len(), 2);
        for (found, vehicle) in found.iter().zip(&image.vehicles) {
            let pose = &vehicle.cuboid.camera_from_vehicle;
            let rotation = pose.rotation.to_rotation_matrix().into_inner();
            assert_eq!((found.scene, found.image, found.object), (1, 7, 4));
            assert!((found.pose.rotation - rotation).abs().max() < 1e-12);
            assert!((found.pose.translation - 1000.0 * pose.translation.vector).norm() < 1e-9);
        }
        assert_eq!(bop_csv(&[([1, 7], &image)], &BTreeMap::new()).lines().count(), 1);
    }

    #[test]
    fn names_in_the_layout_of_the_benchmark_tell_their_ids() {
        assert_eq!(bop_image_ids("test/000002/rgb/000007.png"), Some([2, 7]));
        assert_eq!(bop_image_ids("000002/rgb/x.png"), None);
        assert_eq!(bop_image_ids("000007.png"), None);
    }

    #[test]
    fn models_keep_their_vertices_in_millimetres() {
        let zoo = ModelZoo::embedded();
        let model = &zoo.models[0];
        let points = parse_ply_vertices(Path::new("a.ply"), bop_ply(model).as_bytes()).unwrap();
        assert_eq!(points.len(), model.mesh().vertices.len());
        let miss = (points[5].coords - 1000.0 * model.mesh().vertices[5].coords).norm();
        assert!(miss < 1e-3);
        let info = bop_model_info(model);
        assert!(info.diameter >= info.size_z && info.diameter < 1.5 * info.size_z);
    }
}
