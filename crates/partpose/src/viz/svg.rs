//! Plots and confusion matrices as SVG, for pages: sharp at every size, and a browser tells each point's numbers.

use std::fmt::Write;

use super::embed::html_escape;
use super::plot::{Mark, PALETTE, Plot, Ruler, Series, values};

/// Free pixels left, above, right and below.
const MARGINS: [f64; 4] = [56.0, 52.0, 16.0, 40.0];
/// Side of a cell of a matrix, pixels.
const CELL: f64 = 26.0;
/// Pixels a character of a label takes, about.
const LETTER: f64 = 6.6;
/// Most dots that are drawn large.
const FEW: usize = 60;
/// Longest label of a matrix, characters.
const LONGEST: usize = 24;

/// Draws what [`super::plot()`] draws, as an `svg` element.
///
/// Colours other than those of the series follow the page: text is `currentColor`.
pub fn svg_plot(plot: &Plot) -> String {
    let [width, height] = plot.size.map(|side| f64::from(side.clamp(160, 4096)));
    let [left, above, right, below] = MARGINS;
    let (x_end, y_end) = (width - right, height - below);
    let x = Ruler::new(&plot.x, &values(plot, 0), [left, x_end]);
    let y = Ruler::new(&plot.y, &values(plot, 1), [y_end, above]);
    let mut svg = start(&plot.title, [width, height]);
    for (at, text) in &x.ticks {
        let at = x.place(*at);
        line(&mut svg, [at, above, at, y_end], "rule");
        label(&mut svg, [at, y_end + 16.0], "middle", text);
    }
    for (at, text) in &y.ticks {
        let at = y.place(*at);
        line(&mut svg, [left, at, x_end, at], "rule");
        label(&mut svg, [left - 6.0, at + 4.0], "end", text);
    }
    for (i, series) in plot.series.iter().enumerate() {
        let [r, g, b] = series.color.unwrap_or(PALETTE[i % PALETTE.len()]);
        draw(&mut svg, series, &format!("rgb({r},{g},{b})"), [&x, &y], y_end);
    }
    label(&mut svg, [left, above - 10.0], "start", &plot.y.label);
    label(&mut svg, [x_end, height - 6.0], "end", &plot.x.label);
    legend(&mut svg, plot, x_end);
    svg + "</svg>\n"
}

fn start(title: &str, [width, height]: [f64; 2]) -> String {
    let title = html_escape(title);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" role=\"img\" aria-label=\"{title}\" font-size=\"12\">\n\
         <text x=\"8\" y=\"16\" font-weight=\"600\" fill=\"currentColor\">{title}</text>\n"
    )
}

fn line(svg: &mut String, [x1, y1, x2, y2]: [f64; 4], class: &str) {
    let _ = writeln!(
        svg,
        "<line class=\"{class}\" x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" \
         stroke=\"currentColor\" stroke-opacity=\"0.15\"/>"
    );
}

fn label(svg: &mut String, [x, y]: [f64; 2], anchor: &str, text: &str) {
    let text = html_escape(text);
    let _ = writeln!(
        svg,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"currentColor\">{text}</text>"
    );
}

fn draw(svg: &mut String, series: &Series, color: &str, [x, y]: [&Ruler; 2], floor: f64) {
    let placed: Vec<([f64; 2], &[f64; 2])> = series
        .points
        .iter()
        .filter_map(|point| Some(([x.pixel(point[0])?, y.pixel(point[1])?], point)))
        .collect();
    let told = |[x, y]: &[f64; 2]| html_escape(&format!("{} {x:.4}, {y:.4}", series.name));
    match series.mark {
        Mark::Line | Mark::Curve | Mark::Reference => {
            let points: Vec<String> =
                placed.iter().map(|([x, y], _)| format!("{x:.1},{y:.1}")).collect();
            let dashes =
                if series.mark == Mark::Reference { " stroke-dasharray=\"5 4\"" } else { "" };
            let _ = writeln!(
                svg,
                "<polyline fill=\"none\" stroke=\"{color}\" stroke-width=\"1.8\"{dashes} points=\"{}\"/>",
                points.join(" ")
            );
        }
        Mark::Dots | Mark::Bars => {}
    }
    for ([px, py], point) in &placed {
        let _ = match series.mark {
            Mark::Line => writeln!(
                svg,
                "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"3\" fill=\"{color}\"><title>{}</title></circle>",
                told(point)
            ),
            // Few dots are things that somebody wants to tell apart.
            Mark::Dots if placed.len() <= FEW => writeln!(
                svg,
                "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"4\" fill=\"{color}\"><title>{}</title></circle>",
                told(point)
            ),
            Mark::Dots => writeln!(
                svg,
                "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"1.6\" fill=\"{color}\" fill-opacity=\"0.45\"/>"
            ),
            Mark::Bars => writeln!(
                svg,
                "<rect x=\"{:.1}\" y=\"{py:.1}\" width=\"8\" height=\"{:.1}\" fill=\"{color}\"><title>{}</title></rect>",
                px - 4.0,
                (floor - py).max(0.0),
                told(point)
            ),
            Mark::Curve | Mark::Reference => Ok(()),
        };
    }
}

