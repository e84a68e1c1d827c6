//! Part, instance, depth and class of every pixel, exactly as the label renderer of `partpose` gives them.
//!
//! Vehicles with parts are drawn by that renderer from the models' own meshes; where it says that one lies in front of
//! everything else, its labels hold. So labels made later from the poses and models of the written data agree to the
//! bit wherever nothing else stands before a vehicle.

use std::sync::Arc;

use partpose::parts::PartClass;
use partpose::render::{Instance, render_labels};
use partpose::vehicle::Mesh;

use crate::scene::{Object, Scene, SegmentClass};

use super::raster::{NOTHING, Visibility};
use super::visible::{Seen, Triangles};

/// Labels, row by row.
pub(super) struct Labels {
    pub(super) parts: Vec<u8>,
    pub(super) instances: Vec<u16>,
    pub(super) depths: Vec<f32>,
    pub(super) classes: Vec<u8>,
}

pub(super) fn draw(
    scene: &Scene,
    seen: &[Seen],
    triangles: &Triangles,
    visibility: &Visibility,
) -> Labels {
    let mut labelled: Vec<(&Object, Arc<Mesh>)> = seen
        .iter()
        .filter(|seen| seen.object.has_parts)
        .map(|seen| (seen.object, label_mesh(seen.object)))
        .collect();
    labelled.sort_by_key(|(object, _)| object.instance);
    let camera_from_world = scene.world_from_camera.inverse();
    let instances: Vec<Instance> = labelled
        .iter()
        .enumerate()
        .map(|(i, (object, mesh))| Instance {
            mesh,
            scale: object.scale,
            camera_from_vehicle: camera_from_world * object.world_from_object,
            // More than 65,535 vehicles in a picture share numbers.
            id: i as u16 + 1,
        })
        .collect();
    let image = render_labels(&scene.camera, &instances);
    let count = image.parts.len();
    let mut labels = Labels {
        parts: image.parts,
        instances: vec![0; count],
        depths: image.depths,
        classes: vec![SegmentClass::Sky as u8; count],
    };
    for i in 0..count {
        let background = 1.0 / visibility.background_depths[i];
        if labels.parts[i] != 0 && labels.depths[i] <= background {
            let (object, _) = &labelled[usize::from(image.instances[i]) - 1];
            labels.instances[i] = object.instance;
            labels.classes[i] = object.class as u8;
            continue;
        }
        labels.parts[i] = 0;
        labels.depths[i] = background;
        let id = visibility.background[i];
        if id != NOTHING {
            let object = seen[triangles.opaque[id as usize].seen as usize].object;
            labels.classes[i] = object.class as u8;
            labels.instances[i] = object.instance;
        }
    }
    labels
}

/// The mesh by which an object's labels are drawn; made of the surface where it names none.
fn label_mesh(object: &Object) -> Arc<Mesh> {
    if let Some(mesh) = &object.mesh.labels {
        return Arc::clone(mesh);
    }
    let surface = &object.mesh;
    let mut mesh =
        Mesh { vertices: surface.vertices.iter().map(|p| p.cast()).collect(), ..Mesh::default() };
    for (face, part) in surface.faces.iter().zip(&surface.parts) {
        if let Some(part) = PartClass::from_id(*part) {
            mesh.faces.push(*face);
            mesh.parts.push(part);
        }
    }
    Arc::new(mesh)
}
