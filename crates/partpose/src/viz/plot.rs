//! Plots: series of points over two axes.
//!
//! Few marks and one look, so that plots of different commands can be laid side by side. Ticks stand at 1, 2 or 5 times
//! a power of ten (Heckbert, "Nice numbers for graph labels", Graphics Gems, 1990); the label of the upward axis lies
//! flat above it, where it can be read. What is not finite, or not positive on a logarithmic axis, is left out.

use crate::files::RgbImage;
use crate::geometry::{Point2, Rect};

use super::canvas::{Canvas, Pen, TextStyle, text_size};

/// What to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// Stands above.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// Drawn in this order.
    pub series: Vec<Series>,
    /// Width and height in pixels.
    pub size: [u32; 2],
}

/// One axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    /// What it measures, with its unit.
    pub label: String,
    /// Ends of the axis; those of the data if not given.
    pub range: Option<[f64; 2]>,
    /// Whether equal factors, not equal differences, lie equally far apart.
    pub logarithmic: bool,
    /// What stands at 1, 2 and so on, in place of numbers.
    pub names: Vec<String>,
}

/// Points that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// In the legend; none if empty.
    pub name: String,
    /// How they are drawn.
    pub mark: Mark,
    /// One of the palette, by position, if not given.
    pub color: Option<[u8; 3]>,
    /// Pairs of x and y.
    pub points: Vec<[f64; 2]>,
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A line through the points, with a dot on each.
    Line,
    /// A line without dots, for dense data.
    Curve,
    /// A dashed line, for what is expected.
    Reference,
    /// Dots alone; larger ones over named cases.
    Dots,
    /// Upright bars from the lower end of the axis.
    Bars,
}

/// Colours that stay apart for most colour-blind readers (Okabe and Ito, 2008), yellow left out.
pub(super) const PALETTE: [[u8; 3]; 7] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [86, 180, 233],
    [230, 159, 0],
    [60, 60, 60],
];
const PAPER: [u8; 3] = [255, 255, 255];
const INK: [u8; 3] = [32, 36, 44];
const FAINT: [u8; 3] = [96, 102, 112];
const RULE: [u8; 4] = [224, 227, 232, 255];
const FRAME: [u8; 4] = [150, 155, 163, 255];
/// Free pixels left, above, right and below.
const MARGINS: [f64; 4] = [62.0, 56.0, 22.0, 46.0];
/// Pixels between ticks along the horizontal axis, about; upwards they may stand closer.
const TICK_DISTANCE: f64 = 72.0;
/// Rows of a line of the legend.
const LINE: i32 = 14;

impl Default for Plot {
    fn default() -> Self {
        let [x, y] = [Axis::default(), Axis::default()];
        Self { title: String::new(), x, y, series: Vec::new(), size: [640, 420] }
    }
}

impl Axis {
    /// An axis over the range of its data.
    pub fn new(label: &str) -> Self {
        Self { label: label.to_owned(), ..Self::default() }
    }

    /// An axis with given ends.
    pub fn over(label: &str, range: [f64; 2]) -> Self {
        Self { label: label.to_owned(), range: Some(range), ..Self::default() }
    }

    /// An axis of cases, the first at 1.
    pub fn of_names(names: &[&str]) -> Self {
        let range = Some([0.5, names.len() as f64 + 0.5]);
        let names = names.iter().map(|name| (*name).to_owned()).collect();
        Self { range, names, ..Self::default() }
    }
}

impl Series {
    /// Points with a name.
    pub fn new(name: &str, mark: Mark, points: Vec<[f64; 2]>) -> Self {
        Self { name: name.to_owned(), mark, color: None, points }
    }
}

