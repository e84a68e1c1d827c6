//! Accuracy and time of the `PnP` solvers on sets of problems with known poses.
//!
//! A trial fails if there is no result, if the rotation is off by more than 20 degrees or the translation by more than a
//! fifth of the distance, or if the object lies behind the camera. Missing results count as 180 degrees and 1000 m.

mod problems;
mod solvers;
mod table;

pub use problems::{Problem, ProblemError, ProblemSet, read_problem_set};
pub use solvers::{CellScores, Scores, Solver, evaluate};
pub use table::{Baseline, Metrics, Target, targets, to_csv, to_markdown};
