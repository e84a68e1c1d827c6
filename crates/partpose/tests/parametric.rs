//! The embedded vehicles are cars: closed, symmetric, complete, standing on the ground.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic like tests")]

use std::collections::BTreeSet;

use partpose::geometry::Point3;
use partpose::parts::PartClass;
use partpose::vehicle::{ModelZoo, ParametricVehicle, VehicleModel, from_glb, to_glb};
use proptest::prelude::*;

/// Rounding of coordinates of a few metres.
const ROUNDING: f64 = 1e-9;

fn embedded() -> Vec<VehicleModel> {
    ModelZoo::embedded().models
}

fn mean(points: impl Iterator<Item = Point3>) -> Point3 {
    let points: Vec<_> = points.collect();
    points
        .iter()
        .map(|p| p.coords)
        .sum::<partpose::geometry::Vector3>()
        .scale(1.0 / points.len() as f64)
        .into()
}

fn center(model: &VehicleModel, part: PartClass) -> Point3 {
    let mesh = model.mesh();
    mean(mesh.part_vertices(part).into_iter().map(|index| mesh.vertices[index as usize]))
}

#[test]
fn the_embedded_zoo_is_the_same_every_time() {
    assert_eq!(ModelZoo::embedded(), ModelZoo::embedded());
    let styles: Vec<_> = embedded().iter().map(|model| model.body_style().to_owned()).collect();
    assert_eq!(styles, ["sedan", "hatchback"]);
}

#[test]
fn embedded_meshes_are_closed_face_outwards_and_have_all_parts() {
    for model in embedded() {
        let mesh = model.mesh();
        assert!(mesh.is_closed(), "{}", model.name());
        // A car fills a good half of its cuboid, mirrors included.
        let share = mesh.volume() / model.extent().volume();
        assert!((0.4..0.75).contains(&share), "{} fills {share}", model.name());
        assert_eq!(model.missing_parts(), []);
        assert!((5_000..=15_000).contains(&mesh.faces.len()), "{} faces", mesh.faces.len());
    }
}

#[test]
fn embedded_meshes_fill_their_extent_and_stand_on_the_ground() {
    for model in embedded() {
        let (low, high) = model.mesh().bounds().unwrap();
        let size = model.extent().to_vector();
        assert!((high - low - size).amax() < ROUNDING);
        assert!(high.y.abs() < ROUNDING && (high.x + low.x).abs() < ROUNDING);
        assert!((high.z + low.z).abs() < ROUNDING);
        for part in [5, 6, 7, 8].map(|id| PartClass::from_id(id).unwrap()) {
            let lowest = model.mesh().part_vertices(part).into_iter();
            let lowest = lowest.map(|i| model.mesh().vertices[i as usize].y).fold(-9.0, f64::max);
            assert!(lowest.abs() < ROUNDING, "{} hovers at {lowest}", part.name());
        }
    }
}

#[test]
fn embedded_meshes_are_their_own_mirror_images() {
    for model in embedded() {
        let corners = |mesh: &partpose::vehicle::Mesh| {
            let faces = mesh.faces.iter().zip(&mesh.parts).map(|(face, part)| {
                let mut corners = face.map(|i| {
                    let p = mesh.vertices[i as usize];
                    [p.x + 0.0, p.y, p.z].map(f64::to_bits)
                });
                let first = (0..3).min_by_key(|at| corners[*at]).unwrap();
                corners.rotate_left(first);
                (part.id(), corners)
            });
            faces.collect::<BTreeSet<_>>()
        };
        assert_eq!(corners(model.mesh()), corners(&model.mesh().mirrored()));
    }
}

#[test]
fn parts_are_where_they_belong() {
    for model in embedded() {
        let at = |name: &str| center(&model, PartClass::from_name(name).unwrap());
        for part in PartClass::ALL.iter().filter(|part| part.opposite() != **part) {
            let is_left = part.name().ends_with('L');
            assert_eq!(center(&model, *part).x < 0.0, is_left, "{}", part.name());
        }
        let from_front_to_back = [
            vec!["apron_F", "hood", "windshield_F", "roof", "windshield_R", "trunk"],
            vec!["lights_FL", "wheels_FL", "doors_FL", "doors_RL", "wheels_RL", "lights_RL"],
            vec!["lights_FR", "mirror_R", "glass_FR", "glass_RR", "glass_CR", "apron_R"],
        ];
        for names in from_front_to_back {
            for pair in names.windows(2) {
                assert!(at(pair[0]).z > at(pair[1]).z, "{pair:?} in {}", model.name());
            }
        }
        for [upper, lower] in [["roof", "glass_RL"], ["glass_FL", "doors_FL"], ["hood", "apron_F"]]
        {
            assert!(at(upper).y < at(lower).y, "{upper} is not above {lower}");
        }
    }
}

