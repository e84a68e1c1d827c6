//! Polygons as masks, pixel for pixel as COCO's tools draw them.
//!
//! The outline is walked on a grid five times as fine (`rleFrPoly` of `maskApi.c`, Lin et al.: *Microsoft COCO*, ECCV
//! 2014). Where it enters another column of pixels, its height there is where the mask changes between outside and
//! inside, counted by columns. A column's two changes cancel if they are equal.

use crate::parts::rle::{MAX_PIXELS, Rle, RleBuilder};

use super::segmentation::push_run;

/// Fine cells a pixel.
const SCALE: f64 = 5.0;
/// Largest coordinate that is drawn, pixels.
const MAX_COORDINATE: f64 = 1e5;
/// Most points of an outline on the fine grid.
const MAX_POINTS: usize = 1 << 24;

/// The pixels of a polygon `x, y, x, y ...` in an image of this width and height.
pub fn rasterize(corners: &[f64], size: [u32; 2]) -> Result<Rle, &'static str> {
    if corners.len() < 6 || !corners.len().is_multiple_of(2) {
        return Err("three or more pairs of coordinates are needed");
    }
    if corners.iter().any(|value| !(value.abs() <= MAX_COORDINATE)) {
        return Err("a coordinate lies far outside any image");
    }
    if u64::from(size[0]) * u64::from(size[1]) > MAX_PIXELS {
        return Err("its image is larger than any that is read");
    }
    let outline = outline(corners).ok_or("its outline is longer than any that is drawn")?;
    let mut changes = changes(&outline, size);
    changes.sort_unstable();
    let mut builder = RleBuilder::new(size);
    // The last change ends the image; a mask that is open there stays open to it.
    changes.push(size[0] * size[1]);
    for pair in changes.chunks_exact(2) {
        push_run(&mut builder, size[1], [pair[0], pair[1]]);
    }
    Ok(builder.finish())
}

/// All points of the closed outline on the fine grid.
fn outline(corners: &[f64]) -> Option<Vec<[i64; 2]>> {
    let fine = |value: &f64| (SCALE * value + 0.5) as i64;
    let corners: Vec<[i64; 2]> =
        corners.chunks_exact(2).map(|pair| [fine(&pair[0]), fine(&pair[1])]).collect();
    let mut points = Vec::new();
    for (i, from) in corners.iter().enumerate() {
        let to = &corners[(i + 1) % corners.len()];
        let distance = [0, 1].map(|axis: usize| (to[axis] - from[axis]).abs());
        // The axis along which every cell gets one point.
        let along = usize::from(distance[1] > distance[0]);
        let across = 1 - along;
        let flipped = from[along] > to[along];
        let (start, end) = if flipped { (to, from) } else { (from, to) };
        let steps = distance[along];
        if points.len() + steps as usize + 1 > MAX_POINTS {
            return None;
        }
        let slope =
            if steps == 0 { 0.0 } else { (end[across] - start[across]) as f64 / steps as f64 };
        for step in 0..=steps {
            let t = if flipped { steps - step } else { step };
            let mut point = [0; 2];
            point[along] = start[along] + t;
            point[across] = (start[across] as f64 + slope * t as f64 + 0.5) as i64;
            points.push(point);
        }
    }
    Some(points)
}

/// Where the mask changes, counted by columns.
fn changes(outline: &[[i64; 2]], [width, height]: [u32; 2]) -> Vec<u32> {
    let mut changes = Vec::new();
    for pair in outline.windows(2) {
        let [[x0, y0], [x1, y1]] = [pair[0], pair[1]];
        if x0 == x1 {
            continue;
        }
        let x = if x1 < x0 { x1 } else { x1 - 1 };
        // Whole only in the middle of a pixel's five cells.
        let x = (x as f64 + 0.5) / SCALE - 0.5;
        if x.fract() != 0.0 || x < 0.0 || x > f64::from(width) - 1.0 {
            continue;
        }
        let y = (y0.min(y1) as f64 + 0.5) / SCALE - 0.5;
        let y = y.clamp(0.0, f64::from(height)).ceil();
        changes.push(x as u32 * height + y as u32);
    }
    changes
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_rectangle_covers_the_pixels_between_its_corners() {
        let rle = rasterize(&[1.0, 1.0, 4.0, 1.0, 4.0, 3.0, 1.0, 3.0], [6, 5]).unwrap();
        assert_eq!((rle.area(), rle.bounds()), (6, [1, 1, 3, 2]));
    }

    proptest! {
        #[test]
        fn any_polygon_is_drawn_within_its_image(
            corners in prop::collection::vec(-40.0..80.0f64, 6..20),
            size in [0u32..30, 0u32..30],
        ) {
            if let Ok(rle) = rasterize(&corners, size) {
                prop_assert_eq!(rle.size(), size);
                prop_assert!(rle.area() <= u64::from(size[0] * size[1]));
            }
        }
    }
}