fn legend(svg: &mut String, plot: &Plot, x_end: f64) {
    let named: Vec<(usize, &Series)> =
        plot.series.iter().enumerate().filter(|(_, series)| !series.name.is_empty()).collect();
    let mut at = x_end;
    for (i, series) in named.iter().rev() {
        let [r, g, b] = series.color.unwrap_or(PALETTE[i % PALETTE.len()]);
        at -= LETTER * series.name.chars().count() as f64;
        label(svg, [at, 34.0], "start", &series.name);
        at -= 14.0;
        let _ = writeln!(
            svg,
            "<rect x=\"{at:.1}\" y=\"25\" width=\"10\" height=\"10\" fill=\"rgb({r},{g},{b})\"/>"
        );
        at -= 12.0;
    }
}

/// A matrix of counts as an `svg` element: a row for each true class, cells shaded by their share of the row.
///
/// `counts` holds `rows.len()` rows of `columns.len()` numbers. Cells on the diagonal, where row and column have one
/// name, are green.
pub fn svg_matrix(title: &str, rows: &[String], columns: &[String], counts: &[u64]) -> String {
    let short = |name: &String| name.chars().take(LONGEST).collect::<String>();
    let longest = |names: &[String]| {
        LETTER * names.iter().map(|name| short(name).chars().count()).max().unwrap_or(0) as f64
    };
    let (left, top) = (longest(rows) + 70.0, longest(columns) + 44.0);
    let size = [left + CELL * columns.len() as f64 + 60.0, top + CELL * rows.len() as f64 + 12.0];
    let mut svg = start(title, size);
    for (j, name) in columns.iter().enumerate() {
        let x = left + CELL * (j as f64 + 0.5) + 4.0;
        let _ = writeln!(
            svg,
            "<text transform=\"translate({x:.1},{:.1}) rotate(-90)\" fill=\"currentColor\">{}</text>",
            top - 6.0,
            html_escape(&short(name))
        );
    }
    for (i, name) in rows.iter().enumerate() {
        let of_row = &counts[i * columns.len()..(i + 1) * columns.len()];
        let sum: u64 = of_row.iter().sum();
        let y = top + CELL * i as f64;
        let text = format!("{} ({sum})", short(name));
        label(&mut svg, [left - 6.0, y + 0.65 * CELL], "end", &text);
        for (j, count) in of_row.iter().enumerate() {
            let share = *count as f64 / sum.max(1) as f64;
            let color = if columns[j] == *name { "0,158,115" } else { "213,94,0" };
            let x = left + CELL * j as f64;
            let told = html_escape(&format!("{name} called {}: {count}", columns[j]));
            let _ = writeln!(
                svg,
                "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{CELL}\" height=\"{CELL}\" \
                 fill=\"rgba({color},{share:.3})\" stroke=\"currentColor\" stroke-opacity=\"0.15\"><title>{told}</title></rect>"
            );
            if share >= 0.005 {
                let middle = [x + 0.5 * CELL, y + 0.65 * CELL];
                label(&mut svg, middle, "middle", &format!("{:.0}", 100.0 * share));
            }
        }
    }
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viz::Axis;

    #[test]
    fn a_plot_has_its_points_and_no_text_that_is_markup() {
        let points = vec![[0.0, 1.0], [5.0, 2.0], [f64::NAN, 1.0]];
        let svg = svg_plot(&Plot {
            title: "<b>&".to_owned(),
            x: Axis::new("x"),
            y: Axis::new("y"),
            series: vec![Series::new("a", Mark::Line, points)],
            ..Plot::default()
        });
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(svg.contains("&lt;b&gt;&amp;") && !svg.contains("<b>") && !svg.contains("NaN"));
    }

    #[test]
    fn a_matrix_tells_the_shares_of_its_rows() {
        let names = ["a".to_owned(), "b".to_owned()];
        let svg = svg_matrix("t", &names, &names, &[3, 1, 0, 0]);
        assert!(svg.contains(">75</text>") && svg.contains("a called b: 1"));
        assert_eq!(svg.matches("<rect").count(), 4);
    }
}
