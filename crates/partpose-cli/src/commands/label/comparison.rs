//! How labels agree with a reference: tables, JSON, the confusion matrix, pictures.

use std::collections::BTreeMap;
use std::path::Path;

use partpose::eval::Table;
use partpose::files;
use partpose::labeling::{Agreement, Compared, LabelReport, LabelStore, Tally, comparison_picture};
use partpose::parts::{CHANNELS, PartClass};
use partpose::viz::{ConfusionClass, confusion_picture};
use serde_json::{Value, json};

use super::Arguments;
use crate::report::{data, note};

/// Frames with fewer shared pixels say little about accuracy and are not drawn as the worst.
const LEAST_SHARED: u64 = 2000;

/// Prints the tables and writes everything to `compare/` in the folder of the labels.
pub(super) fn write(
    arguments: &Arguments,
    reference: &Path,
    agreement: &Agreement,
    report: &LabelReport,
) -> anyhow::Result<()> {
    let folder = arguments.out.join("compare");
    let tables = [summary(agreement), groups(agreement), classes(agreement)];
    let text = tables.iter().map(Table::to_markdown).collect::<Vec<_>>().join("\n");
    data(&text)?;
    files::write(&folder.join("tables.md"), text.as_bytes())?;
    files::write(&folder.join("confusion.csv"), confusion(agreement).to_csv().as_bytes())?;
    let title = "rows: reference; columns: labels; percent of the row";
    let picture = confusion_picture(title, &names(), &agreement.confusion);
    files::write_png(&folder.join("confusion.png"), &picture)?;
    let metrics = serde_json::to_string_pretty(&metrics(agreement, report))?;
    files::write(&folder.join("metrics.json"), metrics.as_bytes())?;
    for (name, frame) in chosen(&report.compared, arguments.pictures) {
        let store = LabelStore::new(&arguments.out);
        let picture = comparison_picture(&store, reference, &frame.sequence, frame.index)?;
        files::write_png(&folder.join("pictures").join(format!("{name}.png")), &picture)?;
    }
    if report.without_reference > 0 {
        note(format_args!("{} frames have no reference", report.without_reference));
    }
    note(format_args!("wrote the comparison to `{}`", folder.display()));
    Ok(())
}

fn percent(share: Option<f64>) -> String {
    share.map_or("-".to_owned(), |share| format!("{:.2}", 100.0 * share))
}

fn summary(agreement: &Agreement) -> Table {
    let mut table = Table::new("Agreement with the reference", &["what", "%", "pixels"]);
    let inside = agreement.inside();
    let vehicle = inside.shared + agreement.missed();
    let mut row = |what: &str, share: Option<f64>, pixels: u64| {
        table.rows.push(vec![what.to_owned(), percent(share), pixels.to_string()]);
    };
    row("right part, where both see a vehicle", inside.accuracy(), inside.shared);
    row(
        "right part, of the reference's vehicle pixels",
        agreement.accuracy_on_reference(),
        vehicle,
    );
    row("mean class IoU, where both see a vehicle", agreement.mean_iou_inside(), inside.shared);
    row("mean class IoU, all pixels", agreement.mean_iou(), agreement.confusion.iter().sum());
    row("vehicle IoU, whatever the part", agreement.vehicle_iou(), vehicle + agreement.surplus());
    let share = |pixels: u64| Some(pixels as f64 / vehicle.max(1) as f64);
    row("missed vehicle pixels", share(agreement.missed()), agreement.missed());
    row("surplus vehicle pixels", share(agreement.surplus()), agreement.surplus());
    table
}

fn groups(agreement: &Agreement) -> Table {
    let columns = ["group", "of", "right part %", "pixels"];
    let mut table = Table::new("Where both see a vehicle", &columns);
    for (of, group) in [
        ("model", &agreement.by_model),
        ("distance", &agreement.by_distance),
        ("care", &agreement.by_care),
    ] {
        for (name, tally) in group {
            let accuracy = percent(tally.accuracy());
            let cells = [name.clone(), of.to_owned(), accuracy, tally.shared.to_string()];
            table.rows.push(cells.to_vec());
        }
    }
    table
}

