//! One point a part, in the image and on the model (paper, § III-C).

use serde::{Deserialize, Serialize};

use crate::geometry::{Point2, Point3, Rect, Vector3};
use crate::parts::{BACKGROUND, CHANNELS, PartClass, PartMap, PartMask};
use crate::vehicle::VehicleModel;

/// Which point of the image stands for a part: O2D.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Center2d {
    /// The mean of the part's pixels.
    Mass,
    /// The centre of the part's bounding rectangle.
    Rectangle,
}

/// Which point of the model stands for a part: O3D.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Center3d {
    /// The mean of the vertices incident to the part's faces; a vertex on a seam counts once for each part.
    Mass,
    /// The centre of the axis-aligned cuboid around the same vertices.
    Cuboid,
    /// The centre of what is seen of the part from where the camera is.
    Visible,
}

/// What a mask says of one part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartEvidence {
    /// O2D, pixels.
    pub center: Point2,
    /// How many pixels show the part.
    pub pixels: usize,
    /// The pixels' bounding rectangle.
    pub bounds: Rect,
    /// Covariance of the pixels' positions: how far the part spreads, not how well its centre is known.
    pub scatter: nalgebra::Matrix2<f64>,
}

#[derive(Clone, Copy)]
struct Sums {
    count: i64,
    x: i64,
    y: i64,
    xx: i64,
    xy: i64,
    yy: i64,
    low: [i32; 2],
    high: [i32; 2],
}

impl Sums {
    const EMPTY: Self =
        Self { count: 0, x: 0, y: 0, xx: 0, xy: 0, yy: 0, low: [i32::MAX; 2], high: [i32::MIN; 2] };

    /// Adds the pixels `start..end` of row `y`.
    fn add_run(&mut self, start: i32, end: i32, y: i32) {
        let (a, b) = (i64::from(start), i64::from(end));
        let n = b - a;
        let sum = n * (a + b - 1) / 2;
        let squares = |k: i64| (k - 1) * k * (2 * k - 1) / 6;
        self.count += n;
        self.x += sum;
        self.y += n * i64::from(y);
        self.xx += squares(b) - squares(a);
        self.xy += sum * i64::from(y);
        self.yy += n * i64::from(y) * i64::from(y);
        self.low = [self.low[0].min(start), self.low[1].min(y)];
        self.high = [self.high[0].max(end - 1), self.high[1].max(y)];
    }

    fn evidence(&self, kind: Center2d) -> Option<PartEvidence> {
        if self.count == 0 {
            return None;
        }
        let n = self.count as f64;
        let mean = Point2::new(self.x as f64 / n, self.y as f64 / n);
        let (xx, xy, yy) = (self.xx as f64 / n, self.xy as f64 / n, self.yy as f64 / n);
        let [left, top] = self.low.map(f64::from);
        let [right, bottom] = self.high.map(f64::from);
        let bounds = Rect::from_inclusive(left, top, right, bottom);
        // A pixel is an area: its own spread is 1/12 square pixel.
        let scatter = nalgebra::Matrix2::new(
            xx - mean.x * mean.x + 1.0 / 12.0,
            xy - mean.x * mean.y,
            xy - mean.x * mean.y,
            yy - mean.y * mean.y + 1.0 / 12.0,
        );
        let center = match kind {
            Center2d::Mass => mean,
            Center2d::Rectangle => bounds.center(),
        };
        Some(PartEvidence { center, pixels: self.count as usize, bounds, scatter })
    }
}

/// What a mask shows of each part: O2D with pixel counts, in one pass over the runs of equal labels.
pub fn part_evidence(mask: &PartMask, kind: Center2d) -> PartMap<PartEvidence> {
    let mut sums = [Sums::EMPTY; CHANNELS];
    for (row, y) in mask.rows().zip(mask.origin[1]..) {
        let mut start = 0;
        while start < row.len() {
            let label = row[start];
            let run = row[start..].iter().position(|other| *other != label);
            let end = run.map_or(row.len(), |run| start + run);
            if label != BACKGROUND {
                let x = mask.origin[0];
                sums[usize::from(label)].add_run(x + start as i32, x + end as i32, y);
            }
            start = end;
        }
    }
    PartClass::ALL
        .into_iter()
        .filter_map(|class| Some((class, sums[usize::from(class.id())].evidence(kind)?)))
        .collect()
}

