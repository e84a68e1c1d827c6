//! How far the outlines of masks lie off those of the models, measured on frames with known poses.
//!
//! Rows and columns of pixels are compared one by one: where the vehicle's own part pixels begin and end against where
//! the model, drawn at its true pose and size, does. What depends on the distance is a straight line in 1 / z.

use rayon::prelude::*;

use crate::dataset::Frame;
use crate::geometry::Rect;
use crate::oracle::Oracle;
use crate::parts::BACKGROUND;
use crate::pose::dense::MaskBias;
use crate::render::{Instance, LabelRenderer, RenderOptions};
use crate::vehicle::ModelZoo;

/// Ends that lie farther apart than this, in pixels, are not the same outline: something hides it.
const REACH: i64 = 4;
/// Fewest rows or columns of a vehicle that tell of a side.
const LEAST_LINES: usize = 6;
/// Nearest and farthest vehicles that are measured, metres.
const DISTANCES: [f64; 2] = [8.0, 60.0];
/// Fewest vehicles that make a measurement.
const LEAST_VEHICLES: usize = 20;

/// The bias of the masks of the vehicles that `include` names; `None` where fewer than 20 can be measured.
///
/// Frames whose mask cannot be read are passed over. Vehicles that the image cuts are, too.
pub fn measure_mask_bias(
    frames: &[Frame],
    zoo: &ModelZoo,
    include: &(dyn Fn(&Frame, usize) -> bool + Sync),
) -> Option<MaskBias> {
    let measured: Vec<(f64, [Option<f64>; 4])> = frames
        .par_iter()
        .flat_map_iter(|frame| {
            let wanted: Vec<usize> = (0..frame.vehicles.len())
                .filter(|index| {
                    let vehicle = &frame.vehicles[*index];
                    let z = vehicle.cuboid.camera_from_vehicle.translation.z;
                    let in_range = (DISTANCES[0]..DISTANCES[1]).contains(&z);
                    let whole = vehicle.truncated == 0 && !vehicle.dont_care;
                    whole && in_range && include(frame, *index)
                })
                .collect();
            let parts = if wanted.is_empty() { None } else { frame.read_parts().ok() };
            let oracle = parts.map(|parts| Oracle::new(frame, parts, zoo));
            let mut renderer = LabelRenderer::default();
            let sides = |index: usize| {
                let z = frame.vehicles[index].cuboid.camera_from_vehicle.translation.z;
                Some((z, offsets(frame, index, oracle.as_ref()?, zoo, &mut renderer)?))
            };
            wanted.into_iter().filter_map(sides).collect::<Vec<_>>()
        })
        .collect();
    let mut bias = MaskBias::default();
    for side in 0..4 {
        let points: Vec<[f64; 2]> =
            measured.iter().filter_map(|(z, sides)| Some([1.0 / z, sides[side]?])).collect();
        [bias.offset[side], bias.per_distance[side]] = line(points)?;
    }
    Some(bias)
}

