//! Roads, houses, plants and traffic of a sequence, at any moment of it.
//!
//! A [`World`] is a pure function of time: [`World::moment`] gives what is there in a frame and needs no frame before
//! it. Roads are furnished in pieces of 40 m as the camera comes near; a few pieces are kept, so that memory does not
//! grow with the length of a sequence (but for 32 bytes for every metre of road).

mod buildings;
mod catalog;
mod crossroads;
mod fleet;
mod forest;
mod furniture;
mod heavy;
mod motorway;
mod path;
mod people;
mod plan;
mod plants;
mod population;
mod random;
mod replay;
mod scenery;
mod shapes;
mod site;
mod street;
mod stuff;
mod traffic;
mod urban;
mod variation;

use std::sync::Arc;

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use partpose::geometry::{Camera, Extent, Point3, Pose};

use crate::scene::{Object, Scene};
use crate::vehicles::{Lamps, Riders};

pub use fleet::Fleet;
pub use plan::{SceneKind, UnknownScene};
pub use replay::{Layout, LayoutError};
pub use variation::{UnknownVariation, Variation};

pub(crate) use random::hash;

use fleet::Vehicle;
use plan::Plan;
use population::Candidate;
use scenery::Scenery;

/// Farthest vehicles, metres from the camera: at 725 px they are 8 px high.
const FARTHEST: f64 = 130.0;
/// How long the shutter is open, seconds.
const EXPOSURE: f64 = 0.003;

/// How the camera is mounted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraOptions {
    /// The ideal camera.
    pub camera: Camera,
    /// Height above the road, metres.
    pub height: f64,
    /// How far it looks down, radians.
    pub pitch: f64,
    /// How far it is turned clockwise about its axis, radians.
    pub roll: f64,
    /// Worlds differ from these by up to this share of the height and this angle in radians; 0 for none.
    pub spread: [f64; 2],
}

impl Default for CameraOptions {
    fn default() -> Self {
        Self {
            camera: Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]),
            height: 1.6,
            pitch: 0.0,
            roll: 0.0,
            spread: [0.08, 0.02],
        }
    }
}

/// A world to be made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldOptions {
    /// Its kind.
    pub kind: SceneKind,
    /// Which of its kind, from 0.
    pub index: u32,
    /// The seed of everything random.
    pub seed: u64,
    /// How long it is driven through at most, seconds; does not change what is there at any time.
    pub duration: f64,
    /// The camera.
    pub camera: CameraOptions,
    /// Share of parked vehicles that have a door or the boot open.
    pub open: f64,
}

/// The world of a sequence.
#[derive(Debug)]
pub struct World {
    seed: u64,
    plan: Plan,
    sun: [f64; 2],
    camera: CameraOptions,
    open: f64,
    scenery: Scenery,
    fleet: Arc<Fleet>,
    layout: Option<Arc<Layout>>,
}

/// A moment of a world.
#[derive(Clone, Debug)]
pub struct Moment {
    /// What is to be drawn.
    pub scene: Scene,
    /// Vehicles by [`Object::instance`], which counts from 1; not all of them are seen.
    pub vehicles: Vec<PlacedVehicle>,
}

/// A part-labelled vehicle in its place.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedVehicle {
    /// Its number, the same in all frames.
    pub track: u32,
    /// `Car` or `Van`.
    pub category: String,
    /// Name of its model.
    pub model: String,
    /// Name of its colour.
    pub color: &'static str,
    /// Its size, closed.
    pub extent: Extent,
    /// Faces that stand out of its cuboid, mirrors and what is open; vehicle frame, metres.
    pub beyond: Vec<[Point3; 3]>,
    /// Where it is.
    pub world_from_vehicle: Pose,
    /// Whether it moves between this frame and the next.
    pub moving: bool,
}

impl World {
    /// Makes a world; what is costly is shared through the fleet.
    pub fn new(options: &WorldOptions, fleet: Arc<Fleet>) -> Self {
        let words = [0x3071d, options.kind as i64, i64::from(options.index)];
        let seed = random::hash(options.seed, &words);
        Self {
            seed,
            plan: plan::plan(options.kind, seed, options.duration),
            sun: plan::sun(options.kind, seed),
            camera: vary_camera(&options.camera, seed),
            open: options.open,
            scenery: Scenery::new(options.kind, seed),
            fleet,
            layout: None,
        }
    }

