//! A self-contained page that shows posed vehicles in 3D.
//!
//! The page needs no network and no library: its viewer is `page/viewer.js`, in WebGL 1. It shows the image, the camera's
//! frustum, the part-coloured models at their poses, true boxes, and the figures of a vehicle that is clicked.

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};

use crate::formats::PosedVehicle;
use crate::parts::PartClass;
use crate::vehicle::{ModelZoo, VehicleModel};

use super::embed::{base64, html_escape, json_for_html, picture_uri};
use super::scene3d::SceneFrame;

const PAGE: &str = include_str!("page/view.html");
const STYLE: &str = include_str!("page/viewer.css");
const SCRIPT: &str = include_str!("page/viewer.js");

/// The page; vehicles whose model the zoo does not have are shown as boxes.
pub fn scene_page(title: &str, frames: &[SceneFrame], zoo: &ModelZoo) -> String {
    let used: BTreeSet<&str> = frames
        .iter()
        .flat_map(|frame| &frame.found.vehicles)
        .map(|vehicle| vehicle.model.as_str())
        .collect();
    let models: Map<String, Value> = used
        .into_iter()
        .filter_map(|name| Some((name.to_owned(), model(zoo.get(name)?))))
        .collect();
    let parts = PartClass::ALL
        .map(|part| json!({ "id": part.id(), "name": part.name(), "color": part.color() }));
    let data = json!({
        "parts": parts,
        "models": models,
        "frames": frames.iter().map(frame).collect::<Vec<_>>(),
    });
    let filled = PAGE.replace("@TITLE@", &html_escape(title)).replace("@STYLE@", STYLE);
    // Data last: nothing in it is looked for again.
    filled.replace("@SCRIPT@", SCRIPT).replacen("@DATA@", &json_for_html(&data), 1)
}

fn frame(frame: &SceneFrame) -> Value {
    let camera = &frame.found.camera;
    let found = |vehicle: &PosedVehicle| {
        let mut value = placed(vehicle);
        value["facts"] = json!(frame.facts(vehicle));
        value
    };
    json!({
        "name": frame.found.image,
        "camera": {
            "fx": camera.focal[0], "fy": camera.focal[1],
            "cx": camera.principal_point[0], "cy": camera.principal_point[1],
            "w": camera.size[0], "h": camera.size[1],
        },
        "image": frame.photo.as_deref().and_then(picture_uri),
        "vehicles": frame.found.vehicles.iter().map(found).collect::<Vec<_>>(),
        "truths": frame.truths.iter().map(placed).collect::<Vec<_>>(),
    })
}

fn placed(vehicle: &PosedVehicle) -> Value {
    let pose = &vehicle.cuboid.camera_from_vehicle;
    let rotation = pose.rotation.to_rotation_matrix();
    // Six digits are a micrometre: the page need not carry more.
    let short = |value: f64| (value * 1e6).round() / 1e6;
    let rows: [f64; 9] = std::array::from_fn(|i| short(rotation[(i / 3, i % 3)]));
    let place: [f64; 3] = std::array::from_fn(|i| short(pose.translation.vector[i]));
    let extent = &vehicle.cuboid.extent;
    json!({
        "model": vehicle.model,
        "rotation": rows,
        "translation": place,
        "extent": [extent.width, extent.height, extent.length],
    })
}

/// Positions as 32-bit floats, corners as 32-bit indices, parts as bytes, all little-endian.
fn model(model: &VehicleModel) -> Value {
    let (mesh, extent) = (model.mesh(), model.extent());
    let positions = mesh.vertices.iter().flat_map(|p| [p.x, p.y, p.z]);
    let positions: Vec<u8> = positions.flat_map(|value| (value as f32).to_le_bytes()).collect();
    let faces: Vec<u8> = mesh.faces.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let parts: Vec<u8> = mesh.parts.iter().map(|part| part.id()).collect();
    json!({
        "extent": [extent.width, extent.height, extent.length],
        "positions": base64(&positions),
        "faces": base64(&faces),
        "parts": base64(&parts),
    })
}
