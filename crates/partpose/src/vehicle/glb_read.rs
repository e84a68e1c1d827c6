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
    glb::{self, MAX_COORDINATE, MAX_FACES, MAX_SIDE, MIN_SIDE},
    glb_schema::{self as schema, Extras, Node, Primitive, Root, TRIANGLES},
};

/// Longest name, category or body style, bytes.
const MAX_TEXT: usize = 100;

type Matrix4 = nalgebra::Matrix4<f64>;

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
            let read = read_primitive(&root, bytes, primitive);
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
struct Names<'a> {
    material: Option<&'a str>,
    mesh: Option<&'a str>,
    node: Option<&'a str>,
}

impl<'a> Names<'a> {
    fn of(root: &'a Root, node: usize, mesh: usize, primitive: &Primitive) -> Self {
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

    fn describe(&self, mesh: usize, primitive: usize) -> String {
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

/// A primitive's triangles in its own coordinates.
struct Triangles<'a> {
    positions: Strided<'a>,
    /// Checked to be triples of existing vertices.
    indices: Vec<u32>,
}

/// Elements of equal size at equal distances, all inside the file.
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    count: usize,
}

impl Strided<'_> {
    fn get(&self, index: usize) -> &[u8] {
        &self.bytes[index * self.stride..][..self.size]
    }

    fn position(&self, index: usize) -> Point3 {
        let mut words = self.get(index).chunks_exact(4).map(|word| {
            f64::from(f32::from_le_bytes(word.try_into().expect("chunks are of four bytes")))
        });
        Point3::from([0; 3].map(|_| words.next().unwrap_or(f64::NAN)))
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

fn get<'a, T>(what: &'static str, items: &'a [T], index: usize) -> Result<&'a T, GlbError> {
    items.get(index).ok_or(GlbError::Missing { what, index, count: items.len() })
}

/// The nodes of the default scene; without scenes, those that are nobody's children.
fn root_nodes(root: &Root) -> Result<Vec<usize>, GlbError> {
    if root.scenes.is_empty() {
        let mut is_child = vec![false; root.nodes.len()];
        for child in root.nodes.iter().flat_map(|node| &node.children) {
            if let Some(is_child) = is_child.get_mut(*child) {
                *is_child = true;
            }
        }
        return Ok((0..root.nodes.len()).filter(|node| !is_child[*node]).collect());
    }
    let scene = get("scene", &root.scenes, root.scene.unwrap_or(0))?;
    Ok(scene.nodes.clone())
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
        if text.is_empty() || text.len() > MAX_TEXT || text.chars().any(char::is_control) {
            return Err(GlbError::Text { field });
        }
    }
    if !extras.extent.to_vector().iter().all(|side| (MIN_SIDE..=MAX_SIDE).contains(side)) {
        return Err(GlbError::Extent(extras.extent));
    }
    Ok(extras)
}

/// Every node below the roots with the transform to the scene, parents first.
fn placed_nodes(root: &Root, roots: &[usize]) -> Result<Vec<(usize, Matrix4)>, GlbError> {
    let mut seen = vec![false; root.nodes.len()];
    let mut placed = Vec::new();
    let mut waiting: Vec<(usize, Matrix4)> =
        roots.iter().rev().map(|node| (*node, Matrix4::identity())).collect();
    while let Some((index, gltf_from_parent)) = waiting.pop() {
        let node = get("node", &root.nodes, index)?;
        if std::mem::replace(&mut seen[index], true) {
            return Err(GlbError::NodeTwice(index));
        }
        let gltf_from_node = gltf_from_parent * parent_from_node(node);
        let determinant = gltf_from_node.determinant();
        let is_affine = gltf_from_node.row(3) == Matrix4::identity().row(3);
        if !determinant.is_finite() || determinant == 0.0 || !is_affine {
            return Err(GlbError::Transform(index));
        }
        waiting.extend(node.children.iter().rev().map(|child| (*child, gltf_from_node)));
        placed.push((index, gltf_from_node));
    }
    Ok(placed)
}

fn parent_from_node(node: &Node) -> Matrix4 {
    if let Some(columns) = &node.matrix {
        return Matrix4::from_column_slice(columns);
    }
    let translation = nalgebra::Translation3::from(node.translation.unwrap_or_default());
    // A quaternion is used as it stands if it is about a unit one; a zero quaternion shows as a singular matrix.
    let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let quaternion = nalgebra::Quaternion::new(w, x, y, z);
    let scale = nalgebra::Scale3::from(node.scale.unwrap_or([1.0; 3])).to_homogeneous();
    let rotation = if quaternion.norm_squared() > 0.0 {
        nalgebra::UnitQuaternion::new_normalize(quaternion).to_homogeneous()
    } else {
        Matrix4::zeros()
    };
    translation.to_homogeneous() * rotation * scale
}

fn read_primitive<'a>(
    root: &Root,
    bytes: &'a [u8],
    primitive: &Primitive,
) -> Result<Triangles<'a>, PrimitiveFault> {
    let mode = primitive.mode.unwrap_or(TRIANGLES);
    if mode != TRIANGLES {
        return Err(PrimitiveFault::Mode(mode));
    }
    let position = primitive.attributes.get("POSITION").ok_or(PrimitiveFault::NoPosition)?;
    let positions = accessor(root, bytes, *position, &Kind::Position)?;
    let indices: Vec<u32> = match primitive.indices {
        Some(index) => {
            let elements = accessor(root, bytes, index, &Kind::Index)?;
            if elements.count / 3 > MAX_FACES {
                return Err(PrimitiveFault::NotTriples(elements.count));
            }
            (0..elements.count).map(|at| little_endian(elements.get(at))).collect()
        }
        None => (0..positions.count.min(3 * MAX_FACES + 3) as u32).collect(),
    };
    if !indices.len().is_multiple_of(3) {
        return Err(PrimitiveFault::NotTriples(indices.len()));
    }
    if let Some(index) = indices.iter().find(|index| **index as usize >= positions.count) {
        let (index, count) = (*index as usize, positions.count);
        return Err(PrimitiveFault::Index { index, count });
    }
    Ok(Triangles { positions, indices })
}