    /// A world around the camera path and the vehicles of a data set's sequence.
    pub fn from_layout(layout: Arc<Layout>, seed: u64, fleet: Arc<Fleet>) -> Self {
        let kind = layout.kind();
        let seed = random::hash(seed, &[0x1a707]);
        Self {
            seed,
            plan: Plan {
                paths: vec![layout.path()],
                lanes: Vec::new(),
                own_lane: None,
                stand: 0.0,
            },
            sun: plan::sun(kind, seed),
            camera: CameraOptions { camera: layout.camera(), ..CameraOptions::default() },
            open: 0.0,
            scenery: Scenery::around(kind, seed, &layout),
            fleet,
            layout: Some(layout),
        }
    }

    /// What there is at a time, for a variation; `interval` is the time to the next frame, seconds, and `frame` counts
    /// where a layout is replayed.
    pub fn moment(&self, frame: u32, interval: f64, variation: Variation) -> Moment {
        let time = f64::from(frame) * interval;
        let clone = self.camera_pose(frame, time);
        let turn = variation.turned_from_clone().inverse();
        let world_from_camera = clone * turn;
        let after = if self.layout.is_some() {
            world_from_camera
        } else {
            self.camera_pose(frame, time + EXPOSURE) * turn
        };
        let own = self.own_place(&clone, time);
        let mut objects = self.scenery.around_place(&self.plan, own);
        let mut candidates = match &self.layout {
            Some(layout) => layout.candidates(frame, &self.fleet, self.seed),
            None => self.traffic(own, time),
        };
        candidates.retain(|candidate| near(candidate, &world_from_camera));
        let mut vehicles = Vec::new();
        let mut world_from_vehicles_after = Vec::new();
        let dim = variation.is_dim();
        for candidate in candidates {
            match candidate {
                Candidate::Vehicle { vehicle, place, track } => {
                    let own = random::hash(self.seed, &[0x1a3b, i64::from(track)]);
                    let (lamps, riders) = (lamps(&place, dim, own, time), riders(&place, own));
                    let pose = place.world_from_vehicle;
                    let instance = vehicles.len() as u16 + 1;
                    objects.push(self.fleet.object(&vehicle, pose, lamps, riders, instance));
                    vehicles.push(self.placed(&vehicle, track, pose, place.moving));
                    let way = Translation3::new(0.0, 0.0, place.speed * EXPOSURE);
                    world_from_vehicles_after.push(pose * way);
                }
                Candidate::Other(object) => objects.push(object),
            }
        }
        if self.layout.is_none() {
            objects.extend(population::walkers(&self.plan, &self.scenery, self.seed, own, time));
        }
        let [azimuth, height] = self.sun;
        let scene = Scene {
            objects,
            light: variation.light(azimuth, height),
            air: variation.air(),
            camera: self.camera.camera,
            world_from_camera,
            world_from_camera_after: after,
            world_from_vehicles_after,
        };
        Moment { scene, vehicles }
    }

    fn placed(&self, vehicle: &Vehicle, track: u32, pose: Pose, moving: bool) -> PlacedVehicle {
        let kind = self.fleet.kind(vehicle);
        let scale = vehicle.extent.ratio(&kind.extent);
        let scaled = |corner: Point3| Point3::from(corner.coords.component_mul(&scale));
        PlacedVehicle {
            track,
            category: kind.category.clone(),
            model: kind.name.clone(),
            color: vehicle.color_name(),
            extent: vehicle.extent,
            beyond: kind.beyond.iter().map(|corners| corners.map(scaled)).collect(),
            world_from_vehicle: pose,
            moving,
        }
    }

