//! Vehicles made from a few dozen lengths, heights and angles.
//!
//! The body is lofted: two curves of the side view, over the car (`top`) and under it (`bottom`, with the wheel
//! arches), are joined at stations along the car by half rings, each of which runs from the middle of the floor round
//! the sill, up the side with its tuck-in, belt and tumblehome, round the edge and over to the middle of the roof
//! (`loft.rs`). Where rings pinch at nose and tail the corners of the bumpers arise. Seams between parts are then cut
//! into this surface exactly along implicit curves (`seams.rs`), wheels and mirrors are added (`fittings.rs`), and the
//! half is mirrored. All body styles are to share this one space of parameters.
//!
//! Limits: no interior, no glass thickness, plain bumpers; one side crease at most.

mod fittings;
mod half;
mod loft;
mod path;
mod regions;
mod seams;

use crate::geometry::Extent;

use super::{ModelError, VehicleModel};

/// The shape of a vehicle. Lengths are metres, angles degrees; heights are above the ground.
///
/// Behind and ahead are along the vehicle; rakes are measured from the vertical, so that larger is flatter.
#[derive(Clone, Debug, PartialEq)]
pub struct ParametricVehicle {
    /// Name of the model.
    pub name: String,
    /// The data set's kind of vehicle.
    pub category: String,
    /// The body style.
    pub body_style: String,

    /// From the foremost to the rearmost point.
    pub length: f64,
    /// Of the body, without mirrors.
    pub width: f64,
    /// Of the highest point of the roof.
    pub height: f64,
    /// Between the axles.
    pub wheelbase: f64,
    /// From the foremost point to the front axle.
    pub front_overhang: f64,
    /// Between the centres of the wheels of an axle.
    pub track: f64,
    /// Outer diameter of the tyres.
    pub wheel_diameter: f64,
    /// Width of the tyres.
    pub tyre_width: f64,
    /// Height of the sills' lower edge.
    pub ground_clearance: f64,

    /// Height of the foremost point.
    pub nose_height: f64,
    /// Height of the upper edge of the front bumper, where the headlamps begin.
    pub front_bumper_height: f64,
    /// Height of the front edge of the hood.
    pub hood_front_height: f64,
    /// How far behind the foremost point the hood begins.
    pub hood_setback: f64,
    /// Height of the foot of the windscreen.
    pub cowl_height: f64,
    /// How far behind the front axle the foot of the windscreen lies.
    pub cowl_setback: f64,
    /// Rake of the windscreen.
    pub windscreen_rake: f64,
    /// How far below the highest point the upper edge of the windscreen lies.
    pub header_drop: f64,
    /// How far below the highest point the upper edge of the rear window lies.
    pub roof_end_drop: f64,
    /// Rake of the rear window.
    pub rear_window_rake: f64,
    /// Height of the foot of the rear window.
    pub deck_height: f64,
    /// From the foot of the rear window to the rear edge of the trunk lid; nearly none without a notch.
    pub deck_length: f64,
    /// Height of the rear edge of the trunk lid.
    pub lip_height: f64,
    /// How far ahead of the rearmost point the rear edge of the trunk lid lies.
    pub lip_setback: f64,
    /// Height of the upper edge of the rear bumper.
    pub rear_bumper_height: f64,
    /// Height of the rearmost point.
    pub tail_height: f64,

    /// Height of the windows' lower edge at the foot of the windscreen.
    pub belt_front: f64,
    /// The same at the foot of the rear window.
    pub belt_rear: f64,
    /// How far the sides lean inwards above the belt.
    pub tumblehome: f64,
    /// Width of the shoulder below the side windows.
    pub shoulder: f64,
    /// How much narrower each side is at the front corner than at the doors.
    pub front_taper: f64,
    /// The same at the rear corner.
    pub rear_taper: f64,
    /// How far the front corners reach back: bulge of the front in plan, radius along and across.
    pub front_corner: [f64; 3],
    /// The same for the rear corners.
    pub rear_corner: [f64; 3],

    /// How far behind the front axle the front door begins.
    pub door_start: f64,
    /// How far behind the front axle the middle of the B-pillar lies.
    pub b_pillar: f64,
    /// How far ahead of the rear axle the rear side window ends; negative for behind.
    pub rear_door_end: f64,
    /// How far ahead of the rear axle the C-pillar's window ends at the belt; negative for behind.
    pub quarter_glass_end: f64,
    /// Height of the upper edge of the tail lamps.
    pub tail_lamp_top: f64,
    /// Height of their lower edge.
    pub tail_lamp_bottom: f64,
}