/// Mean distance from the drawn to the observed outline on each side, positive outwards, pixels.
fn offsets(
    frame: &Frame,
    index: usize,
    oracle: &Oracle,
    zoo: &ModelZoo,
    renderer: &mut LabelRenderer,
) -> Option<[Option<f64>; 4]> {
    let vehicle = &frame.vehicles[index];
    let model = zoo.get(vehicle.model.as_deref()?)?;
    let (x0, y0, x1, y1) = Rect {
        x_min: vehicle.bounds.x_min - 6.0,
        y_min: vehicle.bounds.y_min - 6.0,
        x_max: vehicle.bounds.x_max + 6.0,
        y_max: vehicle.bounds.y_max + 6.0,
    }
    .pixels(frame.camera.size);
    if x1 <= x0 || y1 <= y0 {
        return None;
    }
    let size = [(x1 - x0) as usize, (y1 - y0) as usize];
    let [left, top] = [x0, y0].map(|low| f64::from(low) - 0.5);
    let window = Rect::new(left, top, f64::from(x1) - 0.5, f64::from(y1) - 0.5);
    let instance = Instance {
        mesh: model.mesh(),
        scale: vehicle.cuboid.extent.ratio(&model.extent()),
        camera_from_vehicle: vehicle.cuboid.camera_from_vehicle,
        id: 1,
    };
    let crop = frame.camera.crop(&window, [x1 - x0, y1 - y0]);
    let drawn = renderer.render(&crop, &[instance], &RenderOptions::default());
    let width = frame.camera.size[0] as usize;
    let at = |x: usize, y: usize| (y + y0 as usize) * width + x + x0 as usize;
    let own = index as u16 + 1;
    let owner = |x: usize, y: usize| oracle.owners()[at(x, y)];
    let seen =
        |x: usize, y: usize| owner(x, y) == own && oracle.parts().labels[at(x, y)] != BACKGROUND;
    let model = |x: usize, y: usize| drawn.parts[y * size[0] + x] != BACKGROUND;
    let mut sides: [Vec<i64>; 4] = Default::default();
    for axis in 0..2 {
        let (lines, length) = (size[1 - axis], size[axis]);
        for line in 0..lines {
            let pixel = |i: usize| if axis == 0 { (i, line) } else { (line, i) };
            // Where another vehicle is near, nobody knows whose the outline is.
            let others = |i: usize| {
                let (x, y) = pixel(i);
                ![0, own].contains(&owner(x, y))
            };
            if (0..length).any(others) {
                continue;
            }
            let ends = |shows: &dyn Fn(usize, usize) -> bool| {
                let mut shown = (0..length).filter(|i| {
                    let (x, y) = pixel(*i);
                    shows(x, y)
                });
                let first = shown.next()? as i64;
                Some((first, shown.last().map_or(first, |last| last as i64)))
            };
            let (Some(a), Some(b)) = (ends(&model), ends(&seen)) else { continue };
            for (side, offset) in [(axis, a.0 - b.0), (axis + 2, b.1 - a.1)] {
                if offset.abs() <= REACH {
                    sides[side].push(offset);
                }
            }
        }
    }
    let mean = |offsets: &Vec<i64>| {
        let sum = offsets.iter().sum::<i64>() as f64;
        (offsets.len() >= LEAST_LINES).then(|| sum / offsets.len() as f64)
    };
    Some(sides.each_ref().map(mean))
}

/// Value at 0 and slope of a straight line through points `[x, y]`, those far off it left out.
fn line(mut points: Vec<[f64; 2]>) -> Option<[f64; 2]> {
    let mut fitted = None;
    for _ in 0..4 {
        if points.len() < LEAST_VEHICLES {
            return fitted;
        }
        let n = points.len() as f64;
        let mean = |i: usize| points.iter().map(|p| p[i]).sum::<f64>() / n;
        let (x, y) = (mean(0), mean(1));
        let sum = |i: usize, j: usize| {
            points.iter().map(|p| (p[i] - [x, y][i]) * (p[j] - [x, y][j])).sum::<f64>()
        };
        let slope = if sum(0, 0) > 1e-12 { sum(0, 1) / sum(0, 0) } else { 0.0 };
        let constant = y - slope * x;
        fitted = Some([constant, slope]);
        let residual = |p: &[f64; 2]| (p[1] - constant - slope * p[0]).abs();
        let mut sizes: Vec<f64> = points.iter().map(residual).collect();
        sizes.sort_by(f64::total_cmp);
        let limit = 3.0 * 1.4826 * sizes[sizes.len() / 2] + 1e-9;
        points.retain(|p| residual(p) <= limit);
    }
    fitted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_among_points_off_it() {
        let mut points: Vec<[f64; 2]> =
            (0..40).map(|i| [0.01 * f64::from(i), 1.5 - 4.0 * 0.01 * f64::from(i)]).collect();
        points.push([0.1, 30.0]);
        points.push([0.3, -20.0]);
        let [constant, slope] = line(points).unwrap();
        assert!((constant - 1.5).abs() < 1e-6 && (slope + 4.0).abs() < 1e-6);
        assert_eq!(line(vec![[0.0, 1.0]; 3]), None);
    }
}