/// O3D of each part by its vertices, in the coordinates of the model; `Visible` has no single answer, and gets `Mass`.
pub fn model_centers(model: &VehicleModel, kind: Center3d) -> PartMap<Point3> {
    let mesh = model.mesh();
    // Bit c of a vertex: already counted for class c.
    let mut counted = vec![0u32; mesh.vertices.len()];
    let mut parts: PartMap<(usize, Vector3, Point3, Point3)> = PartMap::default();
    for (face, class) in mesh.faces.iter().zip(&mesh.parts) {
        for index in face {
            let bit = 1 << class.index();
            if counted[*index as usize] & bit != 0 {
                continue;
            }
            counted[*index as usize] |= bit;
            let vertex = mesh.vertices[*index as usize];
            match parts.get_mut(*class) {
                Some((count, sum, low, high)) => {
                    *count += 1;
                    *sum += vertex.coords;
                    *low = low.inf(&vertex);
                    *high = high.sup(&vertex);
                }
                None => {
                    parts.insert(*class, (1, vertex.coords, vertex, vertex));
                }
            }
        }
    }
    parts.map(|_, (count, sum, low, high)| match kind {
        Center3d::Mass | Center3d::Visible => Point3::from(sum / *count as f64),
        Center3d::Cuboid => nalgebra::center(low, high),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Extent;
    use crate::vehicle::Mesh;

    #[test]
    fn evidence_is_that_of_the_pixels() {
        // An L of hood pixels and one roof pixel.
        let mask = PartMask { origin: [10, 20], size: [3, 2], labels: vec![27, 0, 25, 27, 27, 0] };
        let mass = part_evidence(&mask, Center2d::Mass);
        let hood = mass.get(PartClass::Hood).unwrap();
        assert_eq!(hood.pixels, 3);
        assert!((hood.center - Point2::new(10.0 + 1.0 / 3.0, 20.0 + 2.0 / 3.0)).norm() < 1e-12);
        assert!((hood.scatter[(0, 0)] - (2.0 / 9.0 + 1.0 / 12.0)).abs() < 1e-9);
        let rectangle = part_evidence(&mask, Center2d::Rectangle);
        assert_eq!(rectangle.get(PartClass::Hood).unwrap().center, Point2::new(10.5, 20.5));
        assert_eq!(rectangle.get(PartClass::Roof).unwrap().center, Point2::new(12.0, 20.0));
        assert_eq!(mass.len(), 2);
    }

    #[test]
    fn vertex_on_a_seam_counts_once_for_each_part() {
        let point = Point3::new;
        let mesh = Mesh {
            vertices: vec![
                point(0.0, 0.0, 0.0),
                point(1.0, 0.0, 0.0),
                point(1.0, -1.0, 0.0),
                point(0.0, -1.0, 0.0),
                point(4.0, 0.0, 0.0),
            ],
            faces: vec![[0, 1, 2], [0, 2, 3], [1, 4, 2]],
            parts: vec![PartClass::Hood, PartClass::Hood, PartClass::Roof],
        };
        let model =
            VehicleModel::new("m", "Car", "sedan", Extent::new(1.0, 1.0, 1.0), mesh).unwrap();
        let mass = model_centers(&model, Center3d::Mass);
        assert_eq!(mass.get(PartClass::Hood), Some(&point(0.5, -0.5, 0.0)));
        assert!((mass.get(PartClass::Roof).unwrap() - point(2.0, -1.0 / 3.0, 0.0)).norm() < 1e-12);
        let cuboid = model_centers(&model, Center3d::Cuboid);
        assert_eq!(cuboid.get(PartClass::Roof), Some(&point(2.5, -0.5, 0.0)));
    }
}
