//! Writes a model as GLB.
//!
//! A root node carries the model's name and, in `extras.partpose`, what glTF has no place for; below it hangs a node
//! for each part with a mesh of one primitive; node, mesh and material bear the part's name. Axes are turned from the
//! vehicle's (x right, y down, z forward) to glTF's (y up, z forward, hence x left): a half turn about z.
//!
//! Coordinates are stored as 32-bit floats, about 0.1 um at the size of a vehicle. Normals are left out on purpose:
//! a viewer must then shade flat (specification, § 3.7.2.1), and vertices stay shared. The bytes depend on the model
//! alone.

use std::collections::BTreeMap;

use crate::parts::PartClass;

use super::{
    PartialModel, UNLABELED, VehicleModel, glb,
    glb_schema::{
        Accessor, Asset, Buffer, BufferView, Extras, F32, Material, Mesh, Node, Pbr, Primitive,
        Root, Scene, U32,
    },
};

/// Grey, which no part has: the author's black for "unlabeled" would hide the shape in a viewer.
const UNLABELED_COLOR: [u8; 3] = [150, 150, 150];
/// Buffer target of vertices.
const ARRAY_BUFFER: u32 = 34962;
/// Buffer target of indices.
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// The bytes of a GLB file.
///
/// Vertices without a face are left out.
pub fn to_glb(model: &VehicleModel) -> Vec<u8> {
    to_partial_glb(&PartialModel::from(model))
}

/// The bytes of a GLB file in which the faces without a part have a primitive of their own, named [`UNLABELED`].
///
/// Vertices without a face are left out. Faces must have existing vertices, as [`PartialModel::check`] tells.
pub fn to_partial_glb(model: &PartialModel) -> Vec<u8> {
    let extras = Extras {
        name: model.name.clone(),
        category: model.category.clone(),
        body_style: model.body_style.clone(),
        extent: model.extent,
    };
    let root_node = Node {
        name: Some(model.name.clone()),
        extras: Some(serde_json::json!({ "partpose": extras })),
        ..Node::default()
    };
    let mut root = Root {
        asset: Asset {
            version: "2.0".to_owned(),
            generator: Some("partpose".to_owned()),
            extras: None,
        },
        scene: Some(0),
        scenes: vec![Scene { nodes: vec![0], extras: None }],
        nodes: vec![root_node],
        ..Root::default()
    };
    let mut bytes = Vec::new();
    for part in PartClass::ALL.map(Some).into_iter().chain([None]) {
        push_part(&mut root, &mut bytes, model, part);
    }
    root.buffers.push(Buffer { uri: None, byte_length: bytes.len() });
    let json = serde_json::to_vec(&root).expect("names, numbers and lists can be written as JSON");
    glb::join(json, bytes)
}

fn push_part(root: &mut Root, bytes: &mut Vec<u8>, model: &PartialModel, part: Option<PartClass>) {
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    let mut local_from_global = BTreeMap::new();
    let faces = model.faces.iter().zip(&model.parts).filter(|(_, of)| **of == part);
    for global in faces.flat_map(|(face, _)| *face) {
        let local = *local_from_global.entry(global).or_insert_with(|| {
            let p = &model.vertices[global as usize];
            positions.push([-p.x, -p.y, p.z].map(|value| value as f32));
            positions.len() as u32 - 1
        });
        indices.push(local);
    }
    if indices.is_empty() {
        return;
    }
    let bound = |pick: fn(f32, f32) -> f32| {
        positions.iter().copied().reduce(|a, b| [0, 1, 2].map(|axis| pick(a[axis], b[axis])))
    };
    let position = Accessor {
        buffer_view: Some(root.buffer_views.len()),
        component_type: F32,
        count: positions.len(),
        shape: "VEC3".to_owned(),
        min: bound(f32::min),
        max: bound(f32::max),
        ..Accessor::default()
    };
    let index = Accessor {
        buffer_view: Some(root.buffer_views.len() + 1),
        component_type: U32,
        count: indices.len(),
        shape: "SCALAR".to_owned(),
        ..Accessor::default()
    };
    let positions = positions.iter().flatten().flat_map(|value| value.to_le_bytes());
    push_view(root, bytes, positions.collect(), ARRAY_BUFFER);
    let indices = indices.iter().flat_map(|value| value.to_le_bytes());
    push_view(root, bytes, indices.collect(), ELEMENT_ARRAY_BUFFER);
    let accessors = root.accessors.len();
    root.accessors.extend([position, index]);

    let name = || Some(part.map_or(UNLABELED, PartClass::name).to_owned());
    let node = root.nodes.len();
    root.nodes[0].children.push(node);
    root.nodes.push(Node { name: name(), mesh: Some(root.meshes.len()), ..Node::default() });
    let primitive = Primitive {
        attributes: BTreeMap::from([("POSITION".to_owned(), accessors)]),
        indices: Some(accessors + 1),
        material: Some(root.materials.len()),
        mode: None,
    };
    root.meshes.push(Mesh { name: name(), primitives: vec![primitive] });
    let [r, g, b] = part.map_or(UNLABELED_COLOR, PartClass::color).map(linear_from_srgb);
    let pbr =
        Pbr { base_color_factor: [r, g, b, 1.0], metallic_factor: 0.0, roughness_factor: 0.8 };
    root.materials.push(Material { name: name(), pbr_metallic_roughness: pbr });
}

fn push_view(root: &mut Root, bytes: &mut Vec<u8>, content: Vec<u8>, target: u32) {
    root.buffer_views.push(BufferView {
        buffer: 0,
        byte_offset: bytes.len(),
        byte_length: content.len(),
        byte_stride: None,
        target: Some(target),
    });
    // Positions and indices alike consist of four-byte words, so that everything stays aligned.
    bytes.extend(content);
}

/// IEC 61966-2-1; glTF's colour factors are linear. Six digits, so that no library's rounding shows in the file.
pub(crate) fn linear_from_srgb(value: u8) -> f64 {
    let value = f64::from(value) / 255.0;
    let linear = if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) };
    (linear * 1e6).round() / 1e6
}
