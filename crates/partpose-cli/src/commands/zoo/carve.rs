//! `partpose zoo carve`: builds annotated models from part masks with known poses.

use std::io::IsTerminal;
use std::path::PathBuf;

use indicatif::{ProgressBar, ProgressStyle};
use partpose::carve::{CarveOptions, Progress, carve_models};
use partpose::dataset::Dataset;

use crate::report::{self, Outcome};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Folder of the data set
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Worlds to carve from, separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', required = true)]
    worlds: Vec<String>,
    /// Leave out the tracks of part I of K
    #[arg(long, value_name = "I/K")]
    fold: Option<String>,
    /// Models to carve, separated by commas; all that the rows name, if not given
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    models: Option<Vec<String>>,
    /// Folder to write the models to
    #[arg(long, value_name = "ZOO")]
    out: PathBuf,
    /// Folder to write pictures and measurements on left-out views to
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let dataset = Dataset::open(&arguments.dataset)?;
    let mut frames = Vec::new();
    for sequence in dataset.sequences() {
        if arguments.worlds.contains(&sequence.world) {
            frames.extend(dataset.frames(sequence)?);
        }
    }
    let bar = progress_bar();
    let mut observe = |progress| match progress {
        Progress::Reading { done, total } => {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        }
        Progress::Carving { model, step } => {
            bar.set_message(format!("{model}: {step}"));
            eprintln!("{model} {step}")
        }
    };
    let fold: Option<(u32, u32)> = arguments
        .fold
        .as_ref()
        .and_then(|f| f.split_once('/').map(|(a, b)| (a.parse().unwrap(), b.parse().unwrap())));
    let leave_out =
        |_: &partpose::dataset::SequenceId, track: u32| fold.is_some_and(|(i, k)| track % k == i);
    let options = CarveOptions::default();
    let carved =
        carve_models(&frames, arguments.models.as_deref(), &leave_out, &options, &mut observe)?;
    bar.finish_and_clear();
    std::fs::create_dir_all(&arguments.out)?;
    for carved in &carved.models {
        let m = carved.model.mesh();
        report::note(format_args!(
            "{} {} tracks {} views {} verts {} faces {:?} {:?}",
            carved.model.name(),
            carved.tracks,
            carved.views,
            m.vertices.len(),
            m.faces.len(),
            carved.model.extent(),
            carved.outline_error
        ));
        let picture = turntable(&carved.model);
        partpose::files::write_png(
            &arguments.out.join(format!("{}.png", carved.model.name())),
            &picture,
        )?;
    }
    for skipped in &carved.skipped {
        report::warn(skipped);
    }
    Ok(if carved.skipped.is_empty() { Outcome::Done } else { Outcome::Skipped })
}

fn progress_bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {wide_msg}");
    ProgressBar::new(1).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

fn turntable(model: &partpose::vehicle::VehicleModel) -> partpose::files::RgbImage {
    use partpose::geometry::*;
    use partpose::render::*;
    let (w, h) = (480usize, 320usize);
    let mut pixels = vec![255u8; w * 3 * h * 3 * 3];
    let e = model.extent();
    for n in 0..9 {
        let (yaw, pitch) = match n {
            0 => (0.0, 0.0),
            1 => (90.0, 0.0),
            2 => (180.0, 0.0),
            3 => (45.0, 15.0),
            4 => (135.0, 15.0),
            5 => (20.0, 30.0),
            6 => (160.0, 30.0),
            7 => (90.0, 85.0),
            _ => (90.0, -85.0),
        };
        let camera = Camera::pinhole(1600.0, [239.5, 159.5], [w as u32, h as u32]);
        // camera at azimuth yaw (0 ahead)
        let (s, c) = f64::to_radians(yaw).sin_cos();
        let (sp, cp) = f64::to_radians(pitch).sin_cos();
        let center = Point3::new(0.0, -0.5 * e.height, 0.0);
        let dist = 17.0;
        let eye = center + Vector3::new(s * cp, -sp, c * cp) * dist;
        let up = Vector3::new(0.0, -1.0, 0.0);
        let camera_from_vehicle = {
            let z = (center - eye).normalize();
            let x = -(up.cross(&z)).normalize();
            let x = if x.norm() < 0.5 { Vector3::x() } else { x };
            let y = z.cross(&x);
            let r = nalgebra_rot(x, y, z);
            Pose::from_parts((-(r * eye.coords)).into(), UnitQ::from_rotation_matrix(&r))
        };
        let image = render_labels(
            &camera,
            &[Instance {
                mesh: model.mesh(),
                scale: Vector3::new(1.0, 1.0, 1.0),
                camera_from_vehicle,
                id: 1,
            }],
        );
        for y in 1..h - 1 {
            for x in 1..w - 1 {
                let p = y * w + x;
                let Some(class) = partpose::parts::PartClass::from_id(image.parts[p]) else {
                    continue;
                };
                let d = |q: usize| {
                    if image.depths[q].is_finite() { image.depths[q] } else { image.depths[p] }
                };
                let px = dist / 1600.0;
                let (gx, gy) = (
                    f64::from(d(p + 1) - d(p - 1)) / (2.0 * px),
                    f64::from(d(p + w) - d(p - w)) / (2.0 * px),
                );
                let l = (0.4 * gx + 0.6 * gy + 1.0) / (1.0 + gx * gx + gy * gy).sqrt();
                let shade = 0.45 + 0.55 * (l / 1.24).clamp(0.0, 1.0);
                let o = (((n / 3) * h + y) * w * 3 + (n % 3) * w + x) * 3;
                for k in 0..3 {
                    pixels[o + k] = (f64::from(class.color()[k]) * shade) as u8;
                }
            }
        }
    }
    partpose::files::RgbImage { size: [(w * 3) as u32, (h * 3) as u32], pixels }
}
type UnitQ = nalgebra::UnitQuaternion<f64>;
fn nalgebra_rot(
    x: partpose::geometry::Vector3,
    y: partpose::geometry::Vector3,
    z: partpose::geometry::Vector3,
) -> partpose::geometry::Rotation3 {
    nalgebra::Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_rows(&[
        x.transpose(),
        y.transpose(),
        z.transpose(),
    ]))
}
