//! Cars: sedans, estate, coupe.

use crate::vehicle::ParametricVehicle;

impl ParametricVehicle {
    /// A compact sedan, as large as a Toyota Corolla of 2013.
    pub fn sedan_compact() -> Self {
        Self {
            length: 4.62,
            width: 1.78,
            height: 1.46,
            wheelbase: 2.70,
            front_overhang: 0.93,
            track: 1.52,
            wheel_diameter: 0.63,
            tyre_width: 0.205,
            cowl_height: 0.99,
            cowl_setback: 0.38,
            windscreen_rake: 62.0,
            rear_window_rake: 62.0,
            deck_height: 1.07,
            deck_length: 0.34,
            lip_height: 1.05,
            tumblehome: 23.0,
            door_start: 0.47,
            b_pillar: 1.46,
            rear_door_end: 0.0,
            quarter_glass_end: -0.21,
            tail_lamp_inner: 36.0,
            ..Self::sedan()
        }
        .named("sedan-compact", "sedan")
    }

    /// A large sedan, as large as a BMW 5 Series of 2010.
    pub fn sedan_large() -> Self {
        Self {
            length: 4.90,
            width: 1.86,
            height: 1.46,
            wheelbase: 2.97,
            front_overhang: 0.83,
            track: 1.61,
            wheel_diameter: 0.68,
            tyre_width: 0.235,
            rim: 0.69,
            hood_front_height: 0.76,
            cowl_height: 0.99,
            cowl_setback: 0.62,
            windscreen_rake: 62.0,
            rear_window_rake: 63.0,
            deck_height: 1.07,
            deck_length: 0.50,
            lip_height: 1.04,
            door_start: 0.62,
            b_pillar: 1.66,
            rear_door_end: 0.05,
            quarter_glass_end: -0.18,
            tail_lamp_inner: 36.0,
            tail_lamp_top: 0.92,
            ..Self::sedan()
        }
        .named("sedan-large", "sedan")
    }

    /// A compact estate, as large as a Skoda Octavia III Combi.
    pub fn estate() -> Self {
        Self {
            length: 4.66,
            width: 1.81,
            height: 1.47,
            wheelbase: 2.69,
            front_overhang: 0.90,
            track: 1.55,
            wheel_diameter: 0.64,
            tyre_width: 0.205,
            cowl_setback: 0.40,
            header_drop: 0.045,
            roof_end_drop: 0.06,
            roof_peak: 0.38,
            rear_window_rake: 37.0,
            rear_window_gap: 0.05,
            deck_height: 1.0,
            deck_length: 0.05,
            lip_height: 0.93,
            lip_setback: 0.06,
            rear_bumper_height: 0.62,
            belt_front: 0.93,
            belt_rear: 0.98,
            tumblehome: 22.0,
            rear_corner: [0.06, 0.14, 0.20],
            door_start: 0.48,
            b_pillar: 1.46,
            rear_door_end: 0.02,
            c_pillar: 0.09,
            quarter_glass_end: -0.72,
            quarter_glass_rake: 34.0,
            tail_lamp_inner: 38.0,
            tail_lamp_top: 0.98,
            tail_lamp_bottom: 0.74,
            plate_height: 0.80,
            tail_lamp_outer: 74.0,
            ..Self::sedan()
        }
        .named("estate", "estate")
    }

    /// A coupe, as large as an Audi A5 of 2007.
    pub fn coupe() -> Self {
        Self {
            length: 4.63,
            width: 1.85,
            height: 1.37,
            wheelbase: 2.75,
            front_overhang: 0.86,
            track: 1.59,
            wheel_diameter: 0.67,
            tyre_width: 0.245,
            rim: 0.71,
            arch_gap: 0.035,
            arch_flare: 0.024,
            ground_clearance: 0.16,
            nose_height: 0.45,
            front_bumper_height: 0.565,
            hood_front_height: 0.71,
            cowl_height: 0.95,
            cowl_setback: 0.50,
            windscreen_rake: 64.0,
            header_drop: 0.045,
            roof_end_drop: 0.07,
            rear_window_rake: 70.0,
            deck_height: 1.04,
            deck_length: 0.30,
            lip_height: 1.01,
            lip_setback: 0.09,
            rear_bumper_height: 0.62,
            belt_front: 0.90,
            belt_rear: 0.97,
            tumblehome: 26.0,
            shoulder: 0.05,
            door_start: 0.54,
            b_pillar: 1.83,
            rear_doors: false,
            rear_door_end: -0.05,
            quarter_glass_end: -0.17,
            quarter_glass_rake: 63.0,
            headlamp_inner: 26.0,
            tail_lamp_inner: 34.0,
            tail_lamp_top: 0.90,
            tail_lamp_bottom: 0.75,
            plate_height: 0.78,
            ..Self::sedan()
        }
        .named("coupe", "coupe")
    }
}
