//! `partpose export onnx`: the network as an ONNX model, with the mapping by which it is run again.

use std::path::PathBuf;

use burn::tensor::Device;
use partpose::files;
use partpose_net::onnx;

use crate::network::load_weights;
use crate::report::{Outcome, note};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose export onnx --out network.onnx
  partpose run images --onnx-model network.onnx --mapping network.toml --out out
  partpose export onnx --weights run/best.safetensors --size 1242,375 --out fixed.onnx")]
pub(crate) struct Arguments {
    /// Weights of the network; those that come with the program if not given
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
    /// Fix the size of the input; without it the model takes images of any size
    #[arg(long, value_name = "WIDTH,HEIGHT", value_parser = parse_size)]
    size: Option<Size>,
    /// ONNX file to write; beside it the mapping of its inputs and outputs, ending in `.toml`
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Width and height.
#[derive(Clone, Copy, Debug)]
struct Size([usize; 2]);

fn parse_size(text: &str) -> Result<Size, String> {
    let sides: Result<Vec<usize>, _> = text.split(',').map(str::parse).collect();
    match sides.as_deref() {
        Ok([width, height]) if [width, height].iter().all(|side| (32..=16_384).contains(*side)) => {
            Ok(Size([*width, *height]))
        }
        _ => Err("a width and a height from 32 to 16384 are meant, such as 1242,375".to_owned()),
    }
}

pub(super) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let (net, name, _) = load_weights(arguments.weights.as_deref(), &Device::flex())?;
    let bytes = onnx::export(&net, arguments.size.map(|size| size.0))?;
    files::write(&arguments.out, &bytes)?;
    let out = arguments.out.display();
    note(format_args!("wrote the network `{name}` to `{out}`, {:.1} MB", bytes.len() as f64 / 1e6));
    #[cfg(feature = "onnx")]
    {
        let path = arguments.out.with_extension("toml");
        let mapping = toml::to_string_pretty(&crate::network::onnx::mapping_of(net.config()))?;
        files::write(&path, mapping.as_bytes())?;
        note(format_args!("wrote what it takes and puts out to `{}`", path.display()));
    }
    Ok(Outcome::Done)
}
