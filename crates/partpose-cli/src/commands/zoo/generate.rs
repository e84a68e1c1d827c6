//! `partpose zoo generate`: writes the procedural models, or one that the user describes.

mod parameters;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use partpose::files;
use partpose::vehicle::{ModelZoo, ParametricVehicle, VehicleModel};
use partpose::viz::{ContactSheetOptions, TurntableOptions, contact_sheet, turntable};

use crate::report::{self, Outcome, hint, note};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose zoo generate --list
  partpose zoo generate --out zoo --report pictures
  partpose zoo generate --from mine.toml --out zoo")]
pub(crate) struct Arguments {
    /// Folder to write the models to
    #[arg(long, value_name = "ZOO")]
    out: Option<PathBuf>,
    /// Models to make, separated by commas; all, if not given
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    models: Option<Vec<String>>,
    /// Make the vehicle that a TOML file describes; see --parameters
    #[arg(long, value_name = "FILE", conflicts_with = "models")]
    from: Option<PathBuf>,
    /// List the models and write nothing
    #[arg(long, conflicts_with_all = ["out", "report", "parameters", "contact_sheet"])]
    list: bool,
    /// Folder to write a turntable of each model to
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Folder to write each model's parameters to, as TOML
    #[arg(long, value_name = "DIR")]
    parameters: Option<PathBuf>,
    /// PNG file to draw all models to
    #[arg(long, value_name = "FILE")]
    contact_sheet: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let vehicles = match &arguments.from {
        Some(path) => vec![parameters::read(path)?],
        None => chosen(arguments.models.as_deref())?,
    };
    if arguments.list {
        report::data(&table_of(&vehicles))?;
        return Ok(Outcome::Done);
    }
    let wanted =
        [&arguments.out, &arguments.report, &arguments.parameters, &arguments.contact_sheet];
    if wanted.iter().all(|path| path.is_none()) {
        let error = anyhow::anyhow!("nothing to write");
        return Err(hint(error, "give `--out ZOO`, or `--list` to see what there is"));
    }
    let zoo = ModelZoo { models: build(&vehicles, arguments.from.as_deref())? };
    if let Some(folder) = &arguments.out {
        // A folder that holds other models is refused here, before anything is written.
        zoo.save(folder)?;
        let count = zoo.models.len();
        let plural = if count == 1 { "" } else { "s" };
        note(format_args!("wrote {count} model{plural} to `{}`", folder.display()));
    }
    if let Some(folder) = &arguments.parameters {
        for vehicle in &vehicles {
            let path = folder.join(format!("{}.toml", vehicle.name));
            files::write(&path, parameters::to_text(vehicle)?.as_bytes())?;
        }
        note(format_args!("wrote parameters to `{}`", folder.display()));
    }
    if let Some(folder) = &arguments.report {
        for model in &zoo.models {
            let path = folder.join(format!("{}.png", model.name()));
            files::write_png(&path, &turntable(model, &TurntableOptions::default()))?;
        }
        note(format_args!("drew turntables to `{}`", folder.display()));
    }
    if let Some(path) = &arguments.contact_sheet {
        files::write_png(path, &contact_sheet(&zoo.models, &ContactSheetOptions::default()))?;
        note(format_args!("drew `{}`", path.display()));
    }
    Ok(Outcome::Done)
}

/// The vehicles of some names, in the order of the program's.
fn chosen(names: Option<&[String]>) -> anyhow::Result<Vec<ParametricVehicle>> {
    let mut vehicles = ParametricVehicle::all();
    let Some(names) = names else { return Ok(vehicles) };
    let known: Vec<String> = vehicles.iter().map(|vehicle| vehicle.name.clone()).collect();
    if let Some(unknown) = names.iter().find(|name| !known.contains(name)) {
        let error = anyhow::anyhow!("there is no vehicle `{unknown}`");
        return Err(hint(error, format!("choose among `{}`", known.join("`, `"))));
    }
    vehicles.retain(|vehicle| names.contains(&vehicle.name));
    Ok(vehicles)
}

fn build(vehicles: &[ParametricVehicle], file: Option<&Path>) -> anyhow::Result<Vec<VehicleModel>> {
    let one = |vehicle: &ParametricVehicle| {
        vehicle.build().map_err(|error| match file {
            None => error.into(),
            Some(path) => hint(
                anyhow::anyhow!("`{}`: {error}", path.display()),
                "docs/vehicles.md explains the parameters; begin with a vehicle of \
                 `partpose zoo generate --parameters DIR` and change little at a time",
            ),
        })
    };
    vehicles.iter().map(one).collect()
}

/// Names, styles and main measures, one line a vehicle.
fn table_of(vehicles: &[ParametricVehicle]) -> String {
    let mut table = String::from("name\tcategory\tbody_style\tlength\twidth\theight\twheelbase\n");
    for v in vehicles {
        let _ = writeln!(
            table,
            "{}\t{}\t{}\t{:.2}\t{:.2}\t{:.2}\t{:.2}",
            v.name, v.category, v.body_style, v.length, v.width, v.height, v.wheelbase
        );
    }
    table
}