    /// Pose of the clone's camera: on its vehicle, which nods and sways a little.
    fn camera_pose(&self, frame: u32, time: f64) -> Pose {
        if let Some(layout) = &self.layout {
            return layout.camera_pose(frame);
        }
        let path = &self.plan.paths[0];
        let (place, nod, sway) = match self.plan.own_lane {
            Some(own) => {
                let lane = &self.plan.lanes[own].1;
                let s = lane.along(self.seed, 0, time);
                let pull = lane.along(self.seed, 0, time + 0.4) - 2.0 * s
                    + lane.along(self.seed, 0, time - 0.4);
                let drift = 0.12 * (0.31 * time + 1.0).sin();
                let bumps = 0.0025 * (4.1 * time).sin() + 0.0015 * (9.7 * time + 2.0).sin();
                let nod = bumps - 0.02 * pull / 0.16 * 0.1;
                (path.beside(s, lane.right + drift), nod, 0.003 * (3.3 * time).sin())
            }
            None => (path.beside(0.0, self.plan.stand), 0.0, 0.0),
        };
        let [x, z] = [self.camera.pitch + nod, self.camera.roll + sway];
        // Looking down is a turn about x that takes z towards y: negative by the right hand, since y points down.
        let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -x)
            * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), z);
        place * Pose::from_parts(Translation3::new(0.0, -self.camera.height, 0.0), turn)
    }

    /// How far along its road the camera is.
    fn own_place(&self, clone: &Pose, time: f64) -> f64 {
        match (&self.layout, self.plan.own_lane) {
            (Some(layout), _) => layout.along(clone),
            (None, Some(own)) => self.plan.lanes[own].1.along(self.seed, 0, time),
            (None, None) => 0.0,
        }
    }

    fn traffic(&self, own: f64, time: f64) -> Vec<Candidate> {
        let mut found = Vec::new();
        for (number, (path, lane)) in self.plan.lanes.iter().enumerate() {
            let own = if *path == 0 { own } else { 0.0 };
            let stretch = [own - 40.0, own + FARTHEST + 10.0];
            let stretch = if *path == 0 { stretch } else { [-FARTHEST, FARTHEST] };
            for place in lane.places(&self.plan.paths[*path], self.seed, time, stretch) {
                let is_camera = self.plan.own_lane == Some(number) && place.index == 0;
                if is_camera || !lane.is_taken(self.seed, place.index) {
                    continue;
                }
                found.push(if lane.is_heavy(self.seed, place.index) {
                    let heavies = self.scenery.heavies();
                    let heavy = &heavies[lane.choice(self.seed, place.index, heavies.len())];
                    Candidate::Other(heavy.at(place.world_from_vehicle))
                } else {
                    let words = lane.words(place.index);
                    let vehicle = self.fleet.vehicle(self.seed, &words);
                    let own = [0x09e4, words[1], words[2]];
                    let is_open = lane.parked && random::unit(self.seed, &own) < self.open;
                    let vehicle = if is_open {
                        self.fleet.opened(vehicle, random::hash(self.seed, &own))
                    } else {
                        vehicle
                    };
                    Candidate::Vehicle { vehicle, place, track: lane.track(place.index) }
                });
            }
        }
        found
    }
}

/// The camera of a world: as asked, within the spread.
fn vary_camera(options: &CameraOptions, seed: u64) -> CameraOptions {
    let own = |what: i64| 2.0 * random::unit(seed, &[0xca3, what]) - 1.0;
    let [height, angle] = options.spread;
    CameraOptions {
        height: options.height * (1.0 + height * own(1)),
        pitch: options.pitch + angle * own(2),
        roll: options.roll + 0.5 * angle * own(3),
        ..*options
    }
}

/// Whether a candidate can be seen or throws a shadow into the picture.
fn near(candidate: &Candidate, world_from_camera: &Pose) -> bool {
    let at = match candidate {
        Candidate::Vehicle { place, .. } => place.world_from_vehicle.translation.vector,
        Candidate::Other(Object { world_from_object, .. }) => world_from_object.translation.vector,
    };
    let in_camera = world_from_camera.inverse() * nalgebra::Point3::from(at);
    in_camera.z > -20.0 && in_camera.coords.norm() < FARTHEST
}

/// Nobody drives by itself; a few sit in vehicles that stand.
fn riders(place: &traffic::Place, own: u64) -> Riders {
    let share = |what: i64| random::unit(own, &[what]);
    let driver = !place.parked || share(7) < 0.04;
    Riders { driver, beside: driver && share(8) < 0.32, behind: driver && share(9) < 0.14 }
}

/// Who drives has running lights, or head lamps when it is dim; a few blink.
fn lamps(place: &traffic::Place, dim: bool, own: u64, time: f64) -> Lamps {
    let driving = place.moving || place.braking;
    let share = |what: i64| random::unit(own, &[what]);
    let head = driving && (dim || share(1) < 0.2);
    let is_bright = (1.5 * time + share(2)).fract() < 0.5;
    let side = share(3);
    let [left, right] = if driving {
        [side < 0.04, side > 0.95]
    } else {
        // Some that stand have their hazard lights on, some are about to leave.
        [side < 0.03, side < 0.012]
    };
    Lamps {
        head,
        daytime: driving && !head && share(4) < 0.7,
        brake: place.braking || (!driving && share(5) < 0.02),
        left: left && is_bright,
        right: right && is_bright,
        reverse: !driving && share(6) < 0.01,
    }
}
