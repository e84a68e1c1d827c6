//! Hatchbacks.

use crate::vehicle::ParametricVehicle;

impl ParametricVehicle {
    /// A compact hatchback with rear doors, as large as a Volkswagen Golf VII.
    pub fn hatchback() -> Self {
        Self {
            length: 4.26,
            width: 1.80,
            height: 1.45,
            wheelbase: 2.64,
            front_overhang: 0.85,
            track: 1.55,
            wheel_diameter: 0.64,
            tyre_width: 0.205,
            cowl_height: 1.0,
            cowl_setback: 0.38,
            windscreen_rake: 60.0,
            header_drop: 0.04,
            roof_end_drop: 0.08,
            roof_peak: 0.4,
            rear_window_rake: 42.0,
            rear_window_gap: 0.04,
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
            rear_corner: [0.07, 0.15, 0.22],
            door_start: 0.47,
            b_pillar: 1.46,
            rear_door_end: 0.0,
            quarter_glass_end: -0.34,
            tail_lamp_top: 0.97,
            tail_lamp_bottom: 0.76,
            plate_height: 0.76,
            tail_lamp_outer: 76.0,
            ..Self::sedan()
        }
        .named("hatchback", "hatchback-5-door")
    }

    /// A city car without rear doors, as large as a Fiat 500 of 2007.
    pub fn city_car() -> Self {
        Self {
            length: 3.55,
            width: 1.63,
            height: 1.49,
            wheelbase: 2.30,
            front_overhang: 0.69,
            track: 1.41,
            wheel_diameter: 0.57,
            tyre_width: 0.185,
            front_bumper_height: 0.59,
            hood_front_height: 0.76,
            hood_setback: 0.14,
            hood_curve: 0.05,
            cowl_height: 1.02,
            cowl_setback: 0.22,
            windscreen_rake: 55.0,
            header_drop: 0.05,
            roof_end_drop: 0.10,
            rear_window_rake: 37.0,
            deck_height: 0.99,
            deck_length: 0.04,
            lip_height: 0.91,
            rear_bumper_height: 0.60,
            tail_height: 0.50,
            belt_front: 0.95,
            belt_rear: 1.0,
            tumblehome: 20.0,
            front_corner: [0.10, 0.17, 0.28],
            rear_corner: [0.07, 0.15, 0.22],
            door_start: 0.34,
            b_pillar: 1.40,
            rear_doors: false,
            rear_door_end: -0.05,
            quarter_glass_end: -0.16,
            quarter_glass_rake: 38.0,
            headlamp_inner: 28.0,
            grille_width: 0.60,
            tail_lamp_inner: 42.0,
            tail_lamp_top: 0.95,
            tail_lamp_bottom: 0.70,
            plate_height: 0.72,
            mirror_reach: 0.11,
            tail_lamp_outer: 74.0,
            ..Self::hatchback()
        }
        .named("city-car", "hatchback-3-door")
    }

    /// A small hatchback with rear doors, as large as a Volkswagen Polo V.
    pub fn supermini() -> Self {
        Self {
            length: 3.97,
            width: 1.68,
            height: 1.46,
            wheelbase: 2.47,
            front_overhang: 0.81,
            track: 1.46,
            wheel_diameter: 0.60,
            tyre_width: 0.185,
            cowl_height: 1.0,
            cowl_setback: 0.30,
            windscreen_rake: 59.0,
            rear_window_rake: 38.0,
            deck_height: 1.0,
            lip_height: 0.92,
            tumblehome: 21.0,
            door_start: 0.41,
            b_pillar: 1.36,
            rear_door_end: -0.02,
            quarter_glass_end: -0.28,
            quarter_glass_rake: 40.0,
            grille_width: 0.72,
            tail_lamp_inner: 40.0,
            mirror_reach: 0.11,
            ..Self::hatchback()
        }
        .named("supermini", "hatchback-5-door")
    }

    /// A compact hatchback without rear doors, as large as a Volkswagen Golf VII.
    pub fn hatchback_3_door() -> Self {
        Self {
            b_pillar: 1.74,
            rear_doors: false,
            quarter_glass_end: -0.26,
            quarter_glass_rake: 46.0,
            ..Self::hatchback()
        }
        .named("hatchback-3-door", "hatchback-3-door")
    }
}
