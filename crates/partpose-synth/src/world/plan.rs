//! What kinds of worlds there are: their roads, lanes, and where the camera goes.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt;
use std::str::FromStr;

use partpose::geometry::Point3;

use super::path::Path;
use super::random::unit;
use super::traffic::Lane;

/// A kind of world, after the five of Virtual KITTI.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum SceneKind {
    /// A street between houses with rows of parked vehicles.
    Urban,
    /// A camera that stands at a busy crossroads.
    Intersection,
    /// A winding road through a wood.
    Forest,
    /// Three lanes either way.
    Highway,
}

impl SceneKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Urban, Self::Intersection, Self::Forest, Self::Highway];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Urban => "urban",
            Self::Intersection => "intersection",
            Self::Forest => "forest",
            Self::Highway => "highway",
        }
    }

    /// The first digit of its worlds' names, so that none is taken for one of Virtual KITTI's.
    pub fn digit(self) -> u32 {
        self as u32 + 1
    }
}

impl fmt::Display for SceneKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A word that is no kind of scene.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no kind of scene; there are urban, intersection, forest, highway")]
pub struct UnknownScene(pub String);

impl FromStr for SceneKind {
    type Err = UnknownScene;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|kind| kind.name() == text);
        found.ok_or_else(|| UnknownScene(text.to_owned()))
    }
}

/// Where the crossing road lies in the world of the crossroads, metres ahead of the camera.
pub(crate) const CROSSING: f64 = 24.0;
/// Width of a lane in towns, metres.
pub(crate) const LANE: f64 = 3.3;

/// The roads of a world and who uses them.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    /// The camera's own road first.
    pub(crate) paths: Vec<Path>,
    /// Lanes and the paths they follow.
    pub(crate) lanes: Vec<(usize, Lane)>,
    /// The lane whose vehicle 0 carries the camera; `None` where it stands at the origin.
    pub(crate) own_lane: Option<usize>,
    /// Metres from the path to the camera that stands.
    pub(crate) stand: f64,
}

const NOBODY: Lane = Lane {
    number: 0,
    right: 0.0,
    forward: true,
    parked: false,
    speed: 0.0,
    gap: 6.3,
    delay: 1.1,
    jitter: 0.45,
    empty: 0.2,
    heavy: 0.0,
    within: [-1e7, 1e7],
    start: 0.0,
};

/// The plan of a world whose camera moves for `duration` seconds.
pub(crate) fn plan(kind: SceneKind, seed: u64, duration: f64) -> Plan {
    let vary = |what: i64, low: f64, high: f64| low + (high - low) * unit(seed, &[0x91a, what]);
    let mut plan = match kind {
        SceneKind::Urban => urban(&vary, duration),
        SceneKind::Intersection => intersection(&vary),
        SceneKind::Forest => forest(&vary, duration),
        SceneKind::Highway => highway(&vary, duration),
    };
    for (number, (_, lane)) in plan.lanes.iter_mut().enumerate() {
        lane.number = number as u32;
        // Vehicle 0 of the camera's lane starts at the origin; others start anywhere.
        if plan.own_lane != Some(number) {
            lane.start = vary(100 + number as i64, 0.0, 60.0);
        }
    }
    plan
}

type Vary<'a> = &'a dyn Fn(i64, f64, f64) -> f64;

/// A road that bends and rises: two waves each for direction and height.
fn winding(vary: Vary, bend: f64, rise: f64, length: f64) -> Path {
    let [a, b, c, d] = [1, 2, 3, 4].map(|i| vary(i, 0.0, TAU));
    let (l1, l2) = (vary(5, 70.0, 110.0), vary(6, 31.0, 47.0));
    let (h1, h2) = (vary(7, 60.0, 90.0), vary(8, 27.0, 38.0));
    let heading = move |s: f64| bend * ((s / l1 + a).sin() + 0.35 * (s / l2 + b).sin());
    let height = move |s: f64| rise * ((s / h1 + c).sin() + 0.3 * (s / h2 + d).sin());
    Path::new([-120.0, length], heading, height)
}

/// The plan of a world with one road, whose first lane is the camera's.
fn one_road(path: Path, lanes: Vec<Lane>) -> Plan {
    let lanes = lanes.into_iter().map(|lane| (0, lane)).collect();
    Plan { paths: vec![path], lanes, own_lane: Some(0), stand: 0.0 }
}

fn urban(vary: Vary, duration: f64) -> Plan {
    let speed = vary(20, 6.0, 10.0);
    let path = winding(vary, 0.16, 0.9, speed * duration * 1.2 + 500.0);
    let half = 0.5 * LANE;
    let lanes = vec![
        Lane { right: half, speed, gap: 7.4, empty: 0.35, heavy: 0.06, ..NOBODY },
        Lane {
            right: -half,
            forward: false,
            speed: speed * 0.9,
            gap: 7.6,
            delay: 1.4,
            empty: 0.35,
            heavy: 0.06,
            ..NOBODY
        },
        Lane {
            right: LANE + 1.15,
            parked: true,
            gap: vary(21, 5.9, 6.6),
            empty: vary(22, 0.12, 0.45),
            ..NOBODY
        },
        Lane {
            right: -LANE - 1.15,
            forward: false,
            parked: true,
            gap: vary(23, 5.9, 6.6),
            empty: vary(24, 0.08, 0.3),
            ..NOBODY
        },
    ];
    one_road(path, lanes)
}

