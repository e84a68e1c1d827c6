//! OBJ: groups by object, group and material.
//!
//! Wavefront: *Advanced Visualizer Manual*, 1995, appendix B. Read are `v`, `f` with polygons of any number of corners
//! and indices from either end, `o`, `g`, `usemtl` and `mtllib`; lines may go on after a `\`. Names need not be UTF-8.
//! The reader is our own because messages must tell the line, which the usual crate's do not.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

use crate::files;
use crate::geometry::Point3;
use crate::vehicle::MAX_FACES;

use super::{
    ForeignGroup, ForeignScene, ImportError, LineFault, MAX_GROUPS, PathFault, Remark, mtl,
    polygon::{MAX_CORNERS, triangulate},
    resolve,
    scene::{MAX_VERTICES, clean_name},
};

/// Statements without a triangle that need no remark.
const KNOWN: [&str; 14] = [
    "vt",
    "vn",
    "vp",
    "s",
    "mg",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
    "usemap",
    "maplib",
    "#",
];
/// Points, lines and curves.
const NOT_TRIANGLES: [&str; 5] = ["p", "l", "curv", "curv2", "surf"];
/// Most remarks about materials; a file may name thousands.
const MAX_REMARKS: usize = 10;

/// Reads an `.obj` file.
pub(super) fn read_obj(path: &Path) -> Result<ForeignScene, ImportError> {
    let bytes = files::read(path)?;
    let lines = || lines(&bytes);
    // Vertices first: a face tells its corners by number, and where a polygon is cut depends on where they lie.
    let mut vertices: Vec<Point3> = Vec::new();
    for (line, text) in lines() {
        if let Some(rest) =
            text.trim_start().strip_prefix("v ").or_else(|| text.strip_prefix("v\t"))
        {
            let vertex = vertex(rest);
            let failed = |source| ImportError::Line { path: path.to_owned(), line, source };
            vertices.push(vertex.map_err(failed)?);
            if vertices.len() > MAX_VERTICES {
                return Err(ImportError::vertices(path));
            }
        }
    }
    let mut reader = Reader { path, vertices: &vertices, ..Reader::new(path) };
    for (line, text) in lines() {
        reader.statement(line, &text)?;
    }
    reader.finish()
}

struct Reader<'a> {
    path: &'a Path,
    vertices: &'a [Point3],
    /// Vertices met so far, from which negative indices count.
    met: usize,
    object: String,
    group: String,
    material: String,
    builders: Vec<Builder>,
    builder_at: BTreeMap<[String; 3], usize>,
    current: Option<usize>,
    faces: usize,
    libraries: usize,
    defined: BTreeSet<String>,
    used: BTreeMap<String, usize>,
    not_triangles: usize,
    fans: usize,
    unknown: Option<(usize, String)>,
    remarks: Vec<Remark>,
}

