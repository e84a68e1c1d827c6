//! glTF and GLB: groups by node, mesh and material.
//!
//! Khronos Group: *glTF 2.0 Specification*, 2021. Read are node transforms, triangles, strips and fans, and buffers
//! inside the file, in `data:` URIs and in files within the model's folder. Refused are sparse accessors, quantised
//! positions and compression; skins, morph targets and animations are ignored, textures never opened.

use std::collections::HashMap;
use std::path::Path;

use crate::files;
use crate::geometry::Point3;
use crate::vehicle::{
    GlbError, MAX_FACES, PrimitiveFault, glb,
    glb_read::Names,
    glb_schema::{Root, TRIANGLES},
    gltf_scene::{Matrix4, Triangles, get, placed_nodes, read_primitive, root_nodes},
};

use super::{
    ForeignGroup, ForeignScene, ImportError, MAX_GROUPS, PathFault, Remark, resolve,
    scene::{MAX_VERTICES, clean_name},
};

/// Most bytes of all paths of nodes together: a deep chain of nodes with long names must not fill the memory.
const MAX_PATHS: usize = 64 << 20;
/// Required extensions that change materials, textures and lights only.
const HARMLESS: [&str; 5] =
    ["KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_"];

/// Reads a `.glb` file.
pub(super) fn read_glb(path: &Path) -> Result<ForeignScene, ImportError> {
    let glb = files::read(path)?;
    let failed = |source| ImportError::Gltf { path: path.to_owned(), source };
    let (json, bytes) = glb::split(&glb).map_err(failed)?;
    read(path, json, Some(bytes))
}

/// Reads a `.gltf` file and the buffers it names.
pub(super) fn read_gltf(path: &Path) -> Result<ForeignScene, ImportError> {
    read(path, &files::read(path)?, None)
}

fn read(path: &Path, json: &[u8], chunk: Option<&[u8]>) -> Result<ForeignScene, ImportError> {
    let failed = |source| ImportError::Gltf { path: path.to_owned(), source };
    let root: Root = serde_json::from_slice(json).map_err(|error| failed(GlbError::Json(error)))?;
    let is_harmless = |name: &String| HARMLESS.iter().any(|start| name.starts_with(start));
    if let Some(extension) = root.extensions_required.iter().find(|name| !is_harmless(name)) {
        return Err(failed(GlbError::Extension(extension.clone())));
    }
    let contents = read_buffers(path, &root, chunk)?;
    let buffers: Vec<&[u8]> = contents.iter().map(Vec::as_slice).collect();
    let roots = root_nodes(&root).map_err(failed)?;
    let placed = placed_nodes(&root, &roots).map_err(failed)?;
    let paths = node_paths(&root, &roots);
    if paths.iter().map(String::len).sum::<usize>() > MAX_PATHS {
        return Err(ImportError::groups(path));
    }
    let mut scene = ForeignScene::default();
    let (mut faces, mut vertices, mut skipped) = (0, 0, 0);
    for (node, gltf_from_node) in placed {
        let Some(index) = root.nodes[node].mesh else { continue };
        let mesh = get("mesh", &root.meshes, index).map_err(failed)?;
        for (at, primitive) in mesh.primitives.iter().enumerate() {
            if primitive.mode.unwrap_or(TRIANGLES) < TRIANGLES {
                skipped += 1;
                continue;
            }
            let names = Names::of(&root, node, index, primitive);
            let faulty =
                |fault| failed(GlbError::Primitive { primitive: names.describe(index, at), fault });
            let triangles = read_primitive(&root, &buffers, primitive).map_err(faulty)?;
            faces += triangles.indices.len() / 3;
            if faces > MAX_FACES {
                return Err(ImportError::faces(path));
            }
            let (points, corners) = place(&triangles, &gltf_from_node).map_err(faulty)?;
            vertices += points.len();
            if vertices > MAX_VERTICES {
                return Err(ImportError::vertices(path));
            }
            if corners.is_empty() {
                continue;
            }
            if scene.groups.len() == MAX_GROUPS {
                return Err(ImportError::groups(path));
            }
            let name = |name: Option<&str>| clean_name(name.unwrap_or_default());
            scene.groups.push(ForeignGroup {
                path: paths[node].clone(),
                node: name(names.node),
                mesh: name(names.mesh),
                material: name(names.material),
                vertices: points,
                faces: corners,
            });
        }
    }
    if skipped > 0 {
        scene.remarks.push(Remark::NotTriangles(skipped));
    }
    Ok(scene)
}

