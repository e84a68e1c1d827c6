//! The surface of a voxel set by naive surface nets (Gibson: *Constrained Elastic Surface Nets*, MICCAI 1998; the vertex
//! of a cell is the mean of its edge crossings).
//!
//! Right half only, closed by its mirror image: the vertices of the cells that straddle the mirror plane lie on it. Naive
//! surface nets are a manifold only where no cell is ambiguous, so ambiguous corners are filled first
//! (well-composed sets: Latecki, Eckhardt, Rosenfeld, CVIU 1995).

use crate::geometry::Point3;
use crate::vehicle::half::HalfMesh;

use super::hull::Grid;

/// Blurs a field with the kernel (1, 2, 1) / 4 along each axis, mirrored at x = 0, zero beyond the grid.
pub(super) fn blur(grid: &Grid, field: &mut [f32], rounds: usize) {
    let [nx, ny, nz] = grid.size;
    for _ in 0..rounds {
        for axis in 0..3 {
            let source = field.to_vec();
            let at = |i: isize, j: isize, k: isize| {
                let i = if i < 0 { -1 - i } else { i } as usize;
                if j < 0 || k < 0 || i >= nx || j as usize >= ny || k as usize >= nz {
                    return 0.0;
                }
                source[grid.index(i, j as usize, k as usize)]
            };
            for k in 0..nz as isize {
                for j in 0..ny as isize {
                    for i in 0..nx as isize {
                        let (a, b) = match axis {
                            0 => (at(i - 1, j, k), at(i + 1, j, k)),
                            1 => (at(i, j - 1, k), at(i, j + 1, k)),
                            _ => (at(i, j, k - 1), at(i, j, k + 1)),
                        };
                        let n = grid.index(i as usize, j as usize, k as usize);
                        field[n] = 0.5 * source[n] + 0.25 * (a + b);
                    }
                }
            }
        }
    }
}

/// Keeps the largest connected set (through faces, mirror plane included) of voxels above `level`; the rest becomes 0.
pub(super) fn keep_largest(grid: &Grid, field: &mut [f32], level: f32) {
    let [nx, ny, nz] = grid.size;
    let mut mark = vec![0u32; field.len()];
    let (mut best, mut best_size, mut count) = (0, 0usize, 0);
    for seed in 0..field.len() {
        if field[seed] <= level || mark[seed] != 0 {
            continue;
        }
        count += 1;
        mark[seed] = count;
        let (mut stack, mut size) = (vec![seed], 0);
        while let Some(n) = stack.pop() {
            size += 1;
            let (i, j, k) = (n % nx, n / nx % ny, n / nx / ny);
            let mut visit = |m: usize| {
                if field[m] > level && mark[m] == 0 {
                    mark[m] = count;
                    stack.push(m);
                }
            };
            if i > 0 {
                visit(n - 1);
            }
            if i + 1 < nx {
                visit(n + 1);
            }
            if j > 0 {
                visit(n - nx);
            }
            if j + 1 < ny {
                visit(n + nx);
            }
            if k > 0 {
                visit(n - nx * ny);
            }
            if k + 1 < nz {
                visit(n + nx * ny);
            }
        }
        if size > best_size {
            (best, best_size) = (count, size);
        }
    }
    for (value, mark) in field.iter_mut().zip(&mark) {
        if *mark != best {
            *value = value.min(0.0);
        }
    }
}

/// A field with a frame of empty voxels around it and one mirrored column at the left.
struct Padded {
    size: [usize; 3],
    values: Vec<f32>,
}

impl Padded {
    fn new(grid: &Grid, field: &[f32], level: f32) -> Self {
        let size = grid.size.map(|n| n + 2);
        let mut values = vec![-level; size.iter().product()];
        for k in 0..grid.size[2] {
            for j in 0..grid.size[1] {
                // The outermost layer stays empty, so that the surface is closed wherever the set ends.
                let edge = j == 0 || k == 0 || j + 1 == grid.size[1] || k + 1 == grid.size[2];
                for i in 0..if edge { 0 } else { grid.size[0] } {
                    // Column 0 mirrors column 1.
                    let value = field[grid.index(i.saturating_sub(1), j, k)] - level;
                    let n = ((k + 1) * size[1] + j + 1) * size[0] + i;
                    values[n] = if value == 0.0 { -1e-6 } else { value };
                }
            }
        }
        Self { size, values }
    }

    fn index(&self, i: usize, j: usize, k: usize) -> usize {
        (k * self.size[1] + j) * self.size[0] + i
    }

