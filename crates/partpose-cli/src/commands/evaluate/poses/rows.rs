//! The rows of the tables: what is compared, and how much detections err in each.

use partpose::dataset::Frame;
use partpose::eval::{Configuration, EvaluationOptions, calibrate, paper_configurations};
use partpose::oracle::Degradation;
use partpose::parts::Scaling;
use partpose::pose::{Center2d, Center3d, PnpMethod, PoseOptions, Ranking};

use super::{Arguments, compare};
use crate::report::{hint, warn};

/// Frames that the strength of degradation is found on.
const CALIBRATION_FRAMES: usize = 60;
/// Largest miss of the accuracy asked for that is not worth a word.
const ACCURACY_TOLERANCE: f64 = 0.005;

/// One row as asked, or those of Tables III to V and what goes past them; of detections that are given only the rows
/// with their size of kernel.
pub(super) fn configurations(arguments: &Arguments, given: Option<usize>) -> Vec<Configuration> {
    if let Some(rows) = arguments.comparison {
        return compare::configurations(rows, arguments.pose.seed);
    }
    let mut base = arguments.pose.options();
    if arguments.tables && base.method == PnpMethod::Dense {
        // The tables are of centres of parts.
        base.method = PnpMethod::Epnp;
    }
    if !arguments.tables {
        let (name, kernel) = ("as asked".to_owned(), given.unwrap_or(arguments.kernel as usize));
        return vec![Configuration { name, kernel, pose: base, degradation: None }];
    }
    let mut rows = all(&base);
    if let Some(kernel) = given {
        // The rows of one size stand for the detections' own, Table V's for them too.
        rows.retain(|row| row.kernel == 28 || row.name.starts_with("V: "));
        rows.extend(by_evidence(&base));
        for row in &mut rows {
            row.kernel = kernel;
            row.name = row.name.replace(": 28 ", &format!(": {kernel} "));
        }
    }
    rows
}

fn all(base: &PoseOptions) -> Vec<Configuration> {
    let mut rows = paper_configurations(base);
    let more = [
        ("CM / CM, all filters", Center2d::Mass, Center3d::Mass, false),
        ("CM / visible, all filters", Center2d::Mass, Center3d::Visible, false),
        ("CM / CM, all filters, LM", Center2d::Mass, Center3d::Mass, true),
        ("CM / visible, all filters, LM", Center2d::Mass, Center3d::Visible, true),
    ];
    for kernel in [28, 56] {
        for (name, center_2d, center_3d, refine) in more {
            let pose = PoseOptions { center_2d, center_3d, refine, ..*base };
            let name = format!("past: {kernel} {name}");
            rows.push(Configuration { name, kernel, pose, degradation: None });
        }
    }
    rows
}

/// The paper's fit, but for the choice of the model, and the best of the others with it: a network may know models.
fn by_evidence(base: &PoseOptions) -> [Configuration; 2] {
    let paper = PoseOptions { ranking: Ranking::Evidence, ..*base };
    let (center_2d, center_3d) = (Center2d::Mass, Center3d::Visible);
    let best = PoseOptions { center_2d, center_3d, refine: true, ..paper };
    [("RECT / CUB, all filters", paper), ("CM / visible, all filters, LM", best)].map(
        |(name, pose)| {
            let name = format!("past: 28 {name}, models by evidence");
            Configuration { name, kernel: 28, pose, degradation: None }
        },
    )
}

/// Finds for each kernel size and scaling the strength that gives the accuracy asked for.
pub(super) fn degrade(
    configurations: &mut [Configuration],
    frames: &[Frame],
    options: &EvaluationOptions,
    target: f64,
    seed: u64,
) -> anyhow::Result<()> {
    let step = frames.len().div_ceil(CALIBRATION_FRAMES).max(1);
    let sample: Vec<Frame> = frames.iter().step_by(step).cloned().collect();
    let mut found: Vec<((usize, Scaling), f64)> = Vec::new();
    for configuration in configurations {
        let key = (configuration.kernel, configuration.pose.scaling);
        let known = found.iter().find(|(other, _)| *other == key).map(|(_, strength)| *strength);
        let strength = match known {
            Some(strength) => strength,
            None => find_strength(&sample, options, configuration, target, seed)?,
        };
        found.push((key, strength));
        configuration.degradation = Some(Degradation { strength, seed });
    }
    Ok(())
}

fn find_strength(
    sample: &[Frame],
    options: &EvaluationOptions,
    configuration: &Configuration,
    target: f64,
    seed: u64,
) -> anyhow::Result<f64> {
    let Some((strength, reached)) = calibrate(sample, options, configuration, target, seed) else {
        return Err(hint(
            anyhow::anyhow!("no vehicle to find the strength of `--degrade` on"),
            "name worlds that show models of the zoo",
        ));
    };
    if (reached - target).abs() > ACCURACY_TOLERANCE {
        let (target, reached) = (100.0 * target, 100.0 * reached);
        let kernel = configuration.kernel;
        warn(format_args!(
            "kernels of {kernel} cells reach {reached:.1} % pixel accuracy, not the {target:.1} % asked for"
        ));
    }
    Ok(strength)
}
