//! Whether all rows follow another convention than the reader takes them to.
//!
//! Every combination of the usual mistakes (order of the sizes, location at the centre of the box, yaw counted from
//! another direction or the other way round, angles in another order) is tried on the rows; where one fits far better
//! than what was read, the file or its writer has made that mistake. Turns by 180 degrees leave a box as it is and
//! cannot be seen.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Translation3, UnitQuaternion};

use crate::geometry::{Cuboid, EulerAngles, Extent, Pose};

use super::super::Layout;
use super::reprojection::{Sample, error};

/// Rows that are tried, spread evenly.
const ROWS: usize = 2000;
/// Fewer rows prove nothing.
const MIN_ROWS: usize = 4;
/// Mean error up to which nothing is suspected, pixels; that of the published rows is 0.84.
const FINE: f64 = 1.2;
/// How much smaller the mean error must become. Some mistakes hide in most rows (a yaw of 90 degrees gives the same box
/// with the wrong sign, cars are about as wide as high), so that no more than this can be asked for.
const BETTER: f64 = 0.6;
/// Larger errors count as this, so that single mad rows do not decide, pixels.
const CLIP: f64 = 100.0;

/// For width, height and length the place (0, 1, 2) where each was read.
type SizeOrder = [usize; 3];

/// How rows may have been meant.
#[derive(Clone, Copy, PartialEq)]
struct Convention {
    sizes: SizeOrder,
    location: Location,
    yaw: Yaw,
    angles: Angles,
}

#[derive(Clone, Copy, PartialEq)]
enum Location {
    Bottom,
    Center,
}

#[derive(Clone, Copy, PartialEq)]
enum Yaw {
    FromRight,
    FromForward,
    Reversed,
}

#[derive(Clone, Copy, PartialEq)]
enum Angles {
    YawFirst,
    PitchFirst,
}

const AS_READ: Convention = Convention {
    sizes: [0, 1, 2],
    location: Location::Bottom,
    yaw: Yaw::FromRight,
    angles: Angles::YawFirst,
};

/// What is probably wrong with all rows, if something is.
pub(super) fn detect(layout: Layout, samples: &[Sample]) -> Option<String> {
    let step = samples.len().div_ceil(ROWS).max(1);
    let samples: Vec<&Sample> = samples.iter().step_by(step).collect();
    let as_read = mean_error(&samples, &AS_READ);
    if samples.len() < MIN_ROWS || as_read <= FINE {
        return None;
    }
    let mut best = (as_read, AS_READ);
    // From few deviations to many: a later one must be clearly better to be believed.
    let mut conventions = conventions();
    conventions.sort_by_key(Convention::deviations);
    for convention in conventions {
        // A quarter turn and an exchange of width and length are the same box; vehicles are longer than wide.
        let long = |sample: &&&Sample| {
            let side = sample.cuboid.extent.to_vector();
            side[convention.sizes[2]] >= side[convention.sizes[0]]
        };
        if 2 * samples.iter().filter(long).count() < samples.len() {
            continue;
        }
        let error = mean_error(&samples, &convention);
        if error < 0.9 * best.0 {
            best = (error, convention);
        }
    }
    let (error, convention) = best;
    (error < BETTER * as_read).then(|| {
        format!(
            "{}: so the boxes fit to {error:.1} px in the mean instead of {as_read:.1}",
            convention.describe(layout)
        )
    })
}