/// What an accessor is read for.
#[derive(PartialEq)]
enum Kind {
    Position,
    Index,
}

/// The elements of an accessor, after checking that they are of the right kind and lie inside the file.
fn accessor<'a>(
    root: &Root,
    bytes: &'a [u8],
    index: usize,
    kind: &Kind,
) -> Result<Strided<'a>, PrimitiveFault> {
    let out_of_range = PrimitiveFault::Range { accessor: index };
    let Some(accessor) = root.accessors.get(index) else { return Err(out_of_range) };
    let view = match (accessor.buffer_view, &accessor.sparse) {
        (Some(view), None) => root.buffer_views.get(view),
        _ => return Err(PrimitiveFault::Sparse(index)),
    };
    let size = match (kind, accessor.shape.as_str(), accessor.component_type) {
        (Kind::Position, "VEC3", schema::F32) => 12,
        (Kind::Index, "SCALAR", schema::U8) => 1,
        (Kind::Index, "SCALAR", schema::U16) => 2,
        (Kind::Index, "SCALAR", schema::U32) => 4,
        (_, shape, component_type) => {
            let shape = shape.chars().take(8).collect();
            return Err(PrimitiveFault::Type { accessor: index, shape, component_type });
        }
    };
    let Some(view) = view.filter(|view| view.buffer == 0) else { return Err(out_of_range) };
    let stride = view.byte_stride.unwrap_or(size);
    if stride < size || stride > 252 || (*kind == Kind::Index && stride != size) {
        return Err(PrimitiveFault::Stride { accessor: index, stride });
    }
    let buffer = root.buffers.first().and_then(|buffer| bytes.get(..buffer.byte_length));
    let content = buffer
        .and_then(|buffer| buffer.get(view.byte_offset..)?.get(..view.byte_length))
        .and_then(|view| view.get(accessor.byte_offset..));
    let Some(content) = content else { return Err(out_of_range) };
    let needed = match accessor.count.checked_sub(1) {
        Some(last) => last.checked_mul(stride).and_then(|start| start.checked_add(size)),
        None => Some(0),
    };
    if needed.is_none_or(|needed| needed > content.len()) {
        return Err(out_of_range);
    }
    Ok(Strided { bytes: content, stride, size, count: accessor.count })
}

/// One to four bytes as a number.
fn little_endian(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte))
}
