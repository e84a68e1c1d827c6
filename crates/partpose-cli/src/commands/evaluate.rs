//! `partpose evaluate`: scores boxes, masks, poses and solvers against ground truth.

mod a3dp;
mod bop;
mod boxes;
mod coco;
mod kitti;
mod masks;
mod pnp;
mod poses;
mod scores;
mod selection;
mod source;
mod tracks;

use crate::report::Outcome;

#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Table I: boxes that a detector finds, and COCO's average precision
    Boxes(boxes::Arguments),
    /// Table II: part masks that a detector finds, by class and by kernel
    Masks(masks::Arguments),
    /// Tables III to V: poses of the labelled vehicles of a data set
    Poses(poses::Arguments),
    /// Vehicles followed through sequences: whether they keep their numbers, and what that does for their poses
    Tracks(tracks::Arguments),
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
        Command::Boxes(arguments) => boxes::run(arguments),
        Command::Masks(arguments) => masks::run(arguments),
        Command::Poses(arguments) => poses::run(arguments),
        Command::Tracks(arguments) => tracks::run(arguments),
        Command::Pnp(arguments) => pnp::run(arguments),
        Command::Kitti(arguments) => kitti::run(arguments),
        Command::Coco(arguments) => coco::run(arguments),
        Command::Bop(arguments) => bop::run(arguments),
        Command::A3dp(arguments) => a3dp::run(arguments),
    }
}