    /// Fills corners until no two voxels touch only at an edge or a corner.
    fn compose(&mut self) {
        let [nx, ny, nz] = self.size;
        for _ in 0..64 {
            let mut changed = false;
            for k in 0..nz - 1 {
                for j in 0..ny - 1 {
                    for i in 0..nx - 1 {
                        let corners: [usize; 8] = std::array::from_fn(|c| {
                            self.index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2))
                        });
                        changed |= self.compose_cell(&corners);
                    }
                }
            }
            // The mirrored column follows.
            for k in 0..nz {
                for j in 0..ny {
                    let (a, b) = (self.index(0, j, k), self.index(1, j, k));
                    let value = self.values[a].max(self.values[b]);
                    self.values[a] = value;
                    self.values[b] = value;
                }
            }
            if !changed {
                break;
            }
        }
    }

    fn compose_cell(&mut self, corners: &[usize; 8]) -> bool {
        const SQUARES: [[usize; 4]; 6] =
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let inside = |c: usize| self.values[corners[c]] > 0.0;
        let mut fill: Vec<usize> = Vec::new();
        for s in SQUARES {
            let [a, b, c, d] = s.map(inside);
            if a == c && b == d && a != b {
                fill.extend(s.iter().filter(|c| !inside(**c)));
            }
        }
        for c in 0..4 {
            // Two opposite corners alone, inside or outside.
            let pair = [c, 7 - c];
            let alone = (0..8).all(|o| inside(o) == (inside(c) ^ !pair.contains(&o)));
            if alone && inside(c) == inside(7 - c) {
                fill.extend((0..8).filter(|c| !inside(*c)));
            }
        }
        for c in &fill {
            self.values[corners[*c]] = 1e-3;
        }
        !fill.is_empty()
    }
}

/// The right half of the surface where `field` crosses `level`.
pub(super) fn extract(grid: &Grid, field: &[f32], level: f32) -> HalfMesh {
    let mut padded = Padded::new(grid, field, level);
    padded.compose();
    let [nx, ny, nz] = padded.size;
    let mut vertex_of_cell = vec![u32::MAX; padded.values.len()];
    let mut mesh = HalfMesh::default();
    for k in 0..nz - 1 {
        for j in 0..ny - 1 {
            for i in 0..nx - 1 {
                if let Some(at) = cell_vertex(&padded, [i, j, k]) {
                    vertex_of_cell[padded.index(i, j, k)] = mesh.vertices.len() as u32;
                    // Padded index 0 is voxel -1; voxel n has its centre at n + 1/2.
                    let [x, y, z]: [f64; 3] =
                        std::array::from_fn(|a| grid.origin[a] + (at[a] - 0.5) * grid.step[a]);
                    mesh.vertices.push(Point3::new(if i == 0 { 0.0 } else { x.max(0.0) }, y, z));
                    mesh.on_plane.push(i == 0);
                }
            }
        }
    }
    let strides = [1, nx, nx * ny];
    for k in 1..nz - 1 {
        for j in 1..ny - 1 {
            for i in 1..nx - 1 {
                let n = padded.index(i, j, k);
                for axis in 0..3 {
                    let (here, there) =
                        (padded.values[n] > 0.0, padded.values[n + strides[axis]] > 0.0);
                    if here == there {
                        continue;
                    }
                    let (b, c) = (strides[(axis + 1) % 3], strides[(axis + 2) % 3]);
                    let quad = [n - b - c, n - c, n, n - b].map(|cell| vertex_of_cell[cell]);
                    let [p, q, r, s] =
                        if here { quad } else { [quad[3], quad[2], quad[1], quad[0]] };
                    mesh.faces.push([p, q, r]);
                    mesh.faces.push([p, r, s]);
                }
            }
        }
    }
    mesh
}

/// The mean of the crossings on a cell's edges, in padded coordinates; `None` where there is none.
fn cell_vertex(padded: &Padded, cell: [usize; 3]) -> Option<[f64; 3]> {
    let value = |c: usize| {
        f64::from(
            padded.values
                [padded.index(cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2))],
        )
    };
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for c in 0..8usize {
        for axis in 0..3 {
            let other = c | 1 << axis;
            if other == c {
                continue;
            }
            let (a, b) = (value(c), value(other));
            if (a > 0.0) == (b > 0.0) {
                continue;
            }
            for (k, sum) in sum.iter_mut().enumerate() {
                *sum += (c >> k & 1) as f64 + if k == axis { a / (a - b) } else { 0.0 };
            }
            count += 1.0;
        }
    }
    (count > 0.0).then(|| std::array::from_fn(|k| cell[k] as f64 + sum[k] / count))
}
