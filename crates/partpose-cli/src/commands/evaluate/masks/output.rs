//! Tables, metrics and the confusion of the parts, as files.

use std::collections::BTreeMap;

use clap::ValueEnum;
use partpose::dataset::Frame;
use partpose::eval::Table;
use partpose::eval::kernel_size::{kernel_bounds, share_within};
use partpose::eval::masks::{Confusion, MaskScore, MaskScores, summarize_masks};
use partpose::files;
use partpose::parts::{BACKGROUND, PartClass};
use partpose::viz::{ConfusionClass, confusion_picture};
use serde_json::{Value, json};

use super::{Arguments, Row, SCALINGS, counted_boxes};
use crate::commands::evaluate::scores::{percent, write_tables};

/// Kernels of the paper.
const PAPER_KERNELS: [usize; 4] = [14, 28, 42, 56];

/// Prints the tables and writes everything but Fig. 4.
pub(super) fn write(
    arguments: &Arguments,
    frames: &[Frame],
    rows: &[Row],
    skipped: usize,
) -> anyhow::Result<()> {
    let groups = by_variation(frames, &rows[0]);
    let mut tables = vec![table_two(rows)];
    if groups.len() > 1 {
        tables.push(variation_table(&rows[0].name, &groups));
    }
    tables.push(class_table(&rows[0].name, &rows[0].confusion[0]));
    let (sizes, metrics_of_sizes) = size_table(frames);
    tables.push(sizes);
    let metrics = metrics(arguments, rows, &groups, (metrics_of_sizes, skipped));
    write_tables(&arguments.out, &metrics, &tables)?;
    let confusion = &rows[0].confusion[0];
    let classes = classes();
    let title =
        format!("{}: rows are the truth, columns the detections, % of the row", rows[0].name);
    let picture = confusion_picture(&title, &classes, &confusion.counts);
    files::write_png(&arguments.out.join("confusion.png"), &picture)?;
    let table = confusion_table(&classes, confusion);
    files::write(&arguments.out.join("confusion.csv"), table.to_csv().as_bytes())?;
    Ok(())
}

fn summary(row: &Row, scaling: usize) -> MaskScores {
    let scores: Vec<MaskScore> = row.masks.iter().map(|mask| mask.scores[scaling]).collect();
    summarize_masks(&scores)
}

fn table_two(rows: &[Row]) -> Table {
    let columns = [
        "kernels",
        "assigned",
        "bilinear",
        "nearest",
        "foreground, bilinear",
        "foreground, nearest",
        "silhouette IoU, bilinear",
        "mean over classes, bilinear",
    ];
    let title = "Table II: mPA, %. Foreground: of the pixels that show the vehicle. Perfect kernels say what a size of \
                 kernel allows at best";
    let mut table = Table::new(title, &columns);
    for row in rows {
        let [bilinear, nearest] = [0, 1].map(|scaling| summary(row, scaling));
        let shares = [
            bilinear.mpa,
            nearest.mpa,
            bilinear.mean_foreground_accuracy,
            nearest.mean_foreground_accuracy,
            bilinear.mean_silhouette_iou,
        ];
        let mut cells = vec![row.name.clone(), row.masks.len().to_string()];
        cells.extend(shares.map(two));
        cells.push(row.confusion[0].mean_class_accuracy().map_or("-".to_owned(), two));
        table.rows.push(cells);
    }
    table
}

/// A share in percent with the paper's digits.
fn two(share: f64) -> String {
    if share.is_nan() { "-".to_owned() } else { format!("{:.2}", 100.0 * share) }
}

/// Scores of the first row under both scalings by variation.
fn by_variation(frames: &[Frame], row: &Row) -> Vec<(String, [MaskScores; 2])> {
    let mut groups: BTreeMap<&str, [Vec<MaskScore>; 2]> = BTreeMap::new();
    for mask in &row.masks {
        let group = groups.entry(&frames[mask.frame].sequence.variation).or_default();
        for (group, score) in group.iter_mut().zip(mask.scores) {
            group.push(score);
        }
    }
    groups
        .into_iter()
        .map(|(name, scores)| (name.to_owned(), scores.map(|scores| summarize_masks(&scores))))
        .collect()
}

fn variation_table(name: &str, groups: &[(String, [MaskScores; 2])]) -> Table {
    let columns = ["variation", "assigned", "bilinear", "nearest"];
    let mut table = Table::new(&format!("mPA by variation, %: {name}"), &columns);
    for (variation, [bilinear, nearest]) in groups {
        let count = bilinear.count.to_string();
        table.rows.push(vec![variation.clone(), count, two(bilinear.mpa), two(nearest.mpa)]);
    }
    table
}

fn class_table(name: &str, confusion: &Confusion) -> Table {
    let columns = ["part", "pixels", "accuracy", "precision", "IoU", "most often called"];
    let mut table = Table::new(&format!("By class, bilinear, %: {name}"), &columns);
    let classes = classes();
    for score in confusion.classes() {
        let index = usize::from(score.class);
        let row = &confusion.counts[index * classes.len()..(index + 1) * classes.len()];
        let others = row.iter().enumerate().filter(|(other, _)| *other != index);
        let most = others.max_by_key(|(other, count)| (**count, std::cmp::Reverse(*other)));
        let called = match most {
            Some((other, count)) if *count > 0 => {
                let share = *count as f64 / score.pixels.max(1) as f64;
                format!("{} ({:.1})", classes[other].name, 100.0 * share)
            }
            _ => "-".to_owned(),
        };
        let shares = [score.accuracy, score.precision, score.iou].map(percent);
        let mut cells = vec![classes[index].name.clone(), score.pixels.to_string()];
        cells.extend(shares);
        cells.push(called);
        table.rows.push(cells);
    }
    table
}