#[derive(Default)]
struct Builder {
    group: ForeignGroup,
    local: HashMap<u32, u32>,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path) -> Self {
        Self {
            path,
            vertices: &[],
            met: 0,
            object: String::new(),
            group: String::new(),
            material: String::new(),
            builders: Vec::new(),
            builder_at: BTreeMap::new(),
            current: None,
            faces: 0,
            libraries: 0,
            defined: BTreeSet::new(),
            used: BTreeMap::new(),
            not_triangles: 0,
            fans: 0,
            unknown: None,
            remarks: Vec::new(),
        }
    }

    fn statement(&mut self, line: usize, text: &str) -> Result<(), ImportError> {
        let text = text.trim();
        let (keyword, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let failed = |source| ImportError::Line { path: self.path.to_owned(), line, source };
        match keyword {
            "v" => self.met += 1,
            "f" => {
                let corners = self.corners(rest).map_err(failed)?;
                self.polygon(&corners)?;
            }
            "o" | "g" => {
                let name = clean_name(rest);
                // An object begins without a group.
                if keyword == "o" {
                    (self.object, self.group) = (name, String::new());
                } else {
                    self.group = name;
                }
                self.current = None;
            }
            "usemtl" => {
                self.material = clean_name(rest);
                self.used.entry(self.material.clone()).or_insert(line);
                self.current = None;
            }
            "mtllib" => self.library(line, rest.trim())?,
            "" => {}
            _ if NOT_TRIANGLES.contains(&keyword) => self.not_triangles += 1,
            _ if KNOWN.contains(&keyword) || keyword.starts_with('#') => {}
            _ => {
                let shown = || clean_name(keyword).chars().take(40).collect();
                self.unknown.get_or_insert_with(|| (line, shown()));
            }
        }
        Ok(())
    }

    /// A library's name may hold spaces, and one line may name several: the whole is tried first.
    fn library(&mut self, line: usize, rest: &str) -> Result<(), ImportError> {
        let failed = |source| ImportError::Line { path: self.path.to_owned(), line, source };
        if rest.is_empty() {
            return Err(failed(LineFault::NoName("mtllib")));
        }
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let names = match resolve::file_inside(folder, rest) {
            Err(PathFault::NotAFile(_)) => rest.split_whitespace().collect(),
            _ => vec![rest],
        };
        for name in names {
            // Two names of one file, again and again, are no reason to read it again.
            self.libraries += 1;
            if self.libraries > MAX_GROUPS {
                return Err(ImportError::groups(self.path));
            }
            match resolve::file_inside(folder, name) {
                Ok(file) => self.defined.extend(mtl::read_names(&file)?),
                Err(PathFault::NotAFile(name)) => {
                    self.remarks.push(Remark::NoLibrary { line, name });
                }
                Err(fault) => return Err(failed(LineFault::Path(fault))),
            }
        }
        Ok(())
    }

    /// Indices of vertices, from 0.
    fn corners(&self, rest: &str) -> Result<Vec<u32>, LineFault> {
        let count = self.vertices.len();
        let corner = |word: &str| {
            let number = word.split('/').next().unwrap_or_default();
            let unreadable = || LineFault::Index(clean_name(word).chars().take(40).collect());
            let index: i64 = number.parse().map_err(|_| unreadable())?;
            let zero_based = match index {
                0 => return Err(unreadable()),
                1.. => index - 1,
                _ => self.met as i64 + index,
            };
            let vertex = usize::try_from(zero_based).ok().filter(|at| *at < count);
            vertex.map(|at| at as u32).ok_or(LineFault::Vertex { index, count })
        };
        let words = rest.split_whitespace().take_while(|word| !word.starts_with('#'));
        let corners: Vec<u32> = words.map(corner).collect::<Result<_, _>>()?;
        if corners.len() < 3 {
            return Err(LineFault::Few { needed: 3, given: corners.len() });
        }
        Ok(corners)
    }

    fn polygon(&mut self, corners: &[u32]) -> Result<(), ImportError> {
        self.faces += corners.len() - 2;
        if self.faces > MAX_FACES {
            return Err(ImportError::faces(self.path));
        }
        self.fans += usize::from(corners.len() > MAX_CORNERS);
        let current = self.current()?;
        let builder = &mut self.builders[current];
        let vertices = self.vertices;
        let points: Vec<Point3> = corners.iter().map(|at| vertices[*at as usize]).collect();
        for triangle in triangulate(&points) {
            let face = triangle.map(|at| {
                let group = &mut builder.group;
                *builder.local.entry(corners[at]).or_insert_with(|| {
                    group.vertices.push(points[at]);
                    group.vertices.len() as u32 - 1
                })
            });
            builder.group.faces.push(face);
        }
        Ok(())
    }

    /// The group of the names that hold now.
    fn current(&mut self) -> Result<usize, ImportError> {
        if let Some(current) = self.current {
            return Ok(current);
        }
        let key = [&self.object, &self.group, &self.material].map(Clone::clone);
        let current = match self.builder_at.get(&key) {
            Some(at) => *at,
            None if self.builders.len() == MAX_GROUPS => {
                return Err(ImportError::groups(self.path));
            }
            None => {
                let [object, group, material] = key.clone();
                let path = match (object.is_empty(), group.is_empty()) {
                    (false, false) => format!("{object}/{group}"),
                    (true, _) => group.clone(),
                    (_, true) => object.clone(),
                };
                let node = if group.is_empty() { object.clone() } else { group };
                let group =
                    ForeignGroup { path, node, mesh: object, material, ..ForeignGroup::default() };
                self.builders.push(Builder { group, local: HashMap::new() });
                self.builder_at.insert(key, self.builders.len() - 1);
                self.builders.len() - 1
            }
        };
        self.current = Some(current);
        Ok(current)
    }

    fn finish(mut self) -> Result<ForeignScene, ImportError> {
        if let (0, Some((line, keyword))) = (self.faces, self.unknown) {
            let (path, source) = (self.path.to_owned(), LineFault::Keyword(keyword));
            return Err(ImportError::Line { path, line, source });
        }
        // Without any library nothing is expected of one.
        if !self.defined.is_empty() {
            let undefined = self.used.iter().filter(|(name, _)| !self.defined.contains(*name));
            let remark = |(name, line): (&String, &usize)| Remark::NoMaterial {
                line: *line,
                name: name.clone(),
            };
            self.remarks.extend(undefined.map(remark));
        }
        self.remarks.truncate(MAX_REMARKS);
        if self.not_triangles > 0 {
            self.remarks.push(Remark::NotTriangles(self.not_triangles));
        }
        if self.fans > 0 {
            self.remarks.push(Remark::Fans(self.fans));
        }
        let groups = self.builders.into_iter().map(|builder| builder.group).collect();
        Ok(ForeignScene { groups, remarks: self.remarks })
    }
}

fn vertex(rest: &str) -> Result<Point3, LineFault> {
    // A weight or a colour may follow.
    let mut words = rest.split_whitespace();
    let mut point = Point3::origin();
    for axis in 0..3 {
        let word = words.next().ok_or(LineFault::Few { needed: 3, given: axis })?;
        let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
        let unreadable = || LineFault::Number(clean_name(word).chars().take(40).collect());
        point[axis] = value.ok_or_else(unreadable)?;
    }
    Ok(point)
}

/// Lines with the number of their first one; a `\` at the end joins the next.
fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut rest = bytes;
    let mut number = 0;
    std::iter::from_fn(move || {
        let (mut joined, start) = (Vec::new(), number + 1);
        loop {
            if rest.is_empty() {
                return (!joined.is_empty())
                    .then(|| (start, Cow::Owned(String::from_utf8_lossy(&joined).into_owned())));
            }
            let end = rest.iter().position(|byte| *byte == b'\n');
            let line = &rest[..end.unwrap_or(rest.len())];
            rest = end.map_or(&[][..], |end| &rest[end + 1..]);
            number += 1;
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            match line.strip_suffix(b"\\") {
                Some(line) => {
                    joined.extend_from_slice(line);
                    joined.push(b' ');
                }
                None if joined.is_empty() => return Some((start, String::from_utf8_lossy(line))),
                None => {
                    joined.extend_from_slice(line);
                    let text = String::from_utf8_lossy(&joined).into_owned();
                    return Some((start, Cow::Owned(text)));
                }
            }
        }
    })
}