impl ParametricVehicle {
    /// A midsize sedan.
    ///
    /// Length, width, height, wheelbase, track and tyres are about what makers publish for the class (Volkswagen
    /// Passat B8: 4.77 m x 1.83 m x 1.46 m, wheelbase 2.79 m); the rest is judged from side views of such cars.
    pub fn sedan() -> Self {
        Self {
            name: "sedan".to_owned(),
            category: "Car".to_owned(),
            body_style: "sedan".to_owned(),
            length: 4.77,
            width: 1.83,
            height: 1.46,
            wheelbase: 2.79,
            front_overhang: 0.88,
            track: 1.58,
            wheel_diameter: 0.66,
            tyre_width: 0.215,
            ground_clearance: 0.19,
            nose_height: 0.50,
            front_bumper_height: 0.61,
            hood_front_height: 0.755,
            hood_setback: 0.15,
            cowl_height: 0.99,
            cowl_setback: 0.45,
            windscreen_rake: 61.0,
            header_drop: 0.05,
            roof_end_drop: 0.07,
            rear_window_rake: 62.0,
            deck_height: 1.08,
            deck_length: 0.44,
            lip_height: 1.06,
            lip_setback: 0.07,
            rear_bumper_height: 0.66,
            tail_height: 0.52,
            belt_front: 0.93,
            belt_rear: 0.99,
            tumblehome: 24.0,
            shoulder: 0.035,
            front_taper: 0.09,
            rear_taper: 0.08,
            front_corner: [0.13, 0.22, 0.36],
            rear_corner: [0.08, 0.18, 0.30],
            door_start: 0.52,
            b_pillar: 1.50,
            rear_door_end: 0.02,
            quarter_glass_end: -0.22,
            tail_lamp_top: 0.93,
            tail_lamp_bottom: 0.74,
        }
    }

    /// A compact hatchback.
    ///
    /// Length, width, height, wheelbase, track and tyres are about what makers publish for the class (Volkswagen
    /// Golf VII: 4.26 m x 1.80 m x 1.45 m, wheelbase 2.63 m); the rest is judged from side views of such cars.
    pub fn hatchback() -> Self {
        Self {
            name: "hatchback".to_owned(),
            body_style: "hatchback".to_owned(),
            length: 4.26,
            width: 1.80,
            height: 1.46,
            wheelbase: 2.63,
            front_overhang: 0.85,
            track: 1.55,
            wheel_diameter: 0.64,
            tyre_width: 0.205,
            cowl_height: 1.0,
            cowl_setback: 0.38,
            windscreen_rake: 60.0,
            header_drop: 0.04,
            roof_end_drop: 0.09,
            rear_window_rake: 42.0,
            deck_height: 1.0,
            deck_length: 0.05,
            lip_height: 0.93,
            lip_setback: 0.06,
            rear_bumper_height: 0.62,
            belt_front: 0.94,
            belt_rear: 1.0,
            tumblehome: 23.0,
            front_taper: 0.08,
            rear_taper: 0.07,
            rear_corner: [0.08, 0.17, 0.24],
            door_start: 0.47,
            b_pillar: 1.46,
            rear_door_end: 0.0,
            quarter_glass_end: -0.34,
            tail_lamp_top: 0.97,
            tail_lamp_bottom: 0.76,
            ..Self::sedan()
        }
    }

    /// The annotated model; its extent is the smallest that holds the mesh, mirrors included.
    ///
    /// Fails for parameters that make no vehicle.
    pub fn build(&self) -> Result<VehicleModel, ModelError> {
        if let Some((_, what)) = self.requirements().into_iter().find(|(holds, _)| !holds) {
            return Err(ModelError::Parameters(what));
        }
        let mut half = loft::body(self);
        regions::paint(self, &mut half);
        fittings::add_wheels(self, &mut half);
        fittings::add_axle_covers(self, &mut half);
        fittings::add_mirror(self, &mut half);
        let mesh = half.mirrored_together();
        let (low, high) = mesh.bounds().ok_or(ModelError::Empty)?;
        let size = high - low;
        let extent = Extent::new(size.x, size.y, size.z);
        VehicleModel::new(&self.name, &self.category, &self.body_style, extent, mesh)
    }

