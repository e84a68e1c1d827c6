//! The measures of a vehicle as a list, and vehicles between two.

use super::ParametricVehicle;

impl ParametricVehicle {
    /// Every measure with its name, to read or to change it; what is no number is left out.
    pub fn measures_mut(&mut self) -> Vec<(&'static str, &mut f64)> {
        let [front_bulge, front_along, front_across] = &mut self.front_corner;
        let [rear_bulge, rear_along, rear_across] = &mut self.rear_corner;
        vec![
            ("length", &mut self.length),
            ("width", &mut self.width),
            ("height", &mut self.height),
            ("wheelbase", &mut self.wheelbase),
            ("front_overhang", &mut self.front_overhang),
            ("track", &mut self.track),
            ("wheel_diameter", &mut self.wheel_diameter),
            ("tyre_width", &mut self.tyre_width),
            ("rim", &mut self.rim),
            ("arch_gap", &mut self.arch_gap),
            ("arch_flare", &mut self.arch_flare),
            ("ground_clearance", &mut self.ground_clearance),
            ("nose_height", &mut self.nose_height),
            ("front_undercut", &mut self.front_undercut),
            ("front_bumper_height", &mut self.front_bumper_height),
            ("hood_front_height", &mut self.hood_front_height),
            ("hood_setback", &mut self.hood_setback),
            ("hood_curve", &mut self.hood_curve),
            ("cowl_height", &mut self.cowl_height),
            ("cowl_setback", &mut self.cowl_setback),
            ("windscreen_rake", &mut self.windscreen_rake),
            ("header_drop", &mut self.header_drop),
            ("roof_end_drop", &mut self.roof_end_drop),
            ("roof_peak", &mut self.roof_peak),
            ("roof_crown", &mut self.roof_crown),
            ("roof_radius", &mut self.roof_radius),
            ("rear_window_rake", &mut self.rear_window_rake),
            ("rear_window_gap", &mut self.rear_window_gap),
            ("deck_height", &mut self.deck_height),
            ("deck_length", &mut self.deck_length),
            ("lip_height", &mut self.lip_height),
            ("lip_setback", &mut self.lip_setback),
            ("rear_bumper_height", &mut self.rear_bumper_height),
            ("tail_height", &mut self.tail_height),
            ("rear_undercut", &mut self.rear_undercut),
            ("bed_depth", &mut self.bed_depth),
            ("belt_front", &mut self.belt_front),
            ("belt_rear", &mut self.belt_rear),
            ("tumblehome", &mut self.tumblehome),
            ("side_curve", &mut self.side_curve),
            ("side_tuck", &mut self.side_tuck),
            ("shoulder", &mut self.shoulder),
            ("front_taper", &mut self.front_taper),
            ("rear_taper", &mut self.rear_taper),
            ("front_corner[0]", front_bulge),
            ("front_corner[1]", front_along),
            ("front_corner[2]", front_across),
            ("rear_corner[0]", rear_bulge),
            ("rear_corner[1]", rear_along),
            ("rear_corner[2]", rear_across),
            ("door_start", &mut self.door_start),
            ("b_pillar", &mut self.b_pillar),
            ("rear_door_end", &mut self.rear_door_end),
            ("c_pillar", &mut self.c_pillar),
            ("quarter_glass_end", &mut self.quarter_glass_end),
            ("quarter_glass_rake", &mut self.quarter_glass_rake),
            ("headlamp_inner", &mut self.headlamp_inner),
            ("headlamp_outer", &mut self.headlamp_outer),
            ("headlamp_sweep", &mut self.headlamp_sweep),
            ("grille_width", &mut self.grille_width),
            ("tail_lamp_inner", &mut self.tail_lamp_inner),
            ("tail_lamp_outer", &mut self.tail_lamp_outer),
            ("tail_lamp_top", &mut self.tail_lamp_top),
            ("tail_lamp_bottom", &mut self.tail_lamp_bottom),
            ("plate_height", &mut self.plate_height),
            ("mirror_reach", &mut self.mirror_reach),
            ("mirror_height", &mut self.mirror_height),
        ]
    }

    /// The vehicle between two: every measure mixed, all else as in the nearer one.
    ///
    /// `share` is that of `other`, 0 to 1; beyond, measures are extrapolated.
    pub fn lerp(&self, other: &Self, share: f64) -> Self {
        let mut mixed = if share < 0.5 { self.clone() } else { other.clone() };
        let [mut from, mut to] = [self.clone(), other.clone()];
        let pairs = from.measures_mut().into_iter().zip(to.measures_mut());
        for ((_, mixed), ((_, from), (_, to))) in mixed.measures_mut().into_iter().zip(pairs) {
            *mixed = *from + share * (*to - *from);
        }
        mixed
    }
}
