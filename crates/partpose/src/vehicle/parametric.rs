//! Vehicles made from a few dozen lengths, heights and angles.
//!
//! The body is lofted: two curves of the side view, over the car (`top`) and under it (`bottom`, with the wheel
//! arches), are joined at stations along the car by half rings, each of which runs from the middle of the floor round
//! the sill, up the side with its tuck-in, belt and tumblehome, round the edge and over to the middle of the roof
//! (`loft.rs`). Where rings pinch at nose and tail the corners of the bumpers arise. Seams between parts are then cut
//! into this surface exactly along implicit curves (`seams.rs`), wheels and mirrors are added (`fittings.rs`), and the
//! half is mirrored. All body styles are points of this one space of parameters (`models.rs`), listed in
//! `docs/vehicles.md`.
//!
//! Limits: no interior, no glass thickness; one side crease at most; both sides alike.

mod curves;
mod fittings;
mod half;
mod loft;
mod measures;
mod models;
mod path;
mod regions;
mod relief;
mod requirements;
mod seams;
mod stations;

use serde::{Deserialize, Serialize};

use crate::geometry::Extent;
use crate::parts::PartClass;

use super::{Mesh, ModelError, VehicleModel};

/// The shape of a vehicle. Lengths are metres, angles degrees; heights are above the ground.
///
/// Behind and ahead are along the vehicle; rakes are measured from the vertical, so that larger is flatter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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
    /// Radius of the rims as a share of the wheels' radius.
    pub rim: f64,
    /// From the tyres to the edge of the wheel arches.
    pub arch_gap: f64,
    /// How far the wheel arches' edges stand out from the sides.
    pub arch_flare: f64,
    /// Height of the sills' lower edge.
    pub ground_clearance: f64,

    /// Height of the foremost point.
    pub nose_height: f64,
    /// How far behind the foremost point the front bumper's lower edge lies.
    pub front_undercut: f64,
    /// Height of the upper edge of the front bumper, where the headlamps begin.
    pub front_bumper_height: f64,
    /// Height of the front edge of the hood.
    pub hood_front_height: f64,
    /// How far behind the foremost point the hood begins.
    pub hood_setback: f64,
    /// How far the middle of the hood lies above the straight line between its ends.
    pub hood_curve: f64,
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
    /// Where the roof is highest: 0 at the windscreen, 1 at the rear window.
    pub roof_peak: f64,
    /// How far the middle of the roof lies above its edges.
    pub roof_crown: f64,
    /// Width of the round edges of the roof.
    pub roof_radius: f64,
    /// Rake of the rear window.
    pub rear_window_rake: f64,
    /// How far below the end of the roof the glass of the rear window begins.
    pub rear_window_gap: f64,
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
    /// How far ahead of the rearmost point the rear bumper's lower edge lies.
    pub rear_undercut: f64,
    /// Depth of an open load bed behind the cab, from its rails to its floor; below 0.1 there is none.
    pub bed_depth: f64,

    /// Height of the windows' lower edge at the foot of the windscreen.
    pub belt_front: f64,
    /// The same at the foot of the rear window.
    pub belt_rear: f64,
    /// How far the sides lean inwards above the belt.
    pub tumblehome: f64,
    /// How much the sides curve above the belt: inwards by this times the height above the belt squared, per metre.
    pub side_curve: f64,
    /// How far the sides draw in from the widest height to the sills.
    pub side_tuck: f64,
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
    /// Whether there are rear doors.
    pub rear_doors: bool,
    /// How far ahead of the rear axle the rear door and its window end; negative for behind.
    pub rear_door_end: f64,
    /// Whether there are side windows behind the front doors.
    pub rear_side_windows: bool,
    /// Width of the pillar between the rear door's window and that behind it.
    pub c_pillar: f64,
    /// How far ahead of the rear axle the last side window ends at the belt; negative for behind. Where it ends before
    /// the rear door's window does, there is no window behind that.
    pub quarter_glass_end: f64,
    /// Rake of the rear end of the last side window.
    pub quarter_glass_rake: f64,
    /// Where the headlamps begin beside the grille: angle round the corner, 0 ahead and 90 to the side.
    pub headlamp_inner: f64,
    /// Where they end on the side.
    pub headlamp_outer: f64,
    /// How far the lower edge of the headlamps rises towards the side.
    pub headlamp_sweep: f64,
    /// Width of the grille.
    pub grille_width: f64,
    /// Where the tail lamps begin: angle round the corner, 0 behind and 90 to the side.
    pub tail_lamp_inner: f64,
    /// Where they end on the side.
    pub tail_lamp_outer: f64,
    /// Height of the upper edge of the tail lamps.
    pub tail_lamp_top: f64,
    /// Height of their lower edge.
    pub tail_lamp_bottom: f64,
    /// Height of the middle of the rear number plate.
    pub plate_height: f64,
    /// How far the mirrors reach beyond half the width.
    pub mirror_reach: f64,
    /// Height of the mirrors' housings.
    pub mirror_height: f64,
}

