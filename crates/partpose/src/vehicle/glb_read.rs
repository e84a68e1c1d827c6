//! Reads a model from GLB, whoever wrote it.
//!
//! The file is not trusted: every number is checked before it is used, nothing is allocated that the file does not
//! fill, and nothing outside the file is opened. Any program's GLB will do if its buffers lie inside, its primitives
//! are separate triangles, each primitive's material, mesh or node (looked at in this order) is named after a part,
//! and `extras.partpose` is on a root node, the scene or the asset. Node transforms are applied. Vertices at identical
//! positions are merged, so that a vertex on a seam is one vertex again; faces that thereby lose their area are
//! dropped. A closed mesh that is inside out is turned round. Skins, morph targets and animations are ignored.

use std::collections::HashMap;

use crate::geometry::Point3;
use crate::parts::PartClass;

use super::{
    GlbError, Mesh, PartialModel, PrimitiveFault, UNLABELED, VehicleModel,
    glb::{self, MAX_COORDINATE, MAX_FACES, MAX_SIDE, MAX_TEXT, MIN_SIDE},
    glb_schema::{Extras, Primitive, Root, TRIANGLES},
    gltf_scene::{Matrix4, Triangles, get, placed_nodes, read_primitive, root_nodes},
};

/// The model in the bytes of a GLB file.
///
/// One that has faces named `unlabeled` is refused: [`from_partial_glb`] reads it.
pub fn from_glb(bytes: &[u8]) -> Result<VehicleModel, GlbError> {
    from_partial_glb(bytes)?.to_model().map_err(GlbError::Model)
}

/// The model in the bytes of a GLB file, of which faces may have no part.
pub fn from_partial_glb(bytes: &[u8]) -> Result<PartialModel, GlbError> {
    let (json, bytes) = glb::split(bytes)?;
    let root: Root = serde_json::from_slice(json).map_err(GlbError::Json)?;
    if let Some(extension) = root.extensions_required.first() {
        return Err(GlbError::Extension(extension.clone()));
    }
    if let Some(buffer) = root.buffers.iter().position(|buffer| buffer.uri.is_some()) {
        return Err(GlbError::Uri { buffer });
    }
    let buffer = root.buffers.first().and_then(|buffer| bytes.get(..buffer.byte_length));
    let roots = root_nodes(&root)?;
    let extras = extras(&root, &roots)?;
    let mut builder = Builder::default();
    for (node, gltf_from_node) in placed_nodes(&root, &roots)? {
        let Some(index) = root.nodes[node].mesh else { continue };
        let mesh = get("mesh", &root.meshes, index)?;
        for (at, primitive) in mesh.primitives.iter().enumerate() {
            let names = Names::of(&root, node, index, primitive);
            let named = || names.describe(index, at);
            let part = names.part().ok_or_else(|| GlbError::UnknownPart { primitive: named() })?;
            let read = match primitive.mode.unwrap_or(TRIANGLES) {
                TRIANGLES => read_primitive(&root, buffer.as_slice(), primitive),
                mode => Err(PrimitiveFault::Mode(mode)),
            };
            let read = read.map_err(|fault| GlbError::Primitive { primitive: named(), fault })?;
            builder.add(&read, &gltf_from_node, part).map_err(|fault| match fault {
                Some(fault) => GlbError::Primitive { primitive: named(), fault },
                None => GlbError::TooManyFaces,
            })?;
        }
    }
    let mesh =
        outward(Mesh { vertices: builder.vertices, faces: builder.faces, parts: Vec::new() });
    let Extras { name, category, body_style, extent } = extras;
    let (vertices, faces, parts) = (mesh.vertices, mesh.faces, builder.parts);
    let model = PartialModel { name, category, body_style, extent, vertices, faces, parts };
    model.check().map_err(GlbError::Model)?;
    Ok(model)
}

/// Turns a closed mesh round that is inside out; of an open one nobody knows which side is out.
pub(super) fn outward(mut mesh: Mesh) -> Mesh {
    if mesh.volume() < 0.0 && mesh.is_closed() {
        mesh.faces.iter_mut().for_each(|face| face.swap(1, 2));
    }
    mesh
}

/// The names that may tell the part of a primitive.
pub(super) struct Names<'a> {
    pub(super) material: Option<&'a str>,
    pub(super) mesh: Option<&'a str>,
    pub(super) node: Option<&'a str>,
}

impl<'a> Names<'a> {
    pub(super) fn of(root: &'a Root, node: usize, mesh: usize, primitive: &Primitive) -> Self {
        let material = primitive.material.and_then(|index| root.materials.get(index));
        Self {
            material: material.and_then(|material| material.name.as_deref()),
            mesh: root.meshes.get(mesh).and_then(|mesh| mesh.name.as_deref()),
            node: root.nodes[node].name.as_deref(),
        }
    }