#[test]
fn the_body_has_no_folds() {
    for model in embedded() {
        let mesh = model.mesh();
        // Doors and side windows face sideways, hood and roof upwards; a folded face would look the other way.
        let check = |name: &str, axis: usize, sign: f64| {
            let part = PartClass::from_name(name).unwrap();
            for face in (0..mesh.faces.len()).filter(|face| mesh.parts[*face] == part) {
                if let Some(normal) = mesh.normal(face) {
                    assert!(sign * normal[axis] > 0.0, "{name} of {}: {normal}", model.name());
                }
            }
        };
        for name in ["doors_FL", "doors_RL", "glass_FL", "glass_RL", "glass_CL"] {
            check(name, 0, -1.0);
        }
        for name in ["hood", "roof", "windshield_F", "windshield_R"] {
            check(name, 1, -1.0);
        }
    }
}

#[test]
fn the_embedded_zoo_survives_the_disk() {
    let folder = tempfile::tempdir().unwrap();
    let zoo = ModelZoo::embedded();
    zoo.save(folder.path()).unwrap();
    let read = ModelZoo::load(folder.path()).unwrap();
    for model in &zoo.models {
        let other = read.get(model.name()).unwrap();
        assert_eq!(other.mesh().faces.len(), model.mesh().faces.len());
        assert_eq!(other.mesh().vertices.len(), model.mesh().vertices.len());
        assert!(other.mesh().is_closed());
        assert_eq!(to_glb(&from_glb(&to_glb(other)).unwrap()), to_glb(other));
    }
}

/// Every measure of a vehicle, to change it.
fn measures(v: &mut ParametricVehicle) -> Vec<&mut f64> {
    let [a, b, c] = &mut v.front_corner;
    let [d, e, f] = &mut v.rear_corner;
    vec![
        &mut v.length,
        &mut v.width,
        &mut v.height,
        &mut v.wheelbase,
        &mut v.front_overhang,
        &mut v.track,
        &mut v.wheel_diameter,
        &mut v.tyre_width,
        &mut v.ground_clearance,
        &mut v.nose_height,
        &mut v.front_bumper_height,
        &mut v.hood_front_height,
        &mut v.hood_setback,
        &mut v.cowl_height,
        &mut v.cowl_setback,
        &mut v.windscreen_rake,
        &mut v.header_drop,
        &mut v.roof_end_drop,
        &mut v.rear_window_rake,
        &mut v.deck_height,
        &mut v.deck_length,
        &mut v.lip_height,
        &mut v.lip_setback,
        &mut v.rear_bumper_height,
        &mut v.tail_height,
        &mut v.belt_front,
        &mut v.belt_rear,
        &mut v.tumblehome,
        &mut v.shoulder,
        &mut v.front_taper,
        &mut v.rear_taper,
        &mut v.door_start,
        &mut v.b_pillar,
        &mut v.rear_door_end,
        &mut v.quarter_glass_end,
        &mut v.tail_lamp_top,
        &mut v.tail_lamp_bottom,
        a,
        b,
        c,
        d,
        e,
        f,
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn other_measures_make_closed_vehicles_too(
        length in -0.3..0.3, width in -0.1..0.1, height in -0.08..0.25, wheelbase in -0.15..0.15,
        deck in 0.0..1.0, rake in 0.0..1.0, windscreen in -6.0..4.0, tumblehome in -6.0..4.0,
        wheel in -0.04..0.04, clearance in -0.03..0.06,
    ) {
        let [a, b] = [ParametricVehicle::hatchback(), ParametricVehicle::sedan()];
        let vehicle = ParametricVehicle {
            length: b.length + length,
            width: b.width + width,
            height: b.height + height,
            wheelbase: b.wheelbase + wheelbase,
            deck_length: a.deck_length + deck * (b.deck_length - a.deck_length),
            rear_window_rake: a.rear_window_rake + rake * (b.rear_window_rake - a.rear_window_rake),
            windscreen_rake: b.windscreen_rake + windscreen,
            tumblehome: b.tumblehome + tumblehome,
            wheel_diameter: b.wheel_diameter + wheel,
            ground_clearance: b.ground_clearance + clearance,
            ..b
        };
        let model = vehicle.build().unwrap();
        prop_assert!(model.mesh().is_closed());
        prop_assert!(model.mesh().volume() > 4.0);
        prop_assert!(model.missing_parts().is_empty(), "{:?}", model.missing_parts());
        prop_assert!((model.extent().length - vehicle.length).abs() < 0.02);
        prop_assert!((model.extent().height - vehicle.height).abs() < 0.02);
    }

    #[test]
    fn absurd_measures_never_make_the_maker_panic(
        at in any::<prop::sample::Index>(),
        factor in prop_oneof![
            Just(f64::NAN), Just(f64::INFINITY), Just(0.0), Just(-1.0), Just(1e300), 0.3..3.0,
        ],
    ) {
        let mut vehicle = ParametricVehicle::sedan();
        let mut measures = measures(&mut vehicle);
        let at = at.index(measures.len());
        *measures[at] *= factor;
        let _ = vehicle.build();
    }
}
