//! Posed vehicles of one image as a GLB scene, for Blender and every other viewer of glTF 2.0.
//!
//! Khronos Group: *glTF 2.0 Specification*, 2021. The scene is in metres with y up, -z the camera's view: glTF's camera
//! looks along -z, so the scene is the camera frame turned by half a turn about x. It holds a node a vehicle with a mesh
//! a part, the camera with its field of view, its frustum as lines with the picture as texture on its far end, and
//! true boxes as green lines. The bytes depend on the scene alone.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::formats::PosedVehicle;
use crate::geometry::{Camera, Point2, Point3};
use crate::parts::PartClass;
use crate::vehicle::{ModelZoo, VehicleModel, join_glb, linear_from_srgb};

use super::scene3d::SceneFrame;

/// How far before the camera its picture hangs, metres.
const PICTURE_DEPTH: f64 = 3.0;
const TRIANGLES: u32 = 4;
const LINES: u32 = 1;
const WHITE: [f64; 3] = [1.0, 1.0, 1.0];
const GREEN: [f64; 3] = [0.05, 0.85, 0.15];
const BLUE: [f64; 3] = [0.2, 0.5, 1.0];

/// The scene; vehicles whose model the zoo does not have are boxes.
pub fn scene_glb(frame: &SceneFrame, zoo: &ModelZoo) -> Vec<u8> {
    let mut glb = Builder::default();
    let mut meshes: BTreeMap<&str, usize> = BTreeMap::new();
    let camera = &frame.found.camera;
    glb.add_camera(camera);
    glb.add_frustum(camera, frame.photo.as_deref());
    for (index, vehicle) in frame.found.vehicles.iter().enumerate() {
        let name = format!("{} {}", index + 1, vehicle.model);
        let mut node = json!({ "name": name, "extras": { "facts": frame.facts(vehicle) } });
        if let Some(model) = zoo.get(&vehicle.model) {
            let mesh = *meshes.entry(model.name()).or_insert_with(|| glb.add_model(model));
            node["mesh"] = json!(mesh);
            node["matrix"] = json!(matrix(vehicle, model));
        } else {
            node["mesh"] = json!(glb.add_lines("box", &box_lines(vehicle), WHITE));
        }
        glb.add_node(node);
    }
    for (index, truth) in frame.truths.iter().enumerate() {
        let mesh = glb.add_lines("truth", &box_lines(truth), GREEN);
        glb.add_node(json!({ "name": format!("truth {}", index + 1), "mesh": mesh }));
    }
    glb.finish()
}

/// A point of the camera frame in the scene.
fn scene_from_camera(point: &Point3) -> [f32; 3] {
    [point.x as f32, -point.y as f32, -point.z as f32]
}

/// Takes the mesh of a model, in the vehicle frame, to the scene; column by column.
fn matrix(vehicle: &PosedVehicle, model: &VehicleModel) -> [f64; 16] {
    let pose = &vehicle.cuboid.camera_from_vehicle;
    let rotation = pose.rotation.to_rotation_matrix();
    let scale = vehicle.cuboid.extent.ratio(&model.extent());
    let turn = [1.0, -1.0, -1.0];
    std::array::from_fn(|i| match (i % 4, i / 4) {
        (3, column) => f64::from(u8::from(column == 3)),
        (row, 3) => turn[row] * pose.translation.vector[row],
        (row, column) => turn[row] * rotation[(row, column)] * scale[column],
    })
}

/// Pairs of points: the edges of a vehicle's cuboid.
fn box_lines(vehicle: &PosedVehicle) -> Vec<[f32; 3]> {
    let corners = vehicle.cuboid.corners();
    let edges = (0..8_usize).flat_map(|i| [1, 2, 4].map(|bit| (i, bit)));
    edges
        .filter(|(i, bit)| i & bit == 0)
        .flat_map(|(i, bit)| [i, i | bit].map(|i| scene_from_camera(&corners[i])))
        .collect()
}