    /// What must hold for the curves to exist and to run from front to rear, with what is to blame if not.
    fn requirements(&self) -> [(bool, &'static str); 12] {
        let between = |value: f64, low: f64, high: f64| low <= value && value <= high;
        let rising = |values: &[f64]| values.windows(2).all(|pair| pair[1] - pair[0] > 0.005);
        let arch = self.arch_radius();
        let rear_overhang = self.length - self.front_overhang - self.wheelbase;
        let header = self.height - self.header_drop;
        let roof_end = self.height - self.roof_end_drop;
        let [cowl, foot] = [self.axles()[0] - self.cowl_setback, self.rear_window_foot()];
        let roof_start =
            cowl - (header - self.cowl_height) * self.windscreen_rake.to_radians().tan();
        let roof_stop =
            foot + (roof_end - self.deck_height) * self.rear_window_rake.to_radians().tan();
        let corner = |[bulge, along, across]: [f64; 3]| {
            between(bulge, 0.0, 0.3) && between(along, 0.02, 0.4) && between(across, 0.02, 0.45)
        };
        [
            (
                between(self.length, 2.0, 12.0)
                    && between(self.width, 1.2, 3.0)
                    && between(self.height, 1.0, 4.0),
                "length, width and height",
            ),
            (
                self.front_overhang > arch + 0.1
                    && rear_overhang > arch + 0.05
                    && self.wheelbase > 2.0 * arch + 0.3,
                "overhangs, wheelbase and wheel diameter",
            ),
            (
                between(self.track, 0.5, self.width) && between(self.tyre_width, 0.05, 0.5),
                "track and tyre width",
            ),
            (
                between(self.ground_clearance, 0.05, 0.5 * self.wheel_diameter),
                "ground clearance and wheel diameter",
            ),
            (rising(&self.heights_to_front()), "the heights from nose to roof"),
            (rising(&self.heights_to_rear()), "the heights from tail to roof"),
            (
                between(self.windscreen_rake, 0.0, 80.0)
                    && between(self.rear_window_rake, 0.0, 80.0),
                "the rakes",
            ),
            (
                roof_start > roof_stop + 0.1
                    && between(self.hood_setback, 0.05, 0.5)
                    && self.nose() - self.hood_setback > cowl + 0.2,
                "hood, windscreen, roof and rear window",
            ),
            (
                between(self.lip_setback, 0.03, 0.5) && between(self.deck_length, 0.02, 2.0),
                "lip and deck",
            ),
            (
                [self.belt_front, self.belt_rear]
                    .iter()
                    .all(|belt| between(*belt, self.front_bumper_height + 0.1, header - 0.1)),
                "the heights of the belt",
            ),
            (
                between(self.tumblehome, 0.0, 35.0)
                    && between(self.shoulder, 0.0, 0.15)
                    && between(self.front_taper, 0.0, 0.25)
                    && between(self.rear_taper, 0.0, 0.25),
                "tumblehome, shoulder and tapers",
            ),
            (corner(self.front_corner) && corner(self.rear_corner), "the corners"),
        ]
    }

    /// What must rise from the bumper's lower edge over the nose to the roof.
    fn heights_to_front(&self) -> [f64; 7] {
        [
            self.ground_clearance + 0.16,
            self.nose_height,
            self.front_bumper_height,
            self.hood_front_height,
            self.cowl_height,
            self.height - self.header_drop,
            self.height,
        ]
    }

    /// The same over the tail.
    fn heights_to_rear(&self) -> [f64; 7] {
        [
            self.ground_clearance + 0.21,
            self.tail_height,
            self.rear_bumper_height,
            self.lip_height,
            self.deck_height,
            self.height - self.roof_end_drop,
            self.height,
        ]
    }

    /// Longitudinal position of the foremost point; the origin is half-way to the rearmost one.
    fn nose(&self) -> f64 {
        0.5 * self.length
    }

    /// Longitudinal positions of the front and the rear axle.
    fn axles(&self) -> [f64; 2] {
        let front = self.nose() - self.front_overhang;
        [front, front - self.wheelbase]
    }

    /// Radius of the wheel arches.
    fn arch_radius(&self) -> f64 {
        0.5 * self.wheel_diameter + 0.045
    }

    /// Height of the windows' lower edge.
    fn belt(&self, z: f64) -> f64 {
        let front = self.axles()[0] - self.cowl_setback;
        let rear = self.rear_window_foot();
        let share = ((front - z) / (front - rear)).clamp(-0.4, 1.3);
        self.belt_front + share * (self.belt_rear - self.belt_front)
    }

    /// Longitudinal position of the rear window's foot.
    fn rear_window_foot(&self) -> f64 {
        -self.nose() + self.lip_setback + self.deck_length
    }
}