    /// The part, `Some(None)` for those named after none on purpose, or `None` where no name tells.
    fn part(&self) -> Option<Option<PartClass>> {
        let names = [self.material, self.mesh, self.node].into_iter().flatten();
        names.map(without_counter).find_map(|name| match name {
            UNLABELED => Some(None),
            name => PartClass::from_name(name).map(Some),
        })
    }

    pub(super) fn describe(&self, mesh: usize, primitive: usize) -> String {
        let name = |name: Option<&str>| {
            let shown: String = name.unwrap_or("").chars().take(MAX_TEXT).collect();
            shown.escape_debug().to_string()
        };
        let [material, mesh_name, node] = [self.material, self.mesh, self.node].map(name);
        format!(
            "primitive {primitive} of mesh {mesh} (material `{material}`, mesh `{mesh_name}`, node `{node}`)"
        )
    }
}

/// `wheels_FL.001` is how Blender calls a second `wheels_FL`.
fn without_counter(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((stem, digits)) if digits.bytes().all(|byte| byte.is_ascii_digit()) => stem,
        _ => name,
    }
}

#[derive(Default)]
struct Builder {
    vertices: Vec<Point3>,
    faces: Vec<[u32; 3]>,
    parts: Vec<Option<PartClass>>,
    /// Triangles added, degenerate ones included, so that a small file cannot make endless work.
    added: usize,
    /// By the bits of the coordinates.
    vertex_at: HashMap<[u64; 3], u32>,
}

impl Builder {
    /// Appends triangles; the error is a fault of the primitive, or `None` for too many faces.
    fn add(
        &mut self,
        triangles: &Triangles,
        gltf_from_node: &Matrix4,
        part: Option<PartClass>,
    ) -> Result<(), Option<PrimitiveFault>> {
        self.added += triangles.indices.len() / 3;
        if self.added > MAX_FACES {
            return Err(None);
        }
        let mirrors = gltf_from_node.determinant() < 0.0;
        for corners in triangles.indices.chunks_exact(3) {
            let mut face = [0; 3];
            for (corner, index) in face.iter_mut().zip(corners) {
                let position = triangles.positions.position(*index as usize);
                *corner = self.vertex(*index as usize, &position, gltf_from_node)?;
            }
            if mirrors {
                face.swap(1, 2);
            }
            if face[0] != face[1] && face[1] != face[2] && face[2] != face[0] {
                self.faces.push(face);
                self.parts.push(part);
            }
        }
        Ok(())
    }

    fn vertex(
        &mut self,
        vertex: usize,
        point_in_node: &Point3,
        gltf_from_node: &Matrix4,
    ) -> Result<u32, PrimitiveFault> {
        let p = gltf_from_node.transform_point(point_in_node);
        // Adding zero turns -0 into 0, which has other bits.
        let position = Point3::new(-p.x + 0.0, -p.y + 0.0, p.z + 0.0);
        if !position.iter().all(|value| value.abs() <= MAX_COORDINATE) {
            return Err(PrimitiveFault::Position { vertex, position });
        }
        let key = [position.x, position.y, position.z].map(f64::to_bits);
        Ok(*self.vertex_at.entry(key).or_insert_with(|| {
            self.vertices.push(position);
            self.vertices.len() as u32 - 1
        }))
    }
}

fn extras(root: &Root, roots: &[usize]) -> Result<Extras, GlbError> {
    let of_nodes = roots.iter().filter_map(|node| root.nodes.get(*node)?.extras.as_ref());
    let of_scene = root.scenes.get(root.scene.unwrap_or(0)).and_then(|scene| scene.extras.as_ref());
    let mut candidates = of_nodes.chain(of_scene).chain(root.asset.extras.as_ref());
    let value = candidates.find_map(|extras| extras.get("partpose"));
    let value = value.ok_or(GlbError::NoExtras)?;
    let extras: Extras = serde_json::from_value(value.clone()).map_err(GlbError::Extras)?;
    let texts = [
        ("name", &extras.name),
        ("category", &extras.category),
        ("body style", &extras.body_style),
    ];
    for (field, text) in texts {
        if !glb::is_text(text) {
            return Err(GlbError::Text { field });
        }
    }
    if !extras.extent.to_vector().iter().all(|side| (MIN_SIDE..=MAX_SIDE).contains(side)) {
        return Err(GlbError::Extent(extras.extent));
    }
    Ok(extras)
}
