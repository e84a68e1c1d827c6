//! Whether parts are there and lie where they belong.

use crate::geometry::{Point3, Vector3};
use crate::parts::{PartClass, PartMap};
use crate::vehicle::PartialModel;
use crate::vehicle::place::side_of;

use super::{Finding, Severity, area, corners, middle};

/// How far off its side, or behind its rear counterpart, a part must lie to be told, metres.
const MARGIN: f64 = 0.05;
/// Ratio of areas from which left and right are told to differ.
const MAX_RATIO: f64 = 2.0;
/// Area below which a part is told to be tiny, square metres.
const MIN_AREA: f64 = 1e-3;

/// A part of the front and the one of the rear that it corresponds to.
const ENDS: [(PartClass, PartClass); 9] = [
    (PartClass::LightFrontLeft, PartClass::LightRearLeft),
    (PartClass::LightFrontRight, PartClass::LightRearRight),
    (PartClass::WheelFrontLeft, PartClass::WheelRearLeft),
    (PartClass::WheelFrontRight, PartClass::WheelRearRight),
    (PartClass::ApronFront, PartClass::ApronRear),
    (PartClass::DoorFrontLeft, PartClass::DoorRearLeft),
    (PartClass::DoorFrontRight, PartClass::DoorRearRight),
    (PartClass::WindshieldFront, PartClass::WindshieldRear),
    (PartClass::Hood, PartClass::Trunk),
];

/// Area and middle of a part.
#[derive(Clone, Copy, Default)]
struct Lump {
    area: f64,
    /// Sum of middles of faces, weighted by area.
    moment: Vector3,
}

impl Lump {
    fn center(&self) -> Vector3 {
        if self.area > 0.0 { self.moment / self.area } else { Vector3::zeros() }
    }
}

pub(super) fn check(model: &PartialModel, findings: &mut Vec<Finding>) {
    let mut lumps: PartMap<Lump> = PartMap::default();
    let mut all = Lump::default();
    for (face, part) in model.faces.iter().zip(&model.parts) {
        let triangle = corners(model, *face);
        let (area, middle): (f64, Point3) = (area(triangle), middle(triangle));
        let add = |lump: &mut Lump| {
            lump.area += area;
            lump.moment += middle.coords * area;
        };
        add(&mut all);
        if let Some(part) = part {
            let mut lump = lumps.get(*part).copied().unwrap_or_default();
            add(&mut lump);
            lumps.insert(*part, lump);
        }
    }
    if model.unlabeled() == 0 {
        check_missing(&lumps, findings);
    }
    check_places(&lumps, &all, findings);
    for (part, lump) in lumps.iter() {
        if lump.area < MIN_AREA {
            findings.push(Finding::TinyPart { part, area: lump.area });
        }
        let other = lumps.get(part.opposite()).map_or(lump.area, |lump| lump.area);
        let ratio = lump.area / other;
        if ratio > MAX_RATIO {
            findings.push(Finding::Asymmetric { larger: part, ratio });
        }
    }
}

fn check_missing(lumps: &PartMap<Lump>, findings: &mut Vec<Finding>) {
    let is_there = |part: PartClass| lumps.get(part).is_some();
    for part in PartClass::ALL.into_iter().filter(|part| !is_there(*part)) {
        findings.push(if is_there(part.opposite()) {
            Finding::MissingCounterpart { part }
        } else {
            Finding::MissingPart { part }
        });
    }
}

/// A part that no vehicle of its body style may have is worth a note, another one a warning.
pub(super) fn severity_of_missing(part: PartClass) -> Severity {
    match part {
        // Two-door cars have no rear doors, vans no side windows at the rear and no trunk lid of their own.
        PartClass::DoorRearLeft
        | PartClass::DoorRearRight
        | PartClass::GlassRearLeft
        | PartClass::GlassRearRight
        | PartClass::GlassCornerLeft
        | PartClass::GlassCornerRight => Severity::Note,
        _ => Severity::Warning,
    }
}

pub(super) fn remedy_of_missing(part: PartClass) -> &'static str {
    match severity_of_missing(part) {
        Severity::Note => "as it should be for a two-door car or a van; else map its group",
        _ => {
            "map its group (`partpose zoo import FILE --list`), or leave the body unlabeled for `partpose zoo annotate`"
        }
    }
}

fn check_places(lumps: &PartMap<Lump>, all: &Lump, findings: &mut Vec<Finding>) {
    let sided = lumps.iter().filter(|(part, _)| side_of(*part) != 0);
    let (mut wrong, mut right) = (Vec::new(), 0);
    for (part, lump) in sided {
        let x = lump.center().x;
        if f64::from(side_of(part)) * x < -MARGIN {
            wrong.push(Finding::WrongSide { part, x });
        } else if x.abs() > MARGIN {
            right += 1;
        }
    }
    let sides_swapped = wrong.len() > 2 && right == 0;
    let (mut reversed, mut ordered) = (Vec::new(), 0);
    for (front, rear) in ENDS {
        let Some((ahead, behind)) = lumps.get(front).zip(lumps.get(rear)) else { continue };
        let by = behind.center().z - ahead.center().z;
        if by > MARGIN {
            reversed.push(Finding::WrongEnd { front, rear, by });
        } else {
            ordered += 1;
        }
    }
    let ends_swapped = reversed.len() > 1 && ordered == 0;
    match (sides_swapped, ends_swapped) {
        (true, true) => findings.push(Finding::Backwards),
        (true, false) => {
            findings.push(Finding::SidesSwapped);
            findings.append(&mut reversed);
        }
        (false, true) => {
            findings.push(Finding::EndsSwapped);
            findings.append(&mut wrong);
        }
        (false, false) => {
            findings.append(&mut wrong);
            findings.append(&mut reversed);
        }
    }
    let wheels = [
        PartClass::WheelFrontLeft,
        PartClass::WheelFrontRight,
        PartClass::WheelRearLeft,
        PartClass::WheelRearRight,
    ];
    let mut wheel = Lump::default();
    for lump in wheels.iter().filter_map(|part| lumps.get(*part)) {
        wheel.area += lump.area;
        wheel.moment += lump.moment;
    }
    // y points down.
    let body = Lump { area: all.area - wheel.area, moment: all.moment - wheel.moment };
    if wheel.area > 0.0 && body.area > 0.0 && wheel.center().y < body.center().y - MARGIN {
        findings.push(Finding::UpsideDown);
    }
}