fn conventions() -> Vec<Convention> {
    const ORDERS: [SizeOrder; 6] =
        [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut all = Vec::new();
    for sizes in ORDERS {
        for location in [Location::Bottom, Location::Center] {
            for yaw in [Yaw::FromRight, Yaw::FromForward, Yaw::Reversed] {
                for angles in [Angles::YawFirst, Angles::PitchFirst] {
                    all.push(Convention { sizes, location, yaw, angles });
                }
            }
        }
    }
    all
}

fn mean_error(samples: &[&Sample], convention: &Convention) -> f64 {
    let best = |sample: &&Sample| {
        let readings = convention.apply(&sample.cuboid);
        readings.iter().map(|cuboid| error(sample, cuboid)).fold(f64::INFINITY, f64::min)
    };
    let sum: f64 = samples.iter().map(|sample| best(sample).min(CLIP)).sum();
    sum / samples.len().max(1) as f64
}

impl Convention {
    fn deviations(&self) -> usize {
        usize::from(self.sizes != AS_READ.sizes)
            + usize::from(self.location != AS_READ.location)
            + usize::from(self.yaw != AS_READ.yaw)
            + usize::from(self.angles != AS_READ.angles)
    }

    /// The cuboid that was meant; two where the angles that were read do not determine those of the file.
    fn apply(&self, read: &Cuboid) -> Vec<Cuboid> {
        let side = read.extent.to_vector();
        let [width, height, length] = self.sizes.map(|at| side[at]);
        let pose = read.camera_from_vehicle;
        let angles = EulerAngles::from_rotation(&pose.rotation.to_rotation_matrix());
        let readings = match self.angles {
            Angles::YawFirst => vec![self.turn(angles)],
            Angles::PitchFirst => {
                // The same rotation has a second triple of angles, and it is this one if the pitch is large.
                let half = std::f64::consts::PI;
                let other =
                    EulerAngles { x: half - angles.x, y: angles.y + half, z: angles.z + half };
                // The file's columns are ry, rx, rz; the quarter turn went to what was taken for ry.
                let swap = |read: EulerAngles| EulerAngles {
                    x: read.y - FRAC_PI_2,
                    y: read.x + FRAC_PI_2,
                    z: read.z,
                };
                vec![self.turn(swap(angles)), self.turn(swap(other))]
            }
        };
        let down = match self.location {
            Location::Bottom => 0.0,
            Location::Center => 0.5 * height,
        };
        let cuboid = |angles: EulerAngles| {
            let rotation = UnitQuaternion::from_rotation_matrix(&angles.to_rotation());
            Cuboid {
                camera_from_vehicle: Pose::from_parts(pose.translation, rotation)
                    * Translation3::new(0.0, down, 0.0),
                extent: Extent::new(width, height, length),
            }
        };
        readings.into_iter().map(cuboid).collect()
    }

    fn turn(&self, angles: EulerAngles) -> EulerAngles {
        let y = match self.yaw {
            Yaw::FromRight => angles.y,
            Yaw::FromForward => angles.y - FRAC_PI_2,
            // Read as ry + 90 degrees, meant as -ry + 90 degrees.
            Yaw::Reversed => std::f64::consts::PI - angles.y,
        };
        EulerAngles { y, ..angles }
    }

    fn describe(&self, layout: Layout) -> String {
        let columns = match layout {
            Layout::VirtualKitti1 => ["w3d", "h3d", "l3d"],
            Layout::VirtualKitti2 => ["width", "height", "length"],
            Layout::Kitti => ["w", "h", "l"],
        };
        let sizes = ["width", "height", "length"];
        let mut findings = Vec::new();
        for (at, column) in columns.iter().enumerate() {
            let held = self.sizes.iter().position(|from| *from == at).unwrap_or(at);
            if held != at {
                findings.push(format!("column `{column}` seems to hold the {}", sizes[held]));
            }
        }
        if self.location == Location::Center {
            findings.push(
                "locations seem to be centres of the boxes, not of their bottom faces".to_owned(),
            );
        }
        match self.yaw {
            Yaw::FromRight => {}
            Yaw::FromForward => findings.push(
                "the yaw seems to lack a quarter turn: 0 faces along z, not along x".to_owned(),
            ),
            Yaw::Reversed => findings.push("the yaw seems to have the other sign".to_owned()),
        }
        if self.angles == Angles::PitchFirst {
            findings.push("the columns of yaw and pitch seem to be exchanged".to_owned());
        }
        findings.join("; ")
    }
}
