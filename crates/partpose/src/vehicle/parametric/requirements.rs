//! What parameters must satisfy to make a vehicle.

use super::ParametricVehicle;

impl ParametricVehicle {
    /// What must hold for the curves to exist and to run from front to rear, with what is to blame if not.
    pub(super) fn requirements(&self) -> [(bool, &'static str); 18] {
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
        let lamp = |inner: f64, outer: f64| {
            between(inner, 5.0, 80.0) && between(outer, inner + 10.0, 130.0)
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
            (
                between(self.rim, 0.4, 0.85)
                    && between(self.arch_gap, 0.01, 0.15)
                    && between(self.arch_flare, 0.0, 0.08),
                "rim and wheel arches",
            ),
            (
                between(self.front_undercut, 0.03, 0.4) && between(self.rear_undercut, 0.03, 0.4),
                "the undercuts",
            ),
            (
                between(self.hood_curve, -0.05, 0.15)
                    && between(self.roof_peak, 0.1, 0.9)
                    && between(self.roof_crown, 0.01, 0.15)
                    && between(self.roof_radius, 0.03, 0.25)
                    && between(self.rear_window_gap, 0.0, 0.7 * (roof_end - self.deck_height)),
                "hood curve, roof and the gap above the rear window",
            ),
            (
                !self.has_bed()
                    || self.deck_length > 0.35
                        && self.deck_height - self.bed_depth > 0.5 * self.wheel_diameter + arch
                        && self.lip_height > self.deck_height - self.bed_depth + 0.05,
                "load bed, deck and wheels",
            ),
            (
                between(self.side_curve, 0.0, 0.3)
                    && between(self.side_tuck, 0.0, 0.2)
                    && between(self.c_pillar, 0.0, 0.5)
                    && between(self.quarter_glass_rake, 0.0, 80.0)
                    && self.b_pillar > self.door_start + 0.3
                    && (!self.rear_doors
                        || self.wheelbase - self.rear_door_end > self.b_pillar + 0.2),
                "sides, doors and pillars",
            ),
            (
                lamp(self.headlamp_inner, self.headlamp_outer)
                    && lamp(self.tail_lamp_inner, self.tail_lamp_outer)
                    && self.tail_lamp_top > self.tail_lamp_bottom + 0.02
                    && between(self.headlamp_sweep, 0.0, 0.3)
                    && between(self.grille_width, 0.0, self.width - 0.4)
                    && between(self.plate_height, self.ground_clearance, self.lip_height - 0.06)
                    && between(self.mirror_reach, 0.03, 0.4)
                    && between(self.mirror_height, 0.05, 0.6),
                "lamps, grille, plate and mirrors",
            ),
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
}