/// The contents of the buffers, cut to the announced lengths.
fn read_buffers(
    path: &Path,
    root: &Root,
    chunk: Option<&[u8]>,
) -> Result<Vec<Vec<u8>>, ImportError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut contents = Vec::new();
    let mut total = 0;
    for (at, buffer) in root.buffers.iter().enumerate() {
        let failed = |source| ImportError::Buffer { path: path.to_owned(), buffer: at, source };
        let mut bytes = match (&buffer.uri, chunk) {
            (Some(uri), _) => resolve::read_uri(folder, uri).map_err(failed)?,
            // Only the first buffer of a GLB may be the chunk beside the JSON.
            (None, Some(chunk)) if at == 0 => chunk.to_vec(),
            (None, _) => Vec::new(),
        };
        let (needed, given) = (buffer.byte_length, bytes.len());
        if needed > given {
            return Err(failed(PathFault::Short { needed, given }));
        }
        bytes.truncate(needed);
        total += needed as u64;
        // One file may be named many times.
        if total > files::MAX_FILE {
            return Err(ImportError::TooMany {
                path: path.to_owned(),
                what: "bytes in buffers",
                limit: files::MAX_FILE as usize,
            });
        }
        contents.push(bytes);
    }
    Ok(contents)
}

/// The names from the root to each node; every node is known to be reached at most once.
fn node_paths(root: &Root, roots: &[usize]) -> Vec<String> {
    let mut paths = vec![String::new(); root.nodes.len()];
    let mut total = 0;
    let mut waiting: Vec<(usize, Option<usize>)> = roots.iter().map(|node| (*node, None)).collect();
    while let Some((index, parent)) = waiting.pop() {
        let name = clean_name(root.nodes[index].name.as_deref().unwrap_or_default());
        paths[index] = match parent {
            Some(parent) => format!("{}/{name}", paths[parent]),
            None => name,
        };
        total += paths[index].len();
        if total > MAX_PATHS {
            break;
        }
        waiting.extend(root.nodes[index].children.iter().map(|child| (*child, Some(index))));
    }
    paths
}

/// The vertices that triangles use, placed in the scene, and the triangles, which still face outwards.
fn place(
    triangles: &Triangles,
    gltf_from_node: &Matrix4,
) -> Result<(Vec<Point3>, Vec<[u32; 3]>), PrimitiveFault> {
    // By what is used, not by what is there: many nodes may each show one triangle of a large accessor.
    let mut local: HashMap<u32, u32> = HashMap::new();
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    let mirrors = gltf_from_node.determinant() < 0.0;
    for corners in triangles.indices.chunks_exact(3) {
        let mut face = [0; 3];
        for (corner, index) in face.iter_mut().zip(corners) {
            if let Some(known) = local.get(index) {
                *corner = *known;
                continue;
            }
            let vertex = *index as usize;
            let position = gltf_from_node.transform_point(&triangles.positions.position(vertex));
            if !position.iter().all(|value| value.is_finite()) {
                return Err(PrimitiveFault::NotFinite { vertex });
            }
            *corner = points.len() as u32;
            local.insert(*index, *corner);
            points.push(position);
        }
        if mirrors {
            face.swap(1, 2);
        }
        faces.push(face);
    }
    Ok((points, faces))
}
