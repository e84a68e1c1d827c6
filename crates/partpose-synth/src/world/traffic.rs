//! Vehicles on lanes as a function of time.
//!
//! A follower drives as the vehicle ahead of it did a moment earlier and a little further on (Newell: *A simplified
//! car-following theory: a lower order model*, Transportation Research B 36, 2002). With one function for the progress of
//! a whole lane the place of every vehicle at every time is a formula: no frame needs the one before it, and nobody
//! runs into anybody.

use std::f64::consts::TAU;

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use partpose::geometry::Pose;

use super::path::Path;
use super::random::{hash, unit};

/// Vehicles one after the other on a line beside a path.
#[derive(Clone, Debug)]
pub(crate) struct Lane {
    /// Number of the lane in its world; makes its vehicles different from those of others.
    pub(crate) number: u32,
    /// Metres to the right of the path.
    pub(crate) right: f64,
    /// Along the path, or against it.
    pub(crate) forward: bool,
    /// Whether its vehicles are parked: nobody sits in them.
    pub(crate) parked: bool,
    /// Mean speed, m/s; 0 for those that stand.
    pub(crate) speed: f64,
    /// Distance of two vehicles that stand, front to front, metres.
    pub(crate) gap: f64,
    /// How much later a follower does the same, seconds.
    pub(crate) delay: f64,
    /// Largest deviation from even spacing, metres; less than half of what the gap leaves.
    pub(crate) jitter: f64,
    /// Share of the places that are empty.
    pub(crate) empty: f64,
    /// Share of lorries and buses.
    pub(crate) heavy: f64,
    /// Where its vehicles are allowed, metres along the path.
    pub(crate) within: [f64; 2],
    /// Place of vehicle 0 at time 0, metres along the lane's own direction.
    pub(crate) start: f64,
}

/// One place of a lane at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Counted along the lane; the same vehicle at all times.
    pub(crate) index: i64,
    pub(crate) world_from_vehicle: Pose,
    /// Whether it moves.
    pub(crate) moving: bool,
    /// How fast, ahead, m/s.
    pub(crate) speed: f64,
    /// Whether it brakes.
    pub(crate) braking: bool,
    /// Whether it stands by the road, and not in the traffic.
    pub(crate) parked: bool,
}

/// Period of the waves of speed, seconds.
const WAVE: f64 = 19.0;
/// Share by which the speed differs from the mean.
const SWING: f64 = 0.55;

impl Lane {
    /// How far vehicle 0 has come by a time.
    pub(crate) fn progress(&self, seed: u64, time: f64) -> f64 {
        let phase = TAU * unit(seed, &[0x1a4e, i64::from(self.number)]);
        let wave = TAU / WAVE;
        self.speed * (time + SWING / wave * ((wave * time + phase).sin() - phase.sin()))
    }

    /// Speed of vehicle 0 at a time, m/s.
    fn pace(&self, seed: u64, time: f64) -> f64 {
        (self.progress(seed, time + 0.05) - self.progress(seed, time - 0.05)) / 0.1
    }

    /// Place of a vehicle along its direction of travel.
    pub(crate) fn along(&self, seed: u64, index: i64, time: f64) -> f64 {
        let own = if index == 0 {
            0.0
        } else {
            2.0 * unit(seed, &[0x71, i64::from(self.number), index]) - 1.0
        };
        self.start
            + self.progress(seed, time + index as f64 * self.delay)
            + index as f64 * self.gap
            + own * self.jitter
    }

    /// Everybody within a stretch of the path at a time. Whether a place is taken is for [`Self::is_taken`] to say.
    pub(crate) fn places(
        &self,
        path: &Path,
        seed: u64,
        time: f64,
        stretch: [f64; 2],
    ) -> Vec<Place> {
        let stretch = [stretch[0].max(self.within[0]), stretch[1].min(self.within[1])];
        if stretch[0] >= stretch[1] {
            return Vec::new();
        }
        let [low, high] = if self.forward { stretch } else { [-stretch[1], -stretch[0]] };
        let wobble = self.speed * SWING * WAVE / TAU * 2.0 + self.jitter;
        let each = self.gap + self.speed * self.delay;
        let base = self.start + self.speed * time;
        let first = ((low - base - wobble) / each).floor() as i64;
        let last = ((high - base + wobble) / each).ceil() as i64;
        let mut places = Vec::new();
        for index in first..=last {
            let along = self.along(seed, index, time);
            if along < low || along > high {
                continue;
            }
            let own_time = time + index as f64 * self.delay;
            let pace = self.pace(seed, own_time);
            places.push(Place {
                index,
                world_from_vehicle: self.pose(path, seed, index, along, time),
                moving: pace > 0.02,
                parked: self.parked,
                speed: pace,
                braking: self.speed > 0.0 && self.pace(seed, own_time + 0.3) < pace - 0.2,
            });
        }
        places
    }