#[derive(Default)]
struct Builder {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    materials: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    cameras: Vec<Value>,
    images: Vec<Value>,
}

impl Builder {
    fn add_node(&mut self, node: Value) {
        self.nodes.push(node);
    }

    fn add_view(&mut self, content: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = json!({
            "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": content.len(),
        });
        self.views.push(view);
        self.bytes.extend(content);
        self.views.len() - 1
    }

    fn add_floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let content: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.add_view(&content);
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            let each = |axis: usize| values.iter().map(|v| v[axis]).reduce(pick).unwrap_or(0.0);
            (0..N).map(each).collect()
        };
        self.accessors.push(json!({
            "bufferView": view, "componentType": 5126, "count": values.len(), "type": format!("VEC{N}"),
            "min": bound(f32::min), "max": bound(f32::max),
        }));
        self.accessors.len() - 1
    }

    fn add_material(&mut self, name: &str, [r, g, b]: [f64; 3]) -> usize {
        self.materials.push(json!({
            "name": name, "doubleSided": true,
            "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8 },
        }));
        self.materials.len() - 1
    }

    fn add_lines(&mut self, name: &str, points: &[[f32; 3]], color: [f64; 3]) -> usize {
        let position = self.add_floats(points);
        let material = self.add_material(name, color);
        self.meshes.push(json!({ "name": name, "primitives": [{
            "attributes": { "POSITION": position }, "material": material, "mode": LINES,
        }] }));
        self.meshes.len() - 1
    }

    /// One primitive a part; corners are not shared, so that every viewer shades flat.
    fn add_model(&mut self, model: &VehicleModel) -> usize {
        let mesh = model.mesh();
        let mut primitives = Vec::new();
        for part in PartClass::ALL {
            let faces = mesh.faces.iter().zip(&mesh.parts).filter(|(_, of)| **of == part);
            let points: Vec<[f32; 3]> = faces
                .flat_map(|(face, _)| face.map(|v| mesh.vertices[v as usize]))
                .map(|p| [p.x as f32, p.y as f32, p.z as f32])
                .collect();
            if points.is_empty() {
                continue;
            }
            let position = self.add_floats(&points);
            let color = part.color().map(linear_from_srgb);
            let material = self.add_material(part.name(), color);
            primitives.push(json!({
                "attributes": { "POSITION": position }, "material": material, "mode": TRIANGLES,
            }));
        }
        self.meshes.push(json!({ "name": model.name(), "primitives": primitives }));
        self.meshes.len() - 1
    }

    fn add_camera(&mut self, camera: &Camera) {
        let half = f64::from(camera.size[1]) / 2.0 / camera.focal[1];
        let ratio = f64::from(camera.size[0]) / camera.focal[0] / (2.0 * half);
        self.cameras.push(json!({ "type": "perspective", "perspective": {
            "yfov": 2.0 * half.atan(), "aspectRatio": ratio, "znear": 0.1, "zfar": 500.0,
        } }));
        self.add_node(json!({ "name": "camera", "camera": 0 }));
    }

    fn add_frustum(&mut self, camera: &Camera, photo: Option<&[u8]>) {
        let area = camera.image_rect();
        let corner = |x, y| {
            let point = camera.ray(&Point2::new(x, y)) * PICTURE_DEPTH;
            scene_from_camera(&Point3::from(point))
        };
        let corners = [
            corner(area.x_min, area.y_min),
            corner(area.x_max, area.y_min),
            corner(area.x_max, area.y_max),
            corner(area.x_min, area.y_max),
        ];
        let rays = corners.iter().flat_map(|c| [[0.0; 3], *c]);
        let rim = (0..4).flat_map(|i| [corners[i], corners[(i + 1) % 4]]);
        let lines: Vec<[f32; 3]> = rays.chain(rim).collect();
        let mesh = self.add_lines("frustum", &lines, BLUE);
        self.add_node(json!({ "name": "frustum", "mesh": mesh }));
        let kind = match photo {
            Some([0x89, b'P', b'N', b'G', ..]) => "image/png",
            Some([0xff, 0xd8, ..]) => "image/jpeg",
            _ => return,
        };
        let view = self.add_view(photo.unwrap_or_default());
        self.images.push(json!({ "bufferView": view, "mimeType": kind }));
        let [a, b, c, d] = corners;
        let position = self.add_floats(&[a, d, c, a, c, b]);
        let [p, q, r, s] = [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let place = self.add_floats(&[p, s, r, p, r, q]);
        let material = self.add_material("image", WHITE);
        self.materials[material]["pbrMetallicRoughness"]["baseColorTexture"] =
            json!({ "index": 0 });
        self.meshes.push(json!({ "name": "image", "primitives": [{
            "attributes": { "POSITION": position, "TEXCOORD_0": place }, "material": material, "mode": TRIANGLES,
        }] }));
        self.add_node(json!({ "name": "image", "mesh": self.meshes.len() - 1 }));
    }

    fn finish(self) -> Vec<u8> {
        let mut root = json!({
            "asset": { "version": "2.0", "generator": "partpose" },
            "scene": 0,
            "scenes": [{ "nodes": (0..self.nodes.len()).collect::<Vec<_>>() }],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "cameras": self.cameras,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{ "byteLength": self.bytes.len() }],
        });
        // The format knows no empty lists.
        if !self.images.is_empty() {
            root["images"] = Value::Array(self.images);
            root["textures"] = json!([{ "source": 0 }]);
        }
        join_glb(root.to_string().into_bytes(), self.bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{RgbImage, encode_png};
    use crate::formats::{PosedImage, PosedVehicle};
    use crate::geometry::{Cuboid, Extent, Pose, Rect, Vector3};

    #[test]
    fn the_scene_is_glb_whose_accessors_lie_in_it_and_whose_vehicle_is_where_it_was() {
        let zoo = ModelZoo::embedded();
        let camera = Camera::pinhole(700.0, [600.0, 180.0], [1242, 375]);
        let place = Vector3::new(-2.0, 1.5, 14.0);
        let vehicle = |model: &str| PosedVehicle {
            model: model.to_owned(),
            category: "Car".to_owned(),
            bounds: Rect::new(1.0, 2.0, 30.0, 40.0),
            score: 0.5,
            cuboid: Cuboid {
                camera_from_vehicle: Pose::from_parts(
                    place.into(),
                    nalgebra::UnitQuaternion::identity(),
                ),
                extent: Extent::new(1.8, 1.5, 4.4),
            },
            confidence: None,
            covariance: None,
            reprojection_rmse: None,
            track: None,
        };
        let vehicles = vec![vehicle(zoo.models[0].name()), vehicle("of no zoo")];
        let photo = encode_png(&RgbImage { size: [2, 2], pixels: vec![9; 12] });
        let found = PosedImage { image: "a.png".to_owned(), camera, vehicles };
        let frame = SceneFrame { found, truths: vec![vehicle("x")], photo: Some(photo) };
        let glb = scene_glb(&frame, &zoo);
        let length = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&glb[..4], length(8)), (&b"glTF"[..], glb.len()));
        let root: Value = serde_json::from_slice(&glb[20..20 + length(12)]).unwrap();
        let bytes = length(20 + length(12));
        for view in root["bufferViews"].as_array().unwrap() {
            let [at, size] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap());
            assert!(at % 4 == 0 && at + size <= bytes as u64);
        }
        let nodes = root["nodes"].as_array().unwrap();
        let names: Vec<&str> = nodes.iter().map(|node| node["name"].as_str().unwrap()).collect();
        assert_eq!(names[..3], ["camera", "frustum", "image"]);
        assert_eq!(names[4..], ["2 of no zoo", "truth 1"]);
        let matrix = nodes[3]["matrix"].as_array().unwrap();
        let translation: Vec<f64> = matrix[12..15].iter().map(|v| v.as_f64().unwrap()).collect();
        assert_eq!(translation, [-2.0, -1.5, -14.0]);
    }
}
