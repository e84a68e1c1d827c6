//! `partpose zoo annotate`: part labels for a mesh that lacks them, from the labelled models that resemble it.

use std::path::PathBuf;

use partpose::annotate::{self, AnnotateOptions, Sources};

use crate::progress;
use crate::report::{self, Outcome};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Model with unlabelled faces, as `zoo import` writes it
    #[arg(value_name = "MODEL", required_unless_present = "self_test")]
    model: Option<PathBuf>,
    /// Labelled models: folder of `.glb` files, or one such file; the embedded models, if not given
    #[arg(long, value_name = "ZOO")]
    from: Option<PathBuf>,
    /// Strip the labels of these models (the sources themselves, if no value is given), transfer them from models of
    /// other body styles, and tell how many come back
    #[arg(long, value_name = "ZOO", num_args = 0..=1)]
    self_test: Option<Option<PathBuf>>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let zoo = super::open(arguments.from.as_deref())?;
    let bar = progress::bar("preparing", zoo.models.len() as u64);
    let sources = Sources::new(&zoo, &mut |done| bar.set_position(done as u64));
    bar.finish_and_clear();
    if let Some(targets) = &arguments.self_test {
        let targets = match targets {
            Some(path) => super::open(Some(path))?,
            None => zoo,
        };
        let options = AnnotateOptions::default();
        let results = annotate::leave_style_out(&targets.models, &sources, &options, &mut |_| {});
        for (name, result) in results {
            match result {
                Ok(agreement) => {
                    report::data(&format!("{name} {:.3} {:.3} conf {:.3} {:?}\n", agreement.outside, agreement.all, agreement.confidence, agreement.sources))?;
                    for part in partpose::parts::PartClass::ALL {
                        let [t, f, b] = agreement.parts[part.index()];
                        if t + f > 0.0 && part.id() <= part.opposite().id() {
                            report::data(&format!("    {:14} true {t:.3} found {f:.3} both {b:.3}\n", part.name()))?;
                        }
                    }
                    for bin in agreement.reliability { report::data(&format!(" {:.2}/{:.2}", bin[1]/bin[0].max(1e-9), bin[0]))?; }
                    report::data("\n")?;
                }
                Err(error) => report::warn_error(format_args!("`{name}`"), &error),
            }
        }
    }
    Ok(Outcome::Done)
}
