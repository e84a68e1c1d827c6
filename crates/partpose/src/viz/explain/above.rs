//! A vehicle from above: estimate, what else it could be, and the ellipse that holds the truth with 95 %.

use nalgebra::{Matrix2, SymmetricEigen};

use crate::files::RgbImage;
use crate::geometry::{Cuboid, Point2, Point3};
use crate::pose::PoseEstimate;
use crate::pose::dense::SecondMode;
use crate::viz::canvas::{Canvas, Pen, TextStyle};
use crate::viz::scene::palette;

use super::Explanation;
use super::words::NEGLIGIBLE;

/// Squared radius of the ellipse in two dimensions that holds 95 % (chi-square).
const RADIUS: f64 = 5.991;
/// Colour of the second mode, and of the ellipse.
const SECOND: [u8; 3] = [255, 150, 60];
const ELLIPSE: [u8; 3] = [90, 200, 255];
/// Metres that are shown at least and at most, across.
const SPAN: [f64; 2] = [9.0, 60.0];

/// Characters that fit under the picture.
const CHARACTERS: usize = 49;

/// What the picture shows, in which colours.
pub(super) fn caption(explanation: &Explanation) -> String {
    let Ok(estimate) = explanation.outcome else { return "no pose".to_owned() };
    let drawn = [
        (true, "fit white"),
        (explanation.truth.is_some(), "truth green"),
        (spread(estimate).is_some(), "95 % blue"),
        (second(estimate).is_some(), "second orange"),
    ];
    let drawn: Vec<&str> =
        drawn.iter().filter(|(drawn, _)| *drawn).map(|(_, what)| *what).collect();
    let colours = drawn.join(", ");
    let whole = format!("from above: {colours}");
    if whole.len() > CHARACTERS { colours } else { whole }
}

/// The second mode, where it is drawn.
fn second(estimate: &PoseEstimate) -> Option<SecondMode> {
    let second = estimate.dense.as_ref().and_then(|report| report.second_mode);
    second.filter(|second| second.probability >= NEGLIGIBLE)
}

/// Covariance of the centre's place across and ahead, square metres; `None` where none is stated.
fn spread(estimate: &PoseEstimate) -> Option<Matrix2<f64>> {
    let c = &estimate.dense.as_ref()?.covariance;
    let spread = Matrix2::new(c[(3, 3)], c[(3, 5)], c[(5, 3)], c[(5, 5)]);
    Some(spread).filter(|spread| spread.iter().all(|value| value.is_finite()))
}

/// From metres to pixels: the vehicle's surroundings, the camera below.
struct Map {
    center: Point2,
    middle: Point2,
    scale: f64,
}

impl Map {
    fn at(&self, x: f64, z: f64) -> Point2 {
        Point2::new(
            self.center.x + (x - self.middle.x) * self.scale,
            self.center.y - (z - self.middle.y) * self.scale,
        )
    }

    /// The ground face: rear left, rear right, front right, front left.
    fn footprint(&self, cuboid: &Cuboid) -> [Point2; 4] {
        let corners = cuboid.corners();
        [0, 1, 5, 4].map(|i| self.at(corners[i].x, corners[i].z))
    }
}