    /// Where a vehicle is: in its lane, with a little drift if it drives, a little askew if it is parked.
    fn pose(&self, path: &Path, seed: u64, index: i64, along: f64, time: f64) -> Pose {
        let own = |what: i64| 2.0 * unit(seed, &[what, i64::from(self.number), index]) - 1.0;
        let (side, turn) = if self.speed > 0.0 {
            let phase = TAU * own(0x51);
            let rate = 0.35;
            let side = 0.18 * (rate * time + phase).sin() + 0.15 * own(0x52);
            (side, 0.18 * rate * (rate * time + phase).cos() / self.speed.max(2.0))
        } else {
            (0.14 * own(0x53), 0.035 * own(0x54))
        };
        let s = if self.forward { along } else { -along };
        // Who parks does so facing either way, though mostly with the traffic.
        let backwards = self.speed == 0.0 && own(0x55) > 0.7;
        let half_turn = if self.forward == backwards { std::f64::consts::PI } else { 0.0 };
        path.beside(s, self.right)
            * Pose::from_parts(
                Translation3::new(side, 0.0, 0.0),
                UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn + half_turn),
            )
    }

    /// Whether a place holds a lorry or a bus.
    pub(crate) fn is_heavy(&self, seed: u64, index: i64) -> bool {
        self.heavy > 0.0
            && index.rem_euclid(2) == 1
            && unit(seed, &[0x6e, i64::from(self.number), index]) < 2.0 * self.heavy
    }

    /// Whether a place holds anybody; beside lorries nobody does, since they are long.
    pub(crate) fn is_taken(&self, seed: u64, index: i64) -> bool {
        let crowded = self.gap + self.speed * self.delay * (1.0 - SWING) < 17.0;
        unit(seed, &[0x3e, i64::from(self.number), index]) >= self.empty
            && !(crowded
                && !self.is_heavy(seed, index)
                && (self.is_heavy(seed, index - 1) || self.is_heavy(seed, index + 1)))
    }

    /// The number of a vehicle among all of its world: a track.
    pub(crate) fn track(&self, index: i64) -> u32 {
        // 2^17 vehicles a lane, 2^5 lanes: 22 bits, which the colours of instances rely on.
        let place = (index + (1 << 16)).rem_euclid(1 << 17) as u32;
        (self.number % 32) << 17 | place
    }

    /// The seed words of a vehicle.
    pub(crate) fn words(&self, index: i64) -> [i64; 3] {
        [0x7ec, i64::from(self.number), index]
    }

    /// A number that chooses one of `count` things for a place.
    pub(crate) fn choice(&self, seed: u64, index: i64, count: usize) -> usize {
        (hash(seed, &[0xc401, i64::from(self.number), index]) % count.max(1) as u64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lane() -> Lane {
        Lane {
            number: 3,
            right: 1.7,
            forward: true,
            parked: false,
            speed: 8.0,
            gap: 7.5,
            delay: 1.1,
            jitter: 0.4,
            empty: 0.0,
            heavy: 0.0,
            within: [-1e9, 1e9],
            start: 0.0,
        }
    }

    #[test]
    fn nobody_runs_into_anybody() {
        let lane = lane();
        for step in 0..600 {
            let time = f64::from(step) * 0.1;
            for index in -4..8 {
                let ahead = lane.along(9, index + 1, time) - lane.along(9, index, time);
                assert!(ahead > 6.0, "{ahead} at {time}");
                assert!(lane.along(9, index, time + 0.1) >= lane.along(9, index, time));
            }
        }
    }

    #[test]
    fn all_in_a_stretch_are_found_whatever_the_direction() {
        let path = Path::new([-100.0, 500.0], |_| 0.0, |_| 0.0);
        for forward in [true, false] {
            let lane = Lane { forward, ..lane() };
            for time in [0.0, 7.3, 41.9] {
                let wide = lane.places(&path, 5, time, [-80.0, 300.0]);
                let narrow = lane.places(&path, 5, time, [0.0, 100.0]);
                let inside = wide.iter().filter(|place| {
                    (0.0..=100.0).contains(&place.world_from_vehicle.translation.z)
                });
                // Drift moves nobody along the path by more than a hair.
                assert!(inside.count().abs_diff(narrow.len()) <= 1);
                assert!(narrow.len() > 3);
            }
        }
    }

    #[test]
    fn tracks_are_unique_and_small() {
        let lane = lane();
        let mut tracks: Vec<u32> = (-300..300).map(|index| lane.track(index)).collect();
        tracks.sort_unstable();
        tracks.dedup();
        assert_eq!(tracks.len(), 600);
        assert!(tracks.iter().all(|track| *track < 1 << 22));
    }
}
