//! `partpose serve`: images in, vehicles and poses out, over HTTP.
//!
//! The network and the zoo are loaded once. A request is admitted, read, handed to a worker thread through a queue, and
//! answered; what is too large, too much or too slow is refused with a reason. `docs/serving.md` describes the protocol.

mod estimate;
mod http;
mod kserve;
mod metrics;
mod routes;
#[cfg(test)]
mod tests;
mod workers;

use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use crate::camera::Cameras;
use crate::commands::fitting::{FitFlags, Fitter, parse_score};
use crate::network::{EngineFlags, Network};
use crate::report::{Outcome, note};

use self::metrics::Metrics;
use self::routes::Server;
use self::workers::{Engine, Workers};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose serve --port 8000 --camera camera.toml
  curl --data-binary @photo.jpg 'http://127.0.0.1:8000/v1/estimate?fx=725&fy=725&cx=620.5&cy=187'
  curl http://127.0.0.1:8000/metrics

Stops at ctrl-c or SIGTERM when what was admitted is answered.")]
pub(crate) struct Arguments {
    /// Address to listen on; 0.0.0.0 takes requests from other machines, too: there is no password and no encryption
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    address: IpAddr,
    /// Port to listen on; 0 takes a free one and says which
    #[arg(long, value_name = "PORT", default_value_t = 8000)]
    port: u16,
    /// Camera of images that come without one: TOML, or a KITTI calibration. Without it the focal length is guessed from
    /// EXIF, else from `--fov`
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Field of view along the longer side of images without camera and EXIF, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 70.0, value_parser = super::run::parse_angle, conflicts_with = "camera")]
    fov: f64,
    /// Weights of the network; those that come with the program if not given
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
    #[command(flatten)]
    engine: EngineFlags,
    /// Leave out detections with a lower score, where a request does not say it
    #[arg(long, value_name = "SCORE", default_value_t = 0.5, value_parser = parse_score)]
    min_score: f64,
    #[command(flatten)]
    fit: FitFlags,
    #[command(flatten)]
    limits: Limits,
}

/// What is refused.
#[derive(clap::Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Limits")]
pub(crate) struct Limits {
    /// Largest request, MiB; what is larger gets 413
    #[arg(long, value_name = "MIB", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=1024))]
    max_body: u32,
    /// Largest image, megapixels; what is larger gets 413
    #[arg(long, value_name = "MP", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=256))]
    max_pixels: u32,
    /// Seconds for a request to arrive, and again for its answer; what is slower gets 408 or 504
    #[arg(long, value_name = "SECONDS", default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..=3600))]
    timeout: u32,
    /// Requests that may wait or arrive while the workers are busy; more get 503
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(0..=10_000))]
    queue: u32,
    /// Images that are worked on at once; with two, the fit of one image goes on beside the network on the next
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=64))]
    workers: u32,
}

impl Limits {
    fn time(&self) -> Duration {
        Duration::from_secs(u64::from(self.timeout))
    }

    fn body(&self) -> usize {
        self.max_body as usize * 1024 * 1024
    }

    fn pixels(&self) -> u64 {
        u64::from(self.max_pixels) * 1_000_000
    }

    /// Requests that are taken at once.
    fn admitted(&self) -> usize {
        (self.queue + self.workers) as usize
    }
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let cameras = match &arguments.camera {
        Some(path) => Cameras::load(path)?,
        None => Cameras::guess(arguments.fov.to_radians()),
    };
    let fitter = Fitter::new(&arguments.fit, &PathBuf::new())?;
    let network = Network::load(arguments.weights.as_deref(), &arguments.engine)?;
    let (limits, min_score) = (arguments.limits, arguments.min_score);
    let metrics = Arc::new(Metrics::default());
    let detect = Box::new(move |image: &_| network.detect(image));
    let engine = Engine { detect, fitter, cameras, min_score, most_pixels: limits.pixels() };
    let workers = Workers::start(engine, limits.workers as usize, limits.admitted(), &metrics);
    let address = SocketAddr::new(arguments.address, arguments.port);
    let server = Server::new(workers, metrics, limits);
    http::serve(address, server, &|bound| note(format_args!("listening on http://{bound}")))?;
    note("stopped");
    Ok(Outcome::Done)
}
