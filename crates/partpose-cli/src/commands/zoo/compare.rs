//! `partpose zoo compare`: how well models stand in for the vehicles of a data set.

use std::fmt::Write;
use std::path::PathBuf;

use partpose::carve::{Progress, QualityOptions, ViewQuality, measure_stand_ins, part_agreements};
use partpose::dataset::Dataset;
use partpose::vehicle::VehicleModel;

use super::carve_report;
use crate::progress;
use crate::report::{self, Outcome, hint, note};

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  partpose zoo compare --dataset vkitti --pairs sedan=Sedan4Door,hatchback=Hatchback")]
pub(crate) struct Arguments {
    /// Folder of the data set
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Folder of `.glb` files, or one such file; the embedded models, if not given
    #[arg(long, value_name = "ZOO")]
    zoo: Option<PathBuf>,
    /// Models and the mesh names that they stand in for, separated by commas
    #[arg(long, value_name = "MODEL=NAME", value_delimiter = ',', required = true)]
    pairs: Vec<String>,
    /// Worlds to compare in, separated by commas; all, if not given
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    worlds: Option<Vec<String>>,
    /// Folder to write pictures and a table of all views to
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let zoo = super::open(arguments.zoo.as_deref())?;
    let mut pairs: Vec<(&VehicleModel, &str)> = Vec::new();
    for pair in &arguments.pairs {
        let Some((name, mesh_name)) = pair.split_once('=') else {
            let error = anyhow::anyhow!("`{pair}` is no pair");
            return Err(hint(error, "write MODEL=NAME, for example `sedan=Sedan4Door`"));
        };
        let Some(model) = zoo.get(name) else {
            let names: Vec<_> = zoo.models.iter().map(VehicleModel::name).collect();
            let error = anyhow::anyhow!("the zoo has no model `{name}`");
            return Err(hint(error, format!("it has `{}`", names.join("`, `"))));
        };
        pairs.push((model, mesh_name));
    }
    let dataset = Dataset::open(&arguments.dataset)?;
    let (mut frames, mut complete) = (Vec::new(), true);
    for sequence in dataset.sequences() {
        let is_wanted = |worlds: &Vec<String>| worlds.contains(&sequence.world);
        if arguments.worlds.as_ref().is_none_or(is_wanted) {
            let read = dataset.read(sequence)?;
            for problem in &read.problems {
                report::warn(problem);
            }
            complete &= read.problems.is_empty();
            frames.extend(read.frames.into_iter().filter(|frame| frame.parts.is_some()));
        }
    }
    if frames.is_empty() {
        let error = anyhow::anyhow!("no frame has a part mask");
        return Err(hint(
            error,
            "part masks belong in parts/WORLD/VARIATION/NNNNN.png of the data set's folder",
        ));
    }
    let bar = progress::bar("measuring", 1);
    let mut observe = |progress| {
        if let Progress::Reading { done, total } = progress {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        }
    };
    let options = QualityOptions::default();
    let views = measure_stand_ins(&frames, &pairs, &options, &mut observe);
    bar.finish_and_clear();
    let views = views?;
    report::data(&table_of(&pairs, &views))?;
    if let Some(folder) = &arguments.report {
        let renamed = pairs.iter().map(|(model, name)| {
            let (category, style) = (model.category(), model.body_style());
            VehicleModel::new(name, category, style, model.extent(), model.mesh().clone())
        });
        let models: Vec<VehicleModel> = renamed.collect::<Result<_, _>>()?;
        carve_report::write(folder, &models, &views)?;
        note(format_args!("wrote pictures and views to `{}`", folder.display()));
    }
    Ok(if complete { Outcome::Done } else { Outcome::Skipped })
}

/// Medians a pair, then how each part is met.
fn table_of(pairs: &[(&VehicleModel, &str)], views: &[ViewQuality]) -> String {
    let mut table =
        String::from("model\tmesh\tviews\tIoU_median\tIoU_10%\tlabels_median\tlabels_10%\n");
    for (model, name) in pairs {
        let own = || views.iter().filter(|view| view.model == *name);
        let mut ious: Vec<f64> = own().map(|view| view.iou).collect();
        let mut labels: Vec<f64> = own().map(|view| view.label_accuracy).collect();
        let _ = writeln!(
            table,
            "{}\t{name}\t{}\t{:.3}\t{:.3}\t{:.3}\t{:.3}",
            model.name(),
            ious.len(),
            carve_report::quantile(&mut ious, 0.5),
            carve_report::quantile(&mut ious, 0.1),
            carve_report::quantile(&mut labels, 0.5),
            carve_report::quantile(&mut labels, 0.1),
        );
    }
    table += "\nmodel\tpart\tpixels_%\tright_%\tinstead\tinstead_%\n";
    for (model, name) in pairs {
        let own: Vec<&ViewQuality> = views.iter().filter(|view| view.model == *name).collect();
        let parts = part_agreements(&own);
        let all = parts.iter().map(|part| part.pixels).sum::<u64>().max(1) as f64;
        for part in parts {
            let share = |count: u64| 100.0 * count as f64 / part.pixels.max(1) as f64;
            let _ = writeln!(
                table,
                "{}\t{}\t{:.1}\t{:.0}\t{}\t{:.0}",
                model.name(),
                part.part.name(),
                100.0 * part.pixels as f64 / all,
                share(part.right),
                part.instead.0.map_or("background", |part| part.name()),
                share(part.instead.1),
            );
        }
    }
    table
}
