//! Curves of the side view: polylines with rounded corners, and arcs.

/// A point of the side view: z forward, h up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    pub(super) z: f64,
    pub(super) h: f64,
}

impl Point {
    pub(super) fn lerp(self, other: Self, share: f64) -> Self {
        Self { z: self.z + share * (other.z - self.z), h: self.h + share * (other.h - self.h) }
    }

    pub(super) fn distance(self, other: Self) -> f64 {
        (self.z - other.z).hypot(self.h - other.h)
    }
}

/// How the ring leaves the curve towards the side of the vehicle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    /// From the curve to where the side ends, in the side view.
    reach: [f64; 2],
    /// How far the surface recedes in that direction from the middle to where the corner begins.
    pub(super) crown: f64,
    /// Radii of the corner in that direction and across the vehicle.
    pub(super) radii: [f64; 2],
}

impl Edge {
    /// `inwards` is a direction of any length.
    pub(super) fn new(inwards: [f64; 2], crown: f64, radii: [f64; 2]) -> Self {
        let scale = (crown + radii[0]) / inwards[0].hypot(inwards[1]);
        Self { reach: inwards.map(|value| scale * value), crown, radii }
    }

    /// Depth where the side ends.
    pub(super) fn depth(&self) -> f64 {
        self.crown + self.radii[0]
    }

    /// In between; `reach` is mixed as a vector, so that the ends of rings stay in order where their curve does.
    pub(super) fn lerp(&self, other: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + share * (b - a);
        let mix2 = |a: [f64; 2], b: [f64; 2]| [mix(a[0], b[0]), mix(a[1], b[1])];
        Self {
            reach: mix2(self.reach, other.reach),
            crown: mix(self.crown, other.crown),
            radii: mix2(self.radii, other.radii),
        }
    }

    /// The point at a depth below the curve.
    pub(super) fn below(&self, point: Point, depth: f64) -> Point {
        let share = depth / self.depth();
        Point { z: point.z + share * self.reach[0], h: point.h + share * self.reach[1] }
    }
}

/// A corner of a path.
pub(super) struct Knot {
    pub(super) at: Point,
    /// How far before and behind the corner the rounding begins.
    pub(super) round: f64,
    pub(super) edge: Edge,
    /// Rise of the half ellipse to the next knot, which lies at the same height; a straight line without.
    pub(super) arch: Option<f64>,
}

/// A curve from nose to tail; parameter k is at knot k.
pub(super) struct Path(pub(super) Vec<Knot>);

impl Path {
    pub(super) fn last(&self) -> f64 {
        (self.0.len() - 1) as f64
    }

    /// The point at a parameter. Corners are quadratic Bezier curves between the points where rounding begins.
    pub(super) fn at(&self, t: f64) -> Point {
        let t = t.clamp(0.0, self.last());
        let k = (t as usize).min(self.0.len() - 2);
        let share = t - k as f64;
        if let Some(rise) = self.0[k].arch {
            return on_arch(self.0[k].at, self.0[k + 1].at, rise, share);
        }
        let nearest = t.round() as usize;
        if nearest > 0 && nearest < self.0.len() - 1 && self.0[nearest].round > 0.0 {
            let (at, round) = (self.0[nearest].at, self.0[nearest].round);
            let [before, behind] = [self.0[nearest - 1].at, self.0[nearest + 1].at];
            let [from, to] = [before, behind].map(|other| (round / at.distance(other)).min(0.5));
            let offset = t - nearest as f64;
            if offset > -from && offset < to {
                let share = (offset + from) / (from + to);
                let [a, b] = [at.lerp(before, from), at.lerp(behind, to)];
                return a.lerp(at, share).lerp(at.lerp(b, share), share);
            }
        }
        self.0[k].at.lerp(self.0[k + 1].at, share)
    }

    /// How the ring at a parameter leaves the curve.
    pub(super) fn edge(&self, t: f64) -> Edge {
        let t = t.clamp(0.0, self.last());
        let k = (t as usize).min(self.0.len() - 2);
        let share = t - k as f64;
        self.0[k].edge.lerp(&self.0[k + 1].edge, share)
    }

    /// The parameter at a longitudinal position, on a curve along which z decreases.
    pub(super) fn parameter_at(&self, z: f64) -> f64 {
        let [mut low, mut high] = [0.0, self.last()];
        // Halving 50 times exhausts the precision of the parameter.
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if self.at(middle).z > z {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }
}

/// Begins and ends upright, so that z decreases all the way.
fn on_arch(from: Point, to: Point, rise: f64, share: f64) -> Point {
    let (sin, cos) = (std::f64::consts::PI * share).sin_cos();
    let middle = from.lerp(to, 0.5);
    Point { z: middle.z + cos * (from.z - middle.z), h: middle.h + sin * rise }
}
