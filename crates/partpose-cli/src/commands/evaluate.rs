//! `partpose evaluate`: scores poses and solvers against ground truth.

mod a3dp;
mod bop;
mod coco;
mod kitti;
mod pnp;
mod poses;
mod scores;

use crate::report::Outcome;

#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Tables III to V: poses of the labelled vehicles of a data set
    Poses(poses::Arguments),
    /// Accuracy and time of the `PnP` solvers on problem sets
    Pnp(pnp::Arguments),
    /// KITTI's average precision: 2D, orientation, bird's-eye view, 3D
    Kitti(kitti::Arguments),
    /// COCO's average precision and recall: boxes, masks
    Coco(coco::Arguments),
    /// BOP's recalls: MSSD, MSPD, ADD
    Bop(bop::Arguments),
    /// `ApolloCar3D`'s average precision of car poses: A3DP-Abs, A3DP-Rel
    A3dp(a3dp::Arguments),
}

pub(crate) fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Poses(arguments) => poses::run(arguments),
        Command::Pnp(arguments) => pnp::run(arguments),
        Command::Kitti(arguments) => kitti::run(arguments),
        Command::Coco(arguments) => coco::run(arguments),
        Command::Bop(arguments) => bop::run(arguments),
        Command::A3dp(arguments) => a3dp::run(arguments),
    }
}
