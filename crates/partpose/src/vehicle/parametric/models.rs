//! The vehicles that come with the library, as points of the space of parameters.
//!
//! Length, width, height and wheelbase are those that the maker published for the vehicle named with each, rounded to
//! centimetres (`docs/vehicles.md` has the figures and where they are from); track and tyres are about what such
//! vehicles have. The rest is judged from side views of the body style.

mod cars;
mod hatchbacks;
mod tall;
mod vans;

use super::ParametricVehicle;

impl ParametricVehicle {
    /// All vehicles that come with the library, in a fixed order.
    pub fn all() -> Vec<Self> {
        vec![
            Self::sedan(),
            Self::hatchback(),
            Self::city_car(),
            Self::supermini(),
            Self::hatchback_3_door(),
            Self::sedan_compact(),
            Self::sedan_large(),
            Self::estate(),
            Self::coupe(),
            Self::suv_compact(),
            Self::suv_large(),
            Self::mpv(),
            Self::minivan(),
            Self::van_small(),
            Self::panel_van(),
            Self::panel_van_large(),
            Self::pickup(),
        ]
    }

    fn named(self, name: &str, body_style: &str) -> Self {
        Self { name: name.to_owned(), body_style: body_style.to_owned(), ..self }
    }

    /// A midsize sedan, as large as a Volkswagen Passat B8.
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
            rim: 0.66,
            arch_gap: 0.04,
            arch_flare: 0.018,
            ground_clearance: 0.18,
            nose_height: 0.48,
            front_undercut: 0.09,
            front_bumper_height: 0.60,
            hood_front_height: 0.755,
            hood_setback: 0.15,
            hood_curve: 0.04,
            cowl_height: 0.99,
            cowl_setback: 0.45,
            windscreen_rake: 61.0,
            header_drop: 0.05,
            roof_end_drop: 0.07,
            roof_peak: 0.45,
            roof_crown: 0.05,
            roof_radius: 0.10,
            rear_window_rake: 62.0,
            rear_window_gap: 0.0,
            deck_height: 1.08,
            deck_length: 0.44,
            lip_height: 1.06,
            lip_setback: 0.07,
            rear_bumper_height: 0.64,
            tail_height: 0.52,
            rear_undercut: 0.11,
            bed_depth: 0.0,
            belt_front: 0.93,
            belt_rear: 0.99,
            tumblehome: 24.0,
            side_curve: 0.12,
            side_tuck: 0.06,
            shoulder: 0.035,
            front_taper: 0.08,
            rear_taper: 0.07,
            front_corner: [0.11, 0.18, 0.30],
            rear_corner: [0.07, 0.15, 0.25],
            door_start: 0.52,
            b_pillar: 1.50,
            rear_doors: true,
            rear_door_end: 0.02,
            rear_side_windows: true,
            c_pillar: 0.045,
            quarter_glass_end: -0.22,
            quarter_glass_rake: 42.0,
            headlamp_inner: 22.0,
            headlamp_outer: 83.0,
            headlamp_sweep: 0.10,
            grille_width: 0.86,
            tail_lamp_inner: 30.0,
            tail_lamp_outer: 82.0,
            tail_lamp_top: 0.93,
            tail_lamp_bottom: 0.74,
            plate_height: 0.80,
            mirror_reach: 0.12,
            mirror_height: 0.14,
        }
    }
}