fn classes(agreement: &Agreement) -> Table {
    let columns = ["part", "IoU %", "IoU inside %", "reference", "labels"];
    let mut table = Table::new("Parts", &columns);
    for class in agreement.classes() {
        table.rows.push(vec![
            class.class.name().to_owned(),
            percent(class.iou),
            percent(class.iou_inside),
            class.reference.to_string(),
            class.labels.to_string(),
        ]);
    }
    table
}

/// Background, then the parts.
fn names() -> Vec<ConfusionClass> {
    let background = ConfusionClass { name: "background".to_owned(), color: [0; 3] };
    let class =
        |class: PartClass| ConfusionClass { name: class.name().to_owned(), color: class.color() };
    std::iter::once(background).chain(PartClass::ALL.map(class)).collect()
}

fn confusion(agreement: &Agreement) -> Table {
    let names: Vec<String> = names().into_iter().map(|class| class.name).collect();
    let titles: Vec<&str> =
        std::iter::once("reference").chain(names.iter().map(String::as_str)).collect();
    let mut table = Table::new("Confusion", &titles);
    for (name, counts) in names.iter().zip(agreement.confusion.chunks_exact(CHANNELS)) {
        let counts = counts.iter().map(ToString::to_string);
        table.rows.push(std::iter::once(name.clone()).chain(counts).collect());
    }
    table
}

fn metrics(agreement: &Agreement, report: &LabelReport) -> Value {
    let inside = agreement.inside();
    let tallies = |group: &BTreeMap<String, Tally>| -> Value {
        let entry = |(name, tally): (&String, &Tally)| {
            let value = json!({ "accuracy": tally.accuracy(), "pixels": tally.shared });
            (name.clone(), value)
        };
        Value::Object(group.iter().map(entry).collect())
    };
    let classes = agreement.classes().into_iter().map(|class| {
        let value = json!({
            "iou": class.iou,
            "iou_inside": class.iou_inside,
            "reference_pixels": class.reference,
            "label_pixels": class.labels,
        });
        (class.class.name().to_owned(), value)
    });
    json!({
        "frames": agreement.frames,
        "frames_without_reference": report.without_reference,
        "accuracy_inside": inside.accuracy(),
        "pixels_inside": inside.shared,
        "accuracy_on_reference": agreement.accuracy_on_reference(),
        "mean_iou_inside": agreement.mean_iou_inside(),
        "mean_iou": agreement.mean_iou(),
        "vehicle_iou": agreement.vehicle_iou(),
        "missed_pixels": agreement.missed(),
        "surplus_pixels": agreement.surplus(),
        "by_model": tallies(&agreement.by_model),
        "by_distance": tallies(&agreement.by_distance),
        "by_care": tallies(&agreement.by_care),
        "classes": Value::Object(classes.collect()),
    })
}

/// The frames to draw, with the names of their pictures: worst parts, worst outlines, and those about the middle.
fn chosen(compared: &[Compared], count: usize) -> Vec<(String, &Compared)> {
    let name = |kind: &str, at: usize, frame: &Compared| {
        let sequence = frame.sequence.to_string().replace('/', "_");
        format!("{kind}-{}-{sequence}_{:05}", at + 1, frame.index)
    };
    let accuracy = |frame: &Compared| frame.inside.accuracy().unwrap_or(0.0);
    let mut large: Vec<&Compared> =
        compared.iter().filter(|frame| frame.inside.shared >= LEAST_SHARED).collect();
    large.sort_by(|a, b| accuracy(a).total_cmp(&accuracy(b)));
    let middle = (large.len() / 2).saturating_sub(count / 2);
    let mut outlines: Vec<&Compared> = compared.iter().collect();
    outlines.sort_by_key(|frame| u64::MAX - frame.outline);
    let take = |kind: &'static str, frames: Vec<&'_ Compared>| -> Vec<(String, usize)> {
        let position = |frame: &Compared| compared.iter().position(|other| other == frame);
        let named = frames.into_iter().take(count).enumerate();
        named.filter_map(|(at, frame)| Some((name(kind, at, frame), position(frame)?))).collect()
    };
    let lists = [
        take("worst", large.clone()),
        take("middle", large.split_off(middle)),
        take("outline", outlines),
    ];
    lists.concat().into_iter().map(|(name, at)| (name, &compared[at])).collect()
}
