//! Readers of data sets on invented folders, on hostile ones, and on the published data where that is at hand.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail loudly too")]

mod check;
mod hostile;
mod kitti;
mod published;
mod vkitti1;
mod vkitti2;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use partpose::dataset::SequenceId;
use partpose::geometry::{Camera, Cuboid, EulerAngles, Extent, Pose, Vector3};

/// Camera of Virtual KITTI 1.
const CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);

fn write(root: &Path, path: &str, text: &str) {
    let path = root.join(path);
    fs::create_dir_all(path.parent().expect("a file lies in a folder")).unwrap();
    fs::write(path, text).unwrap();
}

fn id(world: &str, variation: &str) -> SequenceId {
    SequenceId { world: world.to_owned(), variation: variation.to_owned() }
}

/// A vehicle of our own making: extent, bottom centre, and the angles ry, rx, rz of the files.
#[derive(Clone, Copy)]
struct Invented {
    extent: [f64; 3],
    position: [f64; 3],
    angles: [f64; 3],
}

/// Three vehicles in different places, all of them wholly in the image.
const VEHICLES: [Invented; 3] = [
    Invented { extent: [1.8, 1.4, 4.2], position: [-3.0, 1.6, 15.0], angles: [0.4, 0.01, 0.02] },
    Invented { extent: [2.0, 1.7, 4.9], position: [2.0, 1.5, 22.0], angles: [-1.5, 0.02, -0.01] },
    Invented { extent: [1.7, 1.5, 3.8], position: [7.5, 1.4, 31.0], angles: [2.6, -0.01, 0.01] },
];

impl Invented {
    fn cuboid(&self) -> Cuboid {
        let [y, x, z] = self.angles;
        let rotation = EulerAngles { x, y: y + std::f64::consts::FRAC_PI_2, z }.to_rotation();
        Cuboid {
            camera_from_vehicle: Pose::from_parts(
                Vector3::from(self.position).into(),
                nalgebra::UnitQuaternion::from_rotation_matrix(&rotation),
            ),
            extent: Extent::new(self.extent[0], self.extent[1], self.extent[2]),
        }
    }

    /// Left, top, right, bottom, rounded to pixels.
    fn bounds(&self) -> [f64; 4] {
        let rect = self.cuboid().project(&CAMERA).unwrap();
        [rect.x_min, rect.y_min, rect.x_max, rect.y_max].map(f64::round)
    }

    /// A row of `motgt` for frame and track.
    fn motgt(&self, frame: u32, track: u32) -> String {
        let [l, t, r, b] = self.bounds();
        let ([w, h, d], [x, y, z], [ry, rx, rz]) = (self.extent, self.position, self.angles);
        let alpha = ry - x.atan2(z);
        format!(
            "{frame} {track} Car 0 0 {alpha} {l} {t} {r} {b} {w} {h} {d} {x} {y} {z} {ry} {rx} {rz} 0 0.7 Car 1 Sedan Red\n"
        )
    }
}

const MOTGT_HEADER: &str = "frame tid label truncated occluded alpha l t r b w3d h3d l3d x3d y3d z3d ry rx rz truncr occupr orig_label moving model color\n";

/// A Virtual KITTI 1 folder with the given rows and cameras for frames 0 to 3.
fn vkitti1(rows: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().to_owned();
    write(&root, "vkitti_1.3.1_motgt/0001_clone.txt", &format!("{MOTGT_HEADER}{rows}"));
    let mut extrinsics =
        "frame r1,1 r1,2 r1,3 t1 r2,1 r2,2 r2,3 t2 r3,1 r3,2 r3,3 t3 0 0.1 0.2 1\n".to_owned();
    for frame in 0..4 {
        let row = format!("{frame} 1 0 0 0.5 0 1 0 100 0 0 1 -{frame} 0 0 0 1\n");
        extrinsics += &row;
    }
    write(&root, "vkitti_1.3.1_extrinsicsgt/0001_clone.txt", &extrinsics);
    (folder, root)
}

/// All three vehicles in frames 0 to 3.
fn good_rows() -> String {
    let mut rows = String::new();
    for frame in 0..4 {
        for (track, vehicle) in (0..).zip(VEHICLES) {
            rows += &vehicle.motgt(frame, track);
        }
    }
    rows
}

/// The published data, or `None` with a word about it where they are absent.
fn published(name: &str) -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if root.is_dir() {
        return Some(root);
    }
    let _ = writeln!(std::io::stdout(), "skipped: `{}` is not there", root.display());
    None
}