/// Draws a plot.
pub fn plot(plot: &Plot) -> RgbImage {
    let size = plot.size.map(|side| side.clamp(160, 4096));
    let mut canvas = Canvas::new(size, PAPER);
    let [left, above, right, below] = MARGINS;
    let area = Rect::new(left, above, f64::from(size[0]) - right, f64::from(size[1]) - below);
    let x = Ruler::new(&plot.x, &values(plot, 0), [area.x_min, area.x_max]);
    let y = Ruler::new(&plot.y, &values(plot, 1), [area.y_max, area.y_min]);
    axes(&mut canvas, &area, [&x, &y]);
    for (i, series) in plot.series.iter().enumerate() {
        let color = series.color.unwrap_or(PALETTE[i % PALETTE.len()]);
        let dots = if plot.x.names.is_empty() { 2.0 } else { 4.0 };
        draw(&mut canvas, series, (color, dots), [&x, &y]);
    }
    canvas.rectangle(&area, Pen { color: FRAME, width: 1.0 });
    legend(&mut canvas, plot, &area);
    canvas.text([12, 10], &plot.title, TextStyle::plain(INK));
    canvas.text([12, 34], &plot.y.label, TextStyle::plain(FAINT));
    let [width, _] = text_size(&plot.x.label, 1);
    let at = [area.x_max as i32 - width, size[1] as i32 - 16];
    canvas.text(at, &plot.x.label, TextStyle::plain(FAINT));
    canvas.into_rgb()
}

/// Pictures of one size side by side, row by row.
pub fn panels(pictures: &[RgbImage], columns: usize) -> RgbImage {
    let columns = columns.clamp(1, pictures.len().max(1));
    let side = |i: usize| pictures.iter().map(|picture| picture.size[i]).max().unwrap_or(1);
    let [width, height] = [side(0), side(1)];
    let rows = pictures.len().div_ceil(columns);
    let mut canvas = Canvas::new([width * columns as u32, height * rows as u32], PAPER);
    for (i, picture) in pictures.iter().enumerate() {
        let [column, row] = [i % columns, i / columns];
        canvas.paste(picture, [column as i32 * width as i32, row as i32 * height as i32]);
    }
    canvas.into_rgb()
}

/// All coordinates of one axis.
pub(super) fn values(plot: &Plot, axis: usize) -> Vec<f64> {
    plot.series.iter().flat_map(|series| series.points.iter().map(|point| point[axis])).collect()
}

/// From values to pixels.
pub(super) struct Ruler {
    /// Ends, after the logarithm if there is one.
    ends: [f64; 2],
    pixels: [f64; 2],
    logarithmic: bool,
    pub(super) ticks: Vec<(f64, String)>,
}

