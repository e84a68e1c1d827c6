//! The scores as Markdown and CSV, beside those of other people's solvers.

use std::{collections::BTreeMap, fmt::Write};

use serde::{Deserialize, Serialize};

use super::{CellScores, Scores, Solver};

/// Largest ratio to the maximum-likelihood medians that counts as equal.
const EQUAL: f64 = 1.02;
/// How much more often both modes may be wrong than the reference's, a share.
const TWO_MODES_MARGIN: f64 = 0.01;
/// Shares of 1000 trials are compared with this slack for their binary representation.
const ROUNDING: f64 = 1e-9;

/// All cells, by name.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// Scores of every cell.
    pub cells: BTreeMap<String, CellScores>,
}

/// Reference scores: `baseline.json` beside the problem sets.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct Baseline {
    /// By the name of the cell.
    pub cells: BTreeMap<String, BaselineCell>,
}

/// Reference scores of one cell.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct BaselineCell {
    /// By the name of the solver.
    pub solvers: BTreeMap<String, Scores>,
    /// What returning both modes bought the reference.
    #[serde(default)]
    pub two_modes: Option<BaselineModes>,
}

/// Reference for two modes.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct BaselineModes {
    /// Share of trials in which both modes fail.
    pub failure_of_both: f64,
}

/// A comparison with a reference on one cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The cell.
    pub cell: String,
    /// What is compared.
    pub what: &'static str,
    /// Our number.
    pub ours: f64,
    /// The most it may be.
    pub limit: f64,
}

impl Target {
    /// Whether the target is met.
    pub fn holds(&self) -> bool {
        self.ours <= self.limit + ROUNDING
    }
}

/// Every target that the reference scores allow to be checked.
pub fn targets(metrics: &Metrics, baseline: &Baseline) -> Vec<Target> {
    let mut targets = Vec::new();
    for (name, cell) in &metrics.cells {
        let Some(reference) = baseline.cells.get(name) else { continue };
        let ours = |solver: Solver| cell.solvers.get(solver.name());
        let peer = |solver: &str| reference.solvers.get(solver);
        let mut add = |what, ours: f64, limit: f64| {
            targets.push(Target { cell: name.clone(), what, ours, limit });
        };
        let clean = cell.outlier_fraction == 0.0;
        if let (Some(epnp), Some(opencv)) = (ours(Solver::Epnp), peer("OpenCV EPNP")) {
            add("EPnP failures, OpenCV's", epnp.failure, opencv.failure);
            if clean && cell.geometry == "spread" && cell.n >= 8 && cell.sigma_px <= 2.0 {
                add("EPnP failures, half of OpenCV's", epnp.failure, 0.5 * opencv.failure);
            }
        }
        if let (true, Some(best), Some(ml)) =
            (clean && cell.n >= 6, ours(Solver::SqpnpRefined), peer("ML multi-start"))
        {
            let peers = reference.solvers.iter().filter(|(name, _)| is_solver(name));
            let least = peers.map(|(_, scores)| scores.failure).fold(f64::INFINITY, f64::min);
            add("SQPnP + LM rotation, ML + 2 %", best.rot_deg_median, EQUAL * ml.rot_deg_median);
            add("SQPnP + LM translation, ML + 2 %", best.trans_m_median, EQUAL * ml.trans_m_median);
            add("SQPnP + LM failures, best peer's", best.failure, least);
        }
        if let (true, Some(ransac), Some(poselib)) =
            (!clean, ours(Solver::Ransac), peer("PoseLib LO-RANSAC"))
        {
            add("RANSAC failures, PoseLib's", ransac.failure, poselib.failure);
            let limit = EQUAL * poselib.rot_deg_median;
            add("RANSAC rotation, PoseLib + 2 %", ransac.rot_deg_median, limit);
            let limit = EQUAL * poselib.trans_m_median;
            add("RANSAC translation, PoseLib + 2 %", ransac.trans_m_median, limit);
        }
        if let (Some(both), Some(modes)) =
            (ours(Solver::TwoModes).and_then(|s| s.both_wrong), reference.two_modes)
        {
            let limit = modes.failure_of_both + TWO_MODES_MARGIN;
            add("both modes wrong, reference + 1 point", both, limit);
        }
    }
    targets
}

/// Whether a row of the reference is a solver; bounds know the truth, the inliers or the priors.
fn is_solver(name: &str) -> bool {
    !name.starts_with("ML ") && !name.starts_with("MAP ")
}

/// One line per cell and solver.
pub fn to_csv(metrics: &Metrics) -> String {
    let mut text = String::from(
        "cell,solver,rot_deg_median,rot_deg_p95,trans_m_median,trans_m_p95,failure,no_result,\
         both_wrong,two_distinct,time_us_median\n",
    );
    for (name, cell) in &metrics.cells {
        for solver in Solver::ALL {
            let Some(s) = cell.solvers.get(solver.name()) else { continue };
            let optional = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.4}"));
            // Names of ours may hold a comma.
            let _ = writeln!(
                text,
                "{name},\"{}\",{:.4},{:.4},{:.5},{:.5},{:.4},{:.4},{},{},{}",
                solver.name(),
                s.rot_deg_median,
                s.rot_deg_p95,
                s.trans_m_median,
                s.trans_m_p95,
                s.failure,
                s.no_result,
                optional(s.both_wrong),
                optional(s.two_distinct),
                optional(s.time_us_median)
            );
        }
    }
    text
}

