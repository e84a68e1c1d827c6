//! What a glTF scene shows: nodes, where they are placed, and the triangles of primitives.
//!
//! The file is not trusted: every number is checked before it is used, and nothing is allocated that the file does
//! not fill. Khronos Group: *glTF 2.0 Specification*, 2021, § 3.5 (nodes), § 3.6 (accessors), § 3.7 (primitives).

use crate::geometry::Point3;

use super::{
    GlbError, PrimitiveFault,
    glb::MAX_FACES,
    glb_schema::{self as schema, Node, Primitive, Root, TRIANGLE_FAN, TRIANGLE_STRIP, TRIANGLES},
};

pub(super) type Matrix4 = nalgebra::Matrix4<f64>;

/// The nodes of the default scene; without scenes, those that are nobody's children.
pub(super) fn root_nodes(root: &Root) -> Result<Vec<usize>, GlbError> {
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

pub(super) fn get<'a, T>(
    what: &'static str,
    items: &'a [T],
    index: usize,
) -> Result<&'a T, GlbError> {
    items.get(index).ok_or(GlbError::Missing { what, index, count: items.len() })
}

/// Every node below the roots with the transform to the scene, parents first.
pub(super) fn placed_nodes(
    root: &Root,
    roots: &[usize],
) -> Result<Vec<(usize, Matrix4)>, GlbError> {
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

/// The triangles of a primitive; `buffers` are cut to the lengths that the file announces.
pub(super) fn read_primitive<'a>(
    root: &Root,
    buffers: &[&'a [u8]],
    primitive: &Primitive,
) -> Result<Triangles<'a>, PrimitiveFault> {
    let mode = primitive.mode.unwrap_or(TRIANGLES);
    if ![TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN].contains(&mode) {
        return Err(PrimitiveFault::Mode(mode));
    }
    let position = primitive.attributes.get("POSITION").ok_or(PrimitiveFault::NoPosition)?;
    let positions = accessor(root, buffers, *position, &Kind::Position)?;
    let indices: Vec<u32> = match primitive.indices {
        Some(index) => {
            let elements = accessor(root, buffers, index, &Kind::Index)?;
            if elements.count / 3 > MAX_FACES {
                return Err(PrimitiveFault::NotTriples(elements.count));
            }
            (0..elements.count).map(|at| little_endian(elements.get(at))).collect()
        }
        None => (0..positions.count.min(3 * MAX_FACES + 3) as u32).collect(),
    };
    if mode == TRIANGLES && !indices.len().is_multiple_of(3) {
        return Err(PrimitiveFault::NotTriples(indices.len()));
    }
    if let Some(index) = indices.iter().find(|index| **index as usize >= positions.count) {
        let (index, count) = (*index as usize, positions.count);
        return Err(PrimitiveFault::Index { index, count });
    }
    let indices = match mode {
        TRIANGLE_STRIP => strip(&indices),
        TRIANGLE_FAN => fan(&indices),
        _ => indices,
    };
    Ok(Triangles { positions, indices })
}

/// The triangles of a strip, every second one turned round.
fn strip(indices: &[u32]) -> Vec<u32> {
    let triangles = indices.windows(3).enumerate();
    let turned = |(at, three): (usize, &[u32])| match at % 2 {
        0 => [three[0], three[1], three[2]],
        _ => [three[1], three[0], three[2]],
    };
    triangles.flat_map(turned).collect()
}

/// The triangles of a fan, which all share the first corner.
fn fan(indices: &[u32]) -> Vec<u32> {
    let Some((first, rest)) = indices.split_first() else { return Vec::new() };
    rest.windows(2).flat_map(|two| [*first, two[0], two[1]]).collect()
}

/// What an accessor is read for.
#[derive(PartialEq)]
enum Kind {
    Position,
    Index,
}

/// The elements of an accessor, after checking that they are of the right kind and lie inside their buffer.
fn accessor<'a>(
    root: &Root,
    buffers: &[&'a [u8]],
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
    let Some(view) = view else { return Err(out_of_range) };
    let stride = view.byte_stride.unwrap_or(size);
    if stride < size || stride > 252 || (*kind == Kind::Index && stride != size) {
        return Err(PrimitiveFault::Stride { accessor: index, stride });
    }
    let content = buffers
        .get(view.buffer)
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

/// A primitive's triangles in its own coordinates.
pub(super) struct Triangles<'a> {
    pub(super) positions: Strided<'a>,
    /// Checked to be triples of existing vertices.
    pub(super) indices: Vec<u32>,
}

/// Elements of equal size at equal distances, all inside the file.
pub(super) struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    pub(super) count: usize,
}

impl Strided<'_> {
    fn get(&self, index: usize) -> &[u8] {
        &self.bytes[index * self.stride..][..self.size]
    }

    pub(super) fn position(&self, index: usize) -> Point3 {
        let mut words = self.get(index).chunks_exact(4).map(|word| {
            f64::from(f32::from_le_bytes(word.try_into().expect("chunks are of four bytes")))
        });
        Point3::from([0; 3].map(|_| words.next().unwrap_or(f64::NAN)))
    }
}

/// One to four bytes as a number.
fn little_endian(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte))
}