impl Ruler {
    pub(super) fn new(axis: &Axis, values: &[f64], pixels: [f64; 2]) -> Self {
        let map = |value: f64| if axis.logarithmic { value.log10() } else { value };
        let known = axis.range.map_or_else(|| values.to_vec(), |range| range.to_vec());
        let known = known.into_iter().map(map).filter(|value| value.is_finite());
        let (low, high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        let (mut low, mut high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        if high - low < 1e-12 * (1.0 + high.abs()) {
            (low, high) = (low - 0.5, high + 0.5);
        }
        let upwards = pixels[1] < pixels[0];
        let distance = if upwards { 0.6 * TICK_DISTANCE } else { TICK_DISTANCE };
        let count = ((pixels[1] - pixels[0]).abs() / distance).max(2.0);
        let step = nice((high - low) / count).max(if axis.logarithmic { 1.0 } else { 0.0 });
        if axis.range.is_none() {
            (low, high) = ((low / step).floor() * step, (high / step).ceil() * step);
        }
        let first = (low / step - 1e-9).ceil() as i64;
        let last = (high / step + 1e-9).floor() as i64;
        let tick = |i: i64| {
            let at = i as f64 * step;
            (at, if axis.logarithmic { number(10f64.powf(at), 0.0) } else { number(at, step) })
        };
        let ticks = if axis.names.is_empty() {
            (first..=last.min(first + 100)).map(tick).collect()
        } else {
            let places = (1u32..).map(f64::from);
            places.zip(axis.names.iter().cloned()).collect()
        };
        Self { ends: [low, high], pixels, logarithmic: axis.logarithmic, ticks }
    }

    pub(super) fn place(&self, mapped: f64) -> f64 {
        let share = (mapped - self.ends[0]) / (self.ends[1] - self.ends[0]);
        self.pixels[0] + share * (self.pixels[1] - self.pixels[0])
    }

    /// Where a value lies; values a little outside end up on the border.
    pub(super) fn pixel(&self, value: f64) -> Option<f64> {
        let mapped = if self.logarithmic { value.log10() } else { value };
        let [low, high] = self.ends;
        let slack = high - low;
        (mapped.is_finite() && mapped >= low - slack && mapped <= high + slack)
            .then(|| self.place(mapped.clamp(low, high)))
    }
}

/// The nearest 1, 2 or 5 times a power of ten that is no smaller.
fn nice(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| value <= factor * power * (1.0 + 1e-9));
    factor.unwrap_or(10.0) * power
}

/// As many digits as steps of this size need.
fn number(value: f64, step: f64) -> String {
    if value != 0.0 && (value.abs() >= 1e6 || value.abs() < 1e-4) {
        return format!("{value:.0e}");
    }
    if step == 0.0 {
        return format!("{value}");
    }
    let digits = (-step.log10() - 1e-9).ceil().max(0.0) as usize;
    // No minus before zero.
    format!("{:.digits$}", value + 0.0)
}

fn axes(canvas: &mut Canvas, area: &Rect, [x, y]: [&Ruler; 2]) {
    let pen = Pen { color: RULE, width: 1.0 };
    for (at, text) in &x.ticks {
        let at = x.place(*at).round();
        canvas.line(&Point2::new(at, area.y_min), &Point2::new(at, area.y_max), pen);
        let [width, _] = text_size(text, 1);
        let corner = [at as i32 - width / 2, area.y_max as i32 + 8];
        canvas.text(corner, text, TextStyle::plain(FAINT));
    }
    for (at, text) in &y.ticks {
        let at = y.place(*at).round();
        canvas.line(&Point2::new(area.x_min, at), &Point2::new(area.x_max, at), pen);
        let [width, _] = text_size(text, 1);
        let corner = [area.x_min as i32 - width - 8, at as i32 - 3];
        canvas.text(corner, text, TextStyle::plain(FAINT));
    }
}

fn draw(
    canvas: &mut Canvas,
    series: &Series,
    ([r, g, b], dots): ([u8; 3], f32),
    [x, y]: [&Ruler; 2],
) {
    let place = |point: &[f64; 2]| Some(Point2::new(x.pixel(point[0])?, y.pixel(point[1])?));
    let points: Vec<Option<Point2>> = series.points.iter().map(place).collect();
    let pen = Pen { color: [r, g, b, 255], width: 1.6 };
    for pair in points.windows(2) {
        let [Some(from), Some(to)] = [pair[0], pair[1]] else { continue };
        match series.mark {
            Mark::Line | Mark::Curve => canvas.line(&from, &to, pen),
            Mark::Reference => dashed(canvas, &from, &to, pen),
            Mark::Dots | Mark::Bars => {}
        }
    }
    let radius = match series.mark {
        Mark::Line => 3.0,
        Mark::Dots => dots,
        Mark::Curve | Mark::Reference | Mark::Bars => 0.0,
    };
    let gap = points.windows(2).filter_map(|pair| Some((pair[1]?.x - pair[0]?.x).abs()));
    let half_bar = 0.38 * gap.fold(60.0, f64::min);
    for point in points.iter().flatten() {
        if radius > 0.0 {
            canvas.disc(point, radius, [r, g, b, 220]);
        } else if series.mark == Mark::Bars {
            let bar = Rect::new(point.x - half_bar, point.y, point.x + half_bar, y.pixels[0]);
            canvas.fill_rectangle(&bar, [r, g, b, 220]);
        }
    }
}

fn dashed(canvas: &mut Canvas, from: &Point2, to: &Point2, pen: Pen) {
    let length = (to - from).norm();
    let dashes = (length / 9.0).ceil() as usize;
    for i in 0..dashes {
        let at = |share: f64| from + (to - from) * (share / dashes as f64).min(1.0);
        canvas.line(&at(i as f64), &at(i as f64 + 0.55), Pen { width: 1.0, ..pen });
    }
}

/// In the corner of the area where the fewest points lie.
fn legend(canvas: &mut Canvas, plot: &Plot, area: &Rect) {
    let named: Vec<(usize, &Series)> =
        plot.series.iter().enumerate().filter(|(_, series)| !series.name.is_empty()).collect();
    let Some(widest) = named.iter().map(|(_, s)| text_size(&s.name, 1)[0]).max() else { return };
    let [width, height] = [f64::from(widest) + 34.0, f64::from(LINE * named.len() as i32) + 8.0];
    let x = Ruler::new(&plot.x, &values(plot, 0), [area.x_min, area.x_max]);
    let y = Ruler::new(&plot.y, &values(plot, 1), [area.y_max, area.y_min]);
    let corners = [
        [area.x_max - width - 6.0, area.y_min + 6.0],
        [area.x_min + 6.0, area.y_min + 6.0],
        [area.x_max - width - 6.0, area.y_max - height - 6.0],
        [area.x_min + 6.0, area.y_max - height - 6.0],
    ];
    let covered = |[left, top]: &[f64; 2]| {
        let inside = |point: &&[f64; 2]| {
            let (Some(px), Some(py)) = (x.pixel(point[0]), y.pixel(point[1])) else { return false };
            (*left..left + width).contains(&px) && (*top..top + height).contains(&py)
        };
        plot.series.iter().flat_map(|series| &series.points).filter(inside).count()
    };
    let [left, top] =
        corners.into_iter().min_by_key(|corner| covered(corner)).expect("there are four");
    canvas.fill_rectangle(&Rect::new(left, top, left + width, top + height), [255, 255, 255, 225]);
    for (row, (i, series)) in named.iter().enumerate() {
        let [r, g, b] = series.color.unwrap_or(PALETTE[i % PALETTE.len()]);
        let middle = top + 4.0 + f64::from(LINE) * (row as f64 + 0.5);
        let [from, to] = [Point2::new(left + 5.0, middle), Point2::new(left + 21.0, middle)];
        let pen = Pen { color: [r, g, b, 255], width: 1.6 };
        match series.mark {
            Mark::Reference => dashed(canvas, &from, &to, pen),
            Mark::Dots | Mark::Bars => {
                canvas.disc(&Point2::new(left + 13.0, middle), 3.0, [r, g, b, 255]);
            }
            Mark::Line | Mark::Curve => canvas.line(&from, &to, pen),
        }
        let at = [(left + 28.0) as i32, middle as i32 - 4];
        canvas.text(at, &series.name, TextStyle::plain(INK));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_one_two_or_five_times_a_power_of_ten() {
        for (value, step) in [(0.7, 1.0), (1.0, 1.0), (1.3, 2.0), (3.0, 5.0), (0.06, 0.1)] {
            assert!((nice(value) - step).abs() < 1e-12, "{value}");
        }
        assert_eq!(number(-0.0, 0.2), "0.0");
        assert_eq!(number(12.0, 5.0), "12");
        assert_eq!(number(0.25, 0.05), "0.25");
    }

    #[test]
    fn ticks_of_a_logarithmic_axis_are_powers_of_ten() {
        let axis = Axis { logarithmic: true, ..Axis::new("time") };
        let ruler = Ruler::new(&axis, &[0.3, 40.0, -1.0, 0.0], [0.0, 400.0]);
        let texts: Vec<&str> = ruler.ticks.iter().map(|(_, text)| text.as_str()).collect();
        assert_eq!(texts, ["0.1", "1", "10", "100"]);
        assert_eq!(ruler.pixel(0.0), None);
        assert!((ruler.pixel(1.0).unwrap() - 400.0 / 3.0).abs() < 1e-9);
    }

    #[test]
    fn a_plot_without_points_or_with_strange_ones_is_drawn() {
        for points in [vec![], vec![[f64::NAN, 1.0], [f64::INFINITY, -1e300]], vec![[2.0, 2.0]]] {
            for mark in [Mark::Line, Mark::Curve, Mark::Reference, Mark::Dots, Mark::Bars] {
                let series = vec![Series::new("a", mark, points.clone())];
                let image = plot(&Plot { series, ..Plot::default() });
                assert_eq!(image.size, [640, 420]);
            }
        }
    }
}