/// A table per cell, peers below ours where there are reference scores, and the targets.
pub fn to_markdown(metrics: &Metrics, baseline: Option<&Baseline>) -> String {
    let mut text = String::from(
        "# PnP solvers on the problem sets\n\n\
         Median and 95th percentile of the errors; failure: no result, more than 20 degrees, more than a fifth of the \
         distance, or behind the camera. Times are medians per call on one core; those of the reference scores were \
         taken on another occasion, so compare them only roughly.\n",
    );
    if let Some(baseline) = baseline {
        let targets = targets(metrics, baseline);
        summarise(&mut text, &targets);
    }
    for (name, cell) in &metrics.cells {
        let _ = write!(
            text,
            "\n## {name}\n\n\
             | solver | rotation ° | p95 | translation m | p95 | failure % | no result % | both modes wrong % | µs |\n\
             |---|--:|--:|--:|--:|--:|--:|--:|--:|\n"
        );
        for solver in Solver::ALL {
            if let Some(scores) = cell.solvers.get(solver.name()) {
                row(&mut text, &format!("**{}**", solver.name()), scores);
            }
        }
        let peers = baseline.and_then(|baseline| baseline.cells.get(name));
        for (peer, scores) in peers.iter().flat_map(|peers| &peers.solvers) {
            let name = if is_solver(peer) { peer.clone() } else { format!("*{peer}*") };
            row(&mut text, &name, scores);
        }
    }
    text
}

fn summarise(text: &mut String, targets: &[Target]) {
    let _ =
        write!(text, "\n## Targets\n\n| target | cells | met | missed in |\n|---|--:|--:|---|\n");
    let mut kinds: Vec<&str> = Vec::new();
    for target in targets {
        if !kinds.contains(&target.what) {
            kinds.push(target.what);
        }
    }
    for kind in kinds {
        let of_kind: Vec<&Target> = targets.iter().filter(|target| target.what == kind).collect();
        let missed = of_kind.iter().filter(|target| !target.holds());
        let missed: Vec<String> = missed
            .map(|target| format!("{} ({:.4} > {:.4})", target.cell, target.ours, target.limit))
            .collect();
        let met = of_kind.len() - missed.len();
        let _ = writeln!(text, "| {kind} | {} | {met} | {} |", of_kind.len(), missed.join(", "));
    }
}

fn row(text: &mut String, name: &str, s: &Scores) {
    let both = s.both_wrong.map_or(String::new(), |share| format!("{:.1}", 100.0 * share));
    let time = s.time_us_median.map_or(String::new(), |time| format!("{time:.1}"));
    let _ = writeln!(
        text,
        "| {name} | {:.2} | {:.1} | {:.2} | {:.1} | {:.1} | {:.1} | {both} | {time} |",
        s.rot_deg_median,
        s.rot_deg_p95,
        s.trans_m_median,
        s.trans_m_p95,
        100.0 * s.failure,
        100.0 * s.no_result,
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scores(failure: f64) -> Scores {
        Scores {
            rot_deg_median: 1.0,
            rot_deg_p95: 2.0,
            trans_m_median: 0.1,
            trans_m_p95: 0.2,
            failure,
            no_result: 0.0,
            both_wrong: None,
            two_distinct: None,
            time_us_median: Some(3.0),
        }
    }

    #[test]
    fn missed_and_met_targets_are_told_apart() {
        let cell = |geometry: &str, failure: f64| CellScores {
            geometry: geometry.to_owned(),
            n: 8,
            sigma_px: 1.0,
            outlier_fraction: 0.0,
            trials: 1000,
            solvers: BTreeMap::from([(Solver::Epnp.name().to_owned(), scores(failure))]),
        };
        let metrics = Metrics { cells: BTreeMap::from([("a".to_owned(), cell("spread", 0.07))]) };
        let peer = BTreeMap::from([("OpenCV EPNP".to_owned(), scores(0.1))]);
        let reference = BaselineCell { solvers: peer, two_modes: None };
        let baseline = Baseline { cells: BTreeMap::from([("a".to_owned(), reference)]) };
        let holds: Vec<bool> = targets(&metrics, &baseline).iter().map(Target::holds).collect();
        assert_eq!(holds, [true, false]);
        let markdown = to_markdown(&metrics, Some(&baseline));
        let missed = "| EPnP failures, half of OpenCV's | 1 | 0 | a (0.0700 > 0.0500) |";
        assert!(markdown.contains(missed), "{markdown}");
        assert_eq!(to_csv(&metrics).lines().count(), 2);
    }
}
