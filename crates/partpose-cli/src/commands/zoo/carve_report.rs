//! What `zoo carve --report` writes: silhouettes against views that were not used.

use std::fmt::Write;
use std::path::Path;

use partpose::carve::{SIDES, ViewQuality};
use partpose::files::{self, RgbImage};
use partpose::parts::PartClass;
use partpose::vehicle::VehicleModel;

/// Pictures of compared views a model.
const PICTURES: usize = 8;

/// Writes `views.csv` and the pictures of compared views; gives the table to print.
pub(crate) fn write(
    folder: &Path,
    models: &[VehicleModel],
    views: &[ViewQuality],
) -> anyhow::Result<String> {
    let mut table = String::from(
        "model\tviews\tIoU median\tIoU 10 %\tIoU 90 %\tleft px\ttop px\tright px\tbottom px\tlabels\n",
    );
    for model in models {
        let own: Vec<&ViewQuality> =
            views.iter().filter(|view| view.model == model.name()).collect();
        table += &row(model.name(), &own);
        if let Some(picture) = comparison(&own) {
            files::write_png(&folder.join(format!("{}-views.png", model.name())), &picture)?;
        }
    }
    table += &row("all", &views.iter().collect::<Vec<_>>());
    files::write(&folder.join("views.csv"), csv(views).as_bytes())?;
    files::write(&folder.join("views.tsv"), table.as_bytes())?;
    Ok(table)
}

fn row(name: &str, views: &[&ViewQuality]) -> String {
    let mut ious: Vec<f64> = views.iter().map(|view| view.iou).collect();
    let mut line = format!("{name}\t{}", views.len());
    for share in [0.5, 0.1, 0.9] {
        let _ = write!(line, "\t{:.3}", quantile(&mut ious, share));
    }
    for side in 0..SIDES.len() {
        let mut offsets: Vec<f64> = views.iter().filter_map(|view| view.offsets[side]).collect();
        let _ = write!(line, "\t{:+.2}", quantile(&mut offsets, 0.5));
    }
    let mut labels: Vec<f64> = views.iter().map(|view| view.label_accuracy).collect();
    let _ = writeln!(line, "\t{:.3}", quantile(&mut labels, 0.5));
    line
}

/// NaN without values.
pub(super) fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = (values.len().max(1) - 1) as f64 * share;
    values.get(at.round() as usize).copied().unwrap_or(f64::NAN)
}

fn csv(views: &[ViewQuality]) -> String {
    let mut text = String::from(
        "model,world,variation,frame,track,box_height,azimuth,iou,left,top,right,bottom,label_accuracy\n",
    );
    for view in views {
        let track = view.track.map_or_else(String::new, |track| track.to_string());
        let _ = write!(
            text,
            "{},{},{},{},{track},{:.1},{:.3},{:.4}",
            view.model,
            view.sequence.world,
            view.sequence.variation,
            view.frame,
            view.box_height,
            view.azimuth,
            view.iou
        );
        for offset in view.offsets {
            let _ = match offset {
                Some(offset) => write!(text, ",{offset:.3}"),
                None => write!(text, ","),
            };
        }
        let _ = writeln!(text, ",{:.4}", view.label_accuracy);
    }
    text
}

/// Views from the worst to the best: what was observed, rendered, and where the silhouettes differ.
fn comparison(views: &[&ViewQuality]) -> Option<RgbImage> {
    let mut sorted: Vec<&ViewQuality> = views.to_vec();
    sorted.sort_by(|a, b| a.iou.total_cmp(&b.iou));
    let count = sorted.len().min(PICTURES);
    let chosen: Vec<&ViewQuality> =
        (0..count).map(|n| sorted[n * (sorted.len() - 1) / (count.max(2) - 1)]).collect();
    let width = chosen.iter().map(|view| view.size[0]).max()? as usize;
    let height: usize = chosen.iter().map(|view| view.size[1] as usize).sum();
    let mut pixels = vec![255; width * 3 * height * 3];
    let mut top = 0;
    for view in chosen {
        let [w, h] = view.size.map(|side| side as usize);
        for (n, (observed, rendered)) in view.observed.iter().zip(&view.rendered).enumerate() {
            let (x, y) = (n % w, top + n / w);
            let columns = [color(*observed), color(*rendered), difference(*observed, *rendered)];
            for (column, color) in columns.into_iter().enumerate() {
                let at = (y * width * 3 + column * width + x) * 3;
                pixels[at..at + 3].copy_from_slice(&color);
            }
        }
        top += h;
    }
    Some(RgbImage { size: [(width * 3) as u32, height as u32], pixels })
}

fn color(label: u8) -> [u8; 3] {
    match label {
        0 => [0; 3],
        label => PartClass::from_id(label).map_or([70; 3], PartClass::color),
    }
}

/// Red where only the mask has the vehicle, blue where only the model has it, grey where the part is another.
fn difference(observed: u8, rendered: u8) -> [u8; 3] {
    match (observed, rendered) {
        (255, _) => [70; 3],
        (0, 0) => [0; 3],
        (_, 0) => [255, 0, 0],
        (0, _) => [60, 60, 255],
        (a, b) if a == b => [225; 3],
        _ => [150; 3],
    }
}