impl ParametricVehicle {
    /// The annotated model; its extent is the smallest that holds the mesh without the mirrors.
    ///
    /// That is how published widths are measured, and about how data sets draw their cuboids: the mirrors reach out of
    /// the extent. Fails for parameters that make no vehicle.
    pub fn build(&self) -> Result<VehicleModel, ModelError> {
        if let Some((_, what)) = self.requirements().into_iter().find(|(holds, _)| !holds) {
            return Err(ModelError::Parameters(what));
        }
        let mut half = loft::body(self);
        regions::paint(self, &mut half);
        fittings::add_wheels(self, &mut half);
        fittings::add_axle_covers(self, &mut half);
        fittings::add_plates(self, &mut half);
        fittings::add_mirror(self, &mut half);
        let mesh = half.mirrored_together();
        let extent = extent_without_mirrors(&mesh).ok_or(ModelError::Empty)?;
        VehicleModel::new(&self.name, &self.category, &self.body_style, extent, mesh)
    }

    /// The vehicle of [`Self::all`] that a model was built from; `None` for any other model.
    ///
    /// It is known by its name, its faces and its size, so that a model which was written to a file counts as well.
    pub fn of(model: &VehicleModel) -> Option<Self> {
        let vehicle = Self::all().into_iter().find(|vehicle| vehicle.name == model.name())?;
        let built = vehicle.build().ok()?;
        let is_near = (built.extent().to_vector() - model.extent().to_vector()).amax() < 1e-3
            && (built.mesh().volume() - model.mesh().volume()).abs() < 1e-3
            && built.mesh().faces.len() == model.mesh().faces.len();
        is_near.then_some(vehicle)
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
        0.5 * self.wheel_diameter + self.arch_gap
    }

    /// Whether the deck is an open load bed.
    fn has_bed(&self) -> bool {
        self.bed_depth >= 0.1
    }

    /// Height of the load bed's floor: never lower than the wheel arches reach.
    fn bed_floor(&self) -> f64 {
        let arches = 0.5 * self.wheel_diameter + self.arch_radius();
        (self.deck_height - self.bed_depth).max(arches + 0.01)
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

/// Sides of the box around all faces that are no mirror.
fn extent_without_mirrors(mesh: &Mesh) -> Option<Extent> {
    let is_mirror =
        |part: &PartClass| matches!(part, PartClass::MirrorLeft | PartClass::MirrorRight);
    let faces = mesh.faces.iter().zip(&mesh.parts).filter(|(_, part)| !is_mirror(part));
    let mut corners = faces.flat_map(|(face, _)| *face).map(|i| mesh.vertices[i as usize].coords);
    let first = corners.next()?;
    let (low, high) = corners.fold((first, first), |(low, high), p| (low.inf(&p), high.sup(&p)));
    let size = high - low;
    Some(Extent::new(size.x, size.y, size.z))
}
