//! `partpose weights`: converts and inspects a network's weights.

use std::fmt::Write;
use std::path::PathBuf;

use burn::tensor::Device;
use partpose::files;
use partpose_net::weights::{self, Precision};

use crate::report::{self, Outcome, note};

#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Save weights in half precision, as they are shipped, or in single precision
    Export(Export),
    /// Say what network a file is for, and list its tensors
    Show(Show),
}

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose weights export run/best.safetensors vehicle.safetensors --half")]
pub(crate) struct Export {
    /// Weights of ours
    #[arg(value_name = "FILE")]
    weights: PathBuf,
    /// File to write
    #[arg(value_name = "OUT")]
    out: PathBuf,
    /// 16 bits a value instead of 32
    #[arg(long)]
    half: bool,
}

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  partpose weights show run/weights.safetensors")]
pub(crate) struct Show {
    /// Weights of ours
    #[arg(value_name = "FILE")]
    weights: PathBuf,
}

pub(crate) fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Export(arguments) => export(arguments),
        Command::Show(arguments) => show(arguments),
    }
}

fn export(arguments: &Export) -> anyhow::Result<Outcome> {
    let net = weights::load(&arguments.weights, &Device::flex())?;
    let precision = if arguments.half { Precision::Half } else { Precision::Single };
    let bytes = weights::encode(&weights::read_out(&net), net.config(), precision);
    files::write(&arguments.out, &bytes)?;
    note(format_args!("wrote `{}`, {:.1} MB", arguments.out.display(), bytes.len() as f64 / 1e6));
    Ok(Outcome::Done)
}

fn show(arguments: &Show) -> anyhow::Result<Outcome> {
    let net = weights::load(&arguments.weights, &Device::flex())?;
    let mut text = toml::to_string_pretty(net.config())?;
    let tensors = weights::read_out(&net);
    let count: usize = tensors.iter().map(|tensor| tensor.values.len()).sum();
    let _ = writeln!(text, "\n# {} tensors, {count} values", tensors.len());
    for tensor in &tensors {
        let _ = writeln!(text, "# {} {:?}", tensor.name, tensor.shape);
    }
    report::data(&text)?;
    Ok(Outcome::Done)
}