fn intersection(vary: Vary) -> Plan {
    let main = Path::new([-120.0, 400.0], |_| 0.0, |s| 0.004 * (s - CROSSING).max(0.0));
    let cross = Path::through(
        &[Point3::new(-300.0, 0.0, CROSSING), Point3::new(300.0, 0.0, CROSSING)],
        -300.0,
    );
    // From the near lane of the crossing road to the right, towards the camera.
    let (x, radius) = (-1.5 * LANE, 7.0);
    let z = CROSSING - 1.5 * LANE;
    let mut turn = vec![Point3::new(x - radius - 200.0, 0.0, z)];
    turn.extend((0..=12).map(|i| {
        let (s, c) = (FRAC_PI_2 * f64::from(i) / 12.0).sin_cos();
        Point3::new(x - radius + radius * s, 0.0, z - radius + radius * c)
    }));
    turn.push(Point3::new(x, 0.0, -150.0));
    let turn = Path::through(&turn, -200.0);
    let half = 0.5 * LANE;
    let busy = |number: i64| vary(30 + number, 6.0, 9.5);
    let crossing = |right: f64, forward: bool, number: i64| Lane {
        right,
        forward,
        speed: busy(number),
        gap: 7.8,
        delay: 1.3,
        empty: 0.25,
        heavy: 0.05,
        ..NOBODY
    };
    let waiting = |right: f64, forward: bool, within: [f64; 2]| Lane {
        right,
        forward,
        gap: 6.8,
        empty: 0.15,
        within,
        ..NOBODY
    };
    let beyond = [CROSSING + 2.0 * LANE + 6.5, 90.0];
    let parked = |right: f64, forward: bool| Lane {
        right,
        forward,
        parked: true,
        empty: 0.25,
        within: [CROSSING + 28.0, 130.0],
        ..NOBODY
    };
    let lanes = vec![
        // The near right lane of the crossing road belongs to those who turn; the others go straight on.
        (2, Lane { speed: busy(1), gap: 8.0, delay: 1.5, empty: 0.3, ..NOBODY }),
        (1, crossing(half, true, 2)),
        (1, crossing(-half, false, 3)),
        (1, crossing(-half - LANE, false, 4)),
        (0, waiting(-half, false, beyond)),
        (0, waiting(-half - LANE, false, beyond)),
        (0, waiting(half + LANE, true, [-40.0, CROSSING - 2.0 * LANE - 8.0])),
        (0, parked(2.0 * LANE + 1.2, true)),
        (0, parked(-2.0 * LANE - 1.2, false)),
    ];
    Plan { paths: vec![main, cross, turn], lanes, own_lane: None, stand: half }
}

fn forest(vary: Vary, duration: f64) -> Plan {
    let speed = vary(20, 9.0, 13.0);
    let path = winding(vary, 0.42, 1.7, speed * duration * 1.2 + 500.0);
    let half = 0.5 * LANE;
    let lanes = vec![
        Lane { right: half, speed, gap: 7.6, delay: 1.25, empty: 0.25, heavy: 0.04, ..NOBODY },
        Lane {
            right: -half,
            forward: false,
            speed: speed * 1.05,
            gap: 20.0,
            delay: 1.8,
            empty: 0.3,
            heavy: 0.08,
            ..NOBODY
        },
    ];
    one_road(path, lanes)
}

/// Width of a lane of a motorway, metres.
pub(crate) const WIDE: f64 = 3.6;
/// Middle of the reservation of a motorway, metres to the right of the middle lane.
pub(crate) const MEDIAN: f64 = -2.0 * WIDE + 0.3;

fn highway(vary: Vary, duration: f64) -> Plan {
    let speed = vary(20, 17.0, 24.0);
    let path = winding(vary, 0.10, 1.6, speed * duration * 1.3 + 700.0);
    let lane = |right: f64, forward: bool, faster: f64, heavy: f64, empty: f64| Lane {
        right,
        forward,
        speed: speed * faster,
        gap: 9.5,
        delay: 0.75,
        jitter: 1.0,
        empty,
        heavy,
        ..NOBODY
    };
    let other = |i: f64| 2.0 * MEDIAN - i * WIDE;
    let lanes = vec![
        lane(0.0, true, 1.0, 0.04, 0.15),
        lane(-WIDE, true, 1.08, 0.0, 0.3),
        lane(WIDE, true, 0.93, 0.16, 0.2),
        lane(other(-1.0), false, 1.1, 0.0, 0.35),
        lane(other(0.0), false, 1.0, 0.06, 0.3),
        lane(other(1.0), false, 0.9, 0.16, 0.3),
    ];
    one_road(path, lanes)
}

/// Where the sun of a world stands: azimuth from z towards x and elevation, radians.
pub(crate) fn sun(kind: SceneKind, seed: u64) -> [f64; 2] {
    let azimuth = TAU * unit(seed, &[0x5a1]);
    let high = unit(seed, &[0x5a2]);
    let elevation = match kind {
        // Through leaves a high sun leaves spots on the road; a low one reaches none of it.
        SceneKind::Forest => 0.75 + 0.35 * high,
        _ => 0.50 + 0.45 * high,
    };
    [azimuth.rem_euclid(2.0 * PI), elevation]
}