pub(super) fn picture(explanation: &Explanation, size: [i32; 2]) -> RgbImage {
    let mut canvas = Canvas::new(size.map(|side| side as u32), palette::GROUND);
    let Ok(estimate) = explanation.outcome else { return canvas.into_rgb() };
    let cuboid = estimate.cuboid();
    let center = cuboid.center();
    let spread = spread(estimate);
    let reach = spread.map_or(0.0, |s| (RADIUS * s[(0, 0)].max(s[(1, 1)])).sqrt());
    let away = explanation.truth.map_or(0.0, |truth| (truth.center() - center).norm());
    let span = (2.4 * reach.max(away) + 1.6 * cuboid.extent.length).clamp(SPAN[0], SPAN[1]);
    let [width, height] = size.map(f64::from);
    let map = Map {
        center: Point2::new(0.5 * width, 0.5 * height),
        middle: Point2::new(center.x, center.z),
        scale: height / span,
    };
    grid(&mut canvas, &map, [width, height]);
    let pen = |color: [u8; 3], width| Pen { color: palette::with_opacity(color, 230), width };
    // The line of sight: along it the distance is unsure.
    canvas.line(&map.at(0.0, 0.0), &map.at(center.x, center.z), pen([70, 76, 88], 1.0));
    canvas.fill(&map.footprint(&cuboid), palette::with_opacity(palette::PREDICTED, 90));
    heading(&mut canvas, &map, &cuboid, pen(palette::PREDICTED, 1.4));
    if let Some(second) = second(estimate) {
        let extent = second.extent;
        let other = Cuboid { camera_from_vehicle: second.camera_from_vehicle, extent };
        canvas.outline(&map.footprint(&other), pen(SECOND, 1.2));
        heading(&mut canvas, &map, &other, pen(SECOND, 1.2));
    }
    if let Some(truth) = &explanation.truth {
        canvas.outline(&map.footprint(truth), pen(palette::TRUTH, 1.4));
        heading(&mut canvas, &map, truth, pen(palette::TRUTH, 1.4));
    }
    if let Some(spread) = &spread {
        canvas.outline(&ellipse(&map, &center, spread), pen(ELLIPSE, 1.6));
    }
    canvas.into_rgb()
}

/// Lines a metre apart, or five where they would be too many.
fn grid(canvas: &mut Canvas, map: &Map, [width, height]: [f64; 2]) {
    let step = if map.scale > 9.0 { 1.0 } else { 5.0 };
    let pen = Pen { color: [38, 42, 50, 255], width: 1.0 };
    let [across, ahead] = [0.5 * width / map.scale, 0.5 * height / map.scale];
    let lines = |from: f64, to: f64| {
        ((from / step).ceil() as i32..=(to / step).floor() as i32).map(move |i| f64::from(i) * step)
    };
    for x in lines(map.middle.x - across, map.middle.x + across) {
        let at = map.at(x, 0.0).x.round();
        canvas.line(&Point2::new(at, 0.0), &Point2::new(at, height), pen);
    }
    for z in lines(map.middle.y - ahead, map.middle.y + ahead) {
        let at = map.at(0.0, z).y.round();
        canvas.line(&Point2::new(0.0, at), &Point2::new(width, at), pen);
        if (z / step) as i32 % 2 == 0 {
            let style = TextStyle::plain([92, 98, 110]);
            canvas.text([4, at as i32 - 10], &format!("{z:.0} m"), style);
        }
    }
}

/// An arrow from the middle to beyond the front.
fn heading(canvas: &mut Canvas, map: &Map, cuboid: &Cuboid, pen: Pen) {
    let length = cuboid.extent.length;
    let at = |x: f64, z: f64| {
        let point = cuboid.camera_from_vehicle * Point3::new(x, 0.0, z);
        map.at(point.x, point.z)
    };
    let tip = at(0.0, 0.5 * length + 0.7);
    canvas.line(&at(0.0, 0.25 * length), &tip, pen);
    for side in [-0.4, 0.4] {
        canvas.line(&at(side, 0.5 * length + 0.15), &tip, pen);
    }
}

fn ellipse(map: &Map, center: &Point3, spread: &Matrix2<f64>) -> Vec<Point2> {
    let parts = SymmetricEigen::new(*spread);
    let radius = parts.eigenvalues.map(|value| (RADIUS * value.max(0.0)).sqrt());
    (0..72)
        .map(|i| {
            let angle = f64::from(i) / 72.0 * std::f64::consts::TAU;
            let offset = parts.eigenvectors
                * nalgebra::Vector2::new(radius.x * angle.cos(), radius.y * angle.sin());
            map.at(center.x + offset.x, center.z + offset.y)
        })
        .collect()
}
