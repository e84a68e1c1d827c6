//! The page of a report.

use std::fmt::Write;
use std::path::Path;

use partpose::eval::Table;
use partpose::files;
use partpose::viz::{html_escape, picture_uri};
use serde_json::Value;

use super::folder::Run;
use super::{gallery, paper, plots};

/// Most rows of a table that are shown.
const MOST_ROWS: usize = 500;
/// Most pictures of results without labels that are shown.
const MOST_PICTURES: usize = 6;

/// Said in place of the best, median and worst vehicles.
const NO_GALLERY: &str = "<p>Pictures of the best, median and worst vehicles stand here after <code>evaluate poses \
    --pictures N</code>, or <code>explain --out</code> into the folder <code>explain</code> of this run.</p>\n";

const STYLE: &str = "
:root { color-scheme: light dark; --ink: #20242c; --paper: #fff; --soft: #f1f3f6; --dim: #606672; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8ebf0; --paper: #16181d; --soft: #24272e; --dim: #aeb4c0; } }
body { margin: 0 auto; max-width: 1200px; padding: 24px; color: var(--ink); background: var(--paper); font: 15px/1.5 system-ui, sans-serif; }
h1 { margin: 0 0 4px; } h2 { margin: 40px 0 8px; border-bottom: 1px solid var(--soft); overflow-wrap: anywhere; } h3 { margin: 24px 0 6px; }
p { color: var(--dim); margin: 4px 0; }
.cards { display: flex; flex-wrap: wrap; gap: 10px; margin: 12px 0; }
.cards div { background: var(--soft); border-radius: 8px; padding: 8px 14px; }
.cards b { display: block; font-size: 22px; } .cards span { color: var(--dim); font-size: 13px; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; margin: 6px 0; }
th, td { padding: 2px 9px; text-align: right; white-space: nowrap; } th:first-child, td:first-child { text-align: left; }
tr:nth-child(even) td { background: var(--soft); }
svg { max-width: 100%; height: auto; }
.plots { display: flex; flex-wrap: wrap; gap: 12px; }
figure { margin: 10px 0; } figure img { max-width: 100%; border-radius: 4px; } figcaption { color: var(--dim); font-size: 13px; }
nav a { margin-right: 14px; }
";

/// The whole page; `most` vehicles stand in each row of a gallery.
pub(super) fn page(title: &str, runs: &[Run], most: usize) -> anyhow::Result<String> {
    let title = html_escape(title);
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <link rel=\"icon\" href=\"data:,\">\n<title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n\
         <h1>{title}</h1>\n<p>partpose {}</p>\n",
        env!("CARGO_PKG_VERSION")
    );
    if runs.len() > 1 {
        contents(&mut html, runs);
        table(&mut html, &comparison(runs));
    }
    let together = [
        plots::over_distance(runs),
        plots::distribution(runs),
        plots::calibration(runs),
        plots::time(runs),
    ];
    figures(&mut html, together.into_iter().flatten());
    for (index, run) in runs.iter().enumerate() {
        let _ = writeln!(html, "<h2 id=\"run-{index}\">{}</h2>", html_escape(&run.name));
        section(&mut html, run, most)?;
    }
    html.push_str("</body>\n</html>\n");
    Ok(html)
}

fn contents(html: &mut String, runs: &[Run]) {
    html.push_str("<nav>");
    for (index, run) in runs.iter().enumerate() {
        let _ = write!(html, "<a href=\"#run-{index}\">{}</a>", html_escape(&run.name));
    }
    html.push_str("</nav>\n");
}

/// Headline figures by their key in `metrics.json`, with their factor and unit.
const HEADLINES: [(&str, &str, f64, &str); 11] = [
    ("count", "vehicles", 1.0, ""),
    ("mean_iou3d", "mean 3D IoU", 100.0, " %"),
    ("median_iou3d", "median 3D IoU", 100.0, " %"),
    ("model_precision", "right model", 100.0, " %"),
    ("median_distance", "median distance error", 1.0, " m"),
    ("median_angle", "median angle error", 180.0 / std::f64::consts::PI, "°"),
    ("unfittable", "no pose", 100.0, " %"),
    ("precision", "box precision", 100.0, " %"),
    ("recall", "box recall", 100.0, " %"),
    ("ap", "COCO AP", 100.0, " %"),
    ("mpa", "mPA", 100.0, " %"),
];

fn headline(metrics: Option<&Value>, index: usize) -> Option<String> {
    let (key, _, factor, unit) = HEADLINES[index];
    let value = metrics?[key].as_f64()?;
    let digits = if key == "count" { 0 } else { 2 };
    Some(format!("{:.digits$}{unit}", factor * value))
}

