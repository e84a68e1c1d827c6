//! `partpose zoo show`: pictures of models from all sides.

use std::path::PathBuf;

use partpose::files;
use partpose::vehicle::VehicleModel;
use partpose::viz::{TurntableOptions, turntable};

use crate::report::{self, Outcome, hint};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose zoo show --out pictures
  partpose zoo show zoo-0001 --out pictures")]
pub(crate) struct Arguments {
    /// Folder of `.glb` files, or one such file; the embedded models, if not given
    #[arg(value_name = "ZOO")]
    zoo: Option<PathBuf>,
    /// Model to draw; all of them, if not given
    #[arg(long, value_name = "NAME")]
    model: Option<String>,
    /// PNG file for one model, or folder for one file a model
    #[arg(long, value_name = "FILE_OR_DIR")]
    out: PathBuf,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let zoo = super::open(arguments.zoo.as_deref())?;
    let models: Vec<&VehicleModel> = match &arguments.model {
        None => zoo.models.iter().collect(),
        Some(name) => {
            let names: Vec<_> = zoo.models.iter().map(VehicleModel::name).collect();
            let unknown = || anyhow::anyhow!("the zoo has no model `{name}`");
            let known = format!("it has `{}`", names.join("`, `"));
            vec![zoo.get(name).ok_or_else(|| hint(unknown(), known))?]
        }
    };
    let is_file = arguments.out.extension().is_some_and(|end| end.eq_ignore_ascii_case("png"));
    if is_file && models.len() > 1 {
        let error = anyhow::anyhow!("{} models do not fit into one file", models.len());
        return Err(hint(error, "choose one with `--model`, or give a folder"));
    }
    for model in &models {
        let path = if is_file {
            arguments.out.clone()
        } else {
            arguments.out.join(format!("{}.png", file_stem(model.name())))
        };
        files::write_png(&path, &turntable(model, &TurntableOptions::default()))?;
        report::note(format_args!("drew `{}`", path.display()));
    }
    Ok(Outcome::Done)
}

/// A model's name as that of a file: whoever made the model may have put a path into it.
fn file_stem(name: &str) -> String {
    let fits = |c: char| c.is_alphanumeric() || "_-. ".contains(c);
    let stem: String = name.chars().map(|c| if fits(c) { c } else { '_' }).collect();
    if stem.starts_with('.') { format!("_{stem}") } else { stem }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_models_name_cannot_leave_the_folder() {
        assert_eq!(file_stem("../../etc/x"), "_.._.._etc_x");
        assert_eq!(file_stem("Golf 7"), "Golf 7");
    }
}