/// The kernel that the vehicles' sizes imply, as table and as JSON.
fn size_table(frames: &[Frame]) -> (Table, Value) {
    let boxes = counted_boxes(frames);
    let bounds = kernel_bounds(&boxes);
    let title = "Lower bound of the kernel size. With nearest scaling a boundary between parts lies wrong by up to half a \
                 cell, and a cell is the box's side over m: cells of c pixels need m = longer side / c";
    let columns = [
        "share of the vehicles, %",
        "longer side up to, px",
        "m for cells of 1 px",
        "of 2 px",
        "of 4 px",
    ];
    let mut table = Table::new(title, &columns);
    for bound in &bounds {
        let mut cells = vec![format!("{:.0}", 100.0 * bound.share), format!("{:.0}", bound.side)];
        cells.extend(bound.cells.map(|m| m.to_string()));
        table.rows.push(cells);
    }
    let shares = PAPER_KERNELS.map(|m| {
        let shares = [1.0, 2.0, 4.0].map(|pixels| share_within(&boxes, m, pixels));
        let mut cells =
            vec![format!("with m = {m}: % of the vehicles with such cells"), String::new()];
        cells.extend(shares.map(|share| format!("{:.1} %", 100.0 * share)));
        table.rows.push(cells);
        json!({ "kernel": m, "share_with_cells_within_1_2_4_px": shares })
    });
    (table, json!({ "bounds": bounds, "kernels": shares }))
}

fn classes() -> Vec<ConfusionClass> {
    let part = |id: u8| PartClass::from_id(id);
    (BACKGROUND..=PartClass::COUNT as u8)
        .map(|id| ConfusionClass {
            name: part(id).map_or("background", PartClass::name).to_owned(),
            color: part(id).map_or([0; 3], PartClass::color),
        })
        .collect()
}

fn confusion_table(classes: &[ConfusionClass], confusion: &Confusion) -> Table {
    let mut columns = vec!["truth"];
    columns.extend(classes.iter().map(|class| class.name.as_str()));
    let mut table = Table::new("confusion", &columns);
    for (class, counts) in classes.iter().zip(confusion.counts.chunks_exact(classes.len())) {
        let mut cells = vec![class.name.clone()];
        cells.extend(counts.iter().map(u64::to_string));
        table.rows.push(cells);
    }
    table
}

/// The first row's figures under bilinear scaling stand at the top.
fn metrics(
    arguments: &Arguments,
    rows: &[Row],
    groups: &[(String, [MaskScores; 2])],
    (sizes, skipped): (Value, usize),
) -> Value {
    let row = |row: &Row| {
        let scaled: serde_json::Map<String, Value> = SCALINGS
            .iter()
            .enumerate()
            .map(|(index, (_, name))| {
                let confusion = &row.confusion[index];
                let mut scores = json!(summary(row, index));
                if let Some(object) = scores.as_object_mut() {
                    let more = [
                        ("pixel_accuracy_of_all_pixels", confusion.accuracy()),
                        ("mean_class_accuracy", confusion.mean_class_accuracy()),
                        ("mean_class_iou", confusion.mean_class_iou()),
                    ];
                    object.extend(more.map(|(name, value)| (name.to_owned(), json!(value))));
                }
                ((*name).to_owned(), scores)
            })
            .collect();
        json!({ "name": row.name, "scalings": scaled })
    };
    let mut metrics = json!(summary(&rows[0], 0));
    if let Some(object) = metrics.as_object_mut() {
        let class = |score: &partpose::eval::masks::ClassScore| {
            let name = PartClass::from_id(score.class).map_or("background", PartClass::name);
            json!({ "name": name, "scores": score })
        };
        let group = |(name, [bilinear, nearest]): &(String, [MaskScores; 2])| json!({ "variation": name, "bilinear": bilinear, "nearest": nearest });
        let selection = &arguments.selection;
        let bounds = arguments.bounds.to_possible_value();
        let classes = rows[0].confusion[0].classes();
        object.insert("name".to_owned(), json!(rows[0].name));
        object.insert("mpa_nearest".to_owned(), json!(summary(&rows[0], 1).mpa));
        object.insert("rows".to_owned(), rows.iter().map(row).collect());
        object.insert("classes".to_owned(), classes.iter().map(class).collect());
        object.insert("by_variation".to_owned(), groups.iter().map(group).collect());
        object.insert("kernel_size".to_owned(), sizes);
        object.insert("skipped_frames".to_owned(), json!(skipped));
        object.insert(
            "settings".to_owned(),
            json!({
                "version": env!("CARGO_PKG_VERSION"),
                "dataset": selection.dataset.display().to_string(),
                "worlds": selection.worlds,
                "variations": selection.variations,
                "stride": selection.stride,
                "min_score": arguments.source.min_score,
                "box": bounds.map_or(String::new(), |value| value.get_name().to_owned()),
            }),
        );
    }
    metrics
}