/// The headlines that any run has, of the runs that have any.
fn comparison(runs: &[Run]) -> Table {
    let said = |run: &Run, i: usize| headline(run.metrics.as_ref(), i);
    let told = |i: &usize| runs.iter().any(|run| said(run, *i).is_some());
    let told: Vec<usize> = (0..HEADLINES.len()).filter(told).collect();
    let names = told.iter().map(|i| HEADLINES[*i].1);
    let columns: Vec<&str> = std::iter::once("run").chain(names).collect();
    let mut table = Table::new("", &columns);
    for run in runs {
        let figures: Vec<Option<String>> = told.iter().map(|i| said(run, *i)).collect();
        if figures.iter().any(Option::is_some) {
            let figures = figures.into_iter().map(Option::unwrap_or_default);
            table.rows.push(std::iter::once(run.name.clone()).chain(figures).collect());
        }
    }
    table
}

/// A setting in words; `None` where it says nothing.
fn setting(key: &str, value: &Value) -> Option<String> {
    let plain = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let said = match value {
        Value::Null => return None,
        Value::Array(values) => values.iter().map(plain).collect::<Vec<_>>().join(", "),
        other => plain(other),
    };
    (!said.is_empty()).then(|| format!("{}: {said}", key.replace('_', " ")))
}

fn section(html: &mut String, run: &Run, most: usize) -> anyhow::Result<()> {
    html.push_str("<div class=\"cards\">");
    for (index, (_, name, ..)) in HEADLINES.iter().enumerate() {
        if let Some(value) = headline(run.metrics.as_ref(), index) {
            let _ = write!(html, "<div><b>{value}</b><span>{name}</span></div>");
        }
    }
    html.push_str("</div>\n");
    if let Some(settings) = run.metrics.as_ref().and_then(|metrics| metrics["settings"].as_object())
    {
        let said: Vec<String> = settings.iter().filter_map(|(k, v)| setting(k, v)).collect();
        let _ = writeln!(html, "<p>{}</p>", html_escape(&said.join(" · ")));
    }
    if let Some(beside) = run.metrics.as_ref().and_then(paper::beside) {
        table(html, &beside);
    }
    let confusions = [plots::confusion(run), plots::part_confusion(run), plots::precision(run)];
    figures(html, confusions.into_iter().flatten());
    if !run.results.is_empty() {
        let vehicles: usize = run.results.iter().map(|image| image.vehicles.len()).sum();
        let _ = writeln!(html, "<p>{vehicles} poses in {} images</p>", run.results.len());
        figures(html, plots::distances(run).into_iter());
    }
    for curve in &run.curves {
        figures(html, plots::curves(curve).into_iter());
    }
    vehicles(html, run, most)?;
    for one in &run.tables {
        table(html, one);
    }
    Ok(())
}

/// The gallery of an evaluation; without a list of vehicles, or without their pictures, some pictures of the folder.
fn vehicles(html: &mut String, run: &Run, most: usize) -> anyhow::Result<()> {
    let rows = gallery::rows(run, most);
    for row in &rows {
        let _ = writeln!(html, "<h3>{} vehicles with a picture</h3>", row.title);
        for (vehicle, path) in &row.vehicles {
            let outcome = match (&vehicle.iou, &vehicle.predicted) {
                (Some(iou), Some(predicted)) => format!("taken for {predicted}, 3D IoU {iou:.3}"),
                _ => format!("no pose: {}", vehicle.no_pose),
            };
            let said =
                format!("{} at {:.1} m: {} {outcome}", vehicle.frame, vehicle.depth, vehicle.model);
            picture(html, path, &said)?;
        }
    }
    if rows.is_empty() && most > 0 && !run.vehicles.is_empty() {
        html.push_str(NO_GALLERY);
    }
    if rows.is_empty() && most > 0 {
        for path in run.pictures.iter().take(MOST_PICTURES) {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            picture(html, path, &name)?;
        }
    }
    Ok(())
}

fn picture(html: &mut String, path: &Path, said: &str) -> anyhow::Result<()> {
    let Some(uri) = picture_uri(&files::read(path)?) else {
        anyhow::bail!("`{}` is not a PNG image", path.display());
    };
    let said = html_escape(said);
    let _ = writeln!(
        html,
        "<figure><img src=\"{uri}\" alt=\"{said}\"><figcaption>{said}</figcaption></figure>"
    );
    Ok(())
}

fn figures(html: &mut String, plots: impl Iterator<Item = String>) {
    let plots: Vec<String> = plots.collect();
    if !plots.is_empty() {
        let _ = writeln!(html, "<div class=\"plots\">{}</div>", plots.join("\n"));
    }
}

fn table(html: &mut String, table: &Table) {
    if !table.title.is_empty() {
        let _ = writeln!(html, "<h3>{}</h3>", html_escape(&table.title));
    }
    let cells = |row: &[String], kind: &str| {
        let cell = |cell: &String| format!("<{kind}>{}</{kind}>", html_escape(cell));
        format!("<tr>{}</tr>\n", row.iter().map(cell).collect::<String>())
    };
    let _ = write!(html, "<div class=\"wide\"><table>\n{}", cells(&table.columns, "th"));
    for row in table.rows.iter().take(MOST_ROWS) {
        html.push_str(&cells(row, "td"));
    }
    html.push_str("</table></div>\n");
    if table.rows.len() > MOST_ROWS {
        let _ = writeln!(html, "<p>and {} rows more</p>", table.rows.len() - MOST_ROWS);
    }
}
