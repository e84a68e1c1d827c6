//! The embedded vehicles are cars: closed, symmetric, complete, standing on the ground.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic like tests")]

use std::collections::BTreeSet;

use partpose::geometry::Point3;
use partpose::parts::PartClass;
use partpose::vehicle::{ModelZoo, ParametricVehicle, VehicleModel, from_glb, to_glb};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

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

/// The parts that a vehicle of these parameters lacks.
fn expected_missing(vehicle: &ParametricVehicle) -> Vec<PartClass> {
    let has_quarter = vehicle.rear_door_end - vehicle.c_pillar - vehicle.quarter_glass_end > 0.03;
    let lacks = |part: &PartClass| match part.name() {
        "doors_RL" | "doors_RR" => !vehicle.rear_doors,
        "glass_RL" | "glass_RR" => !vehicle.rear_side_windows,
        "glass_CL" | "glass_CR" => {
            !vehicle.rear_side_windows || !vehicle.rear_doors || !has_quarter
        }
        _ => false,
    };
    PartClass::ALL.into_iter().filter(lacks).collect()
}

/// The corners of the box around all that is no mirror.
fn bounds_without_mirrors(model: &VehicleModel) -> (Point3, Point3) {
    let mesh = model.mesh();
    let is_mirror = |part: &PartClass| part.name().starts_with("mirror");
    let faces = mesh.faces.iter().zip(&mesh.parts).filter(|(_, part)| !is_mirror(part));
    let corners: Vec<_> =
        faces.flat_map(|(face, _)| *face).map(|i| mesh.vertices[i as usize].coords).collect();
    let low = corners.iter().fold(corners[0], |low, p| low.inf(p));
    (low.into(), corners.iter().fold(corners[0], |high, p| high.sup(p)).into())
}

#[test]
fn the_embedded_zoo_is_the_same_every_time() {
    assert_eq!(ModelZoo::embedded(), ModelZoo::embedded());
    let names: Vec<_> = embedded().iter().map(|model| model.name().to_owned()).collect();
    assert_eq!(names[..2], ["sedan", "hatchback"]);
    assert!(names.len() >= 14);
    let styles: BTreeSet<_> = embedded().iter().map(|m| m.body_style().to_owned()).collect();
    for style in [
        "hatchback-3-door",
        "hatchback-5-door",
        "sedan",
        "estate",
        "coupe",
        "suv",
        "minivan",
        "panel-van",
        "pickup",
    ] {
        assert!(styles.contains(style), "no {style}");
    }
}

#[test]
fn embedded_meshes_are_closed_and_have_the_parts_of_their_body_style() {
    for (vehicle, model) in ParametricVehicle::all().iter().zip(embedded()) {
        let mesh = model.mesh();
        assert!(mesh.is_closed(), "{}", model.name());
        // A car fills a good half of its cuboid.
        let share = mesh.volume() / model.extent().volume();
        assert!((0.45..0.85).contains(&share), "{} fills {share}", model.name());
        assert_eq!(model.missing_parts(), expected_missing(vehicle), "{}", model.name());
        assert!((5_000..=20_000).contains(&mesh.faces.len()), "{} faces", mesh.faces.len());
    }
}

#[test]
fn embedded_meshes_fill_their_extent_up_to_the_mirrors_and_stand_on_the_ground() {
    for (vehicle, model) in ParametricVehicle::all().iter().zip(embedded()) {
        let (low, high) = bounds_without_mirrors(&model);
        let size = model.extent().to_vector();
        assert!((high - low - size).amax() < ROUNDING);
        assert!(high.y.abs() < ROUNDING && (high.x + low.x).abs() < ROUNDING);
        assert!((high.z + low.z).abs() < ROUNDING);
        let wanted = [vehicle.width, vehicle.height, vehicle.length];
        for (size, wanted) in size.iter().zip(wanted) {
            assert!((size - wanted).abs() < 0.01, "{}: {size} for {wanted}", model.name());
        }
        let (_, far) = model.mesh().bounds().unwrap();
        assert!((far.x - 0.5 * vehicle.width - vehicle.mirror_reach).abs() < 0.01);
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
        let missing = model.missing_parts();
        let has = |name: &&str| !missing.iter().any(|part| part.name() == *name);
        let at = |name: &str| center(&model, PartClass::from_name(name).unwrap());
        let sided = PartClass::ALL.iter().filter(|part| part.opposite() != **part);
        for part in sided.filter(|part| !missing.contains(part)) {
            let is_left = part.name().ends_with('L');
            assert_eq!(center(&model, *part).x < 0.0, is_left, "{}", part.name());
        }
        let from_front_to_back = [
            vec!["apron_F", "hood", "windshield_F", "roof", "windshield_R", "trunk"],
            vec!["lights_FL", "wheels_FL", "doors_FL", "doors_RL", "wheels_RL", "lights_RL"],
            vec!["lights_FR", "mirror_R", "glass_FR", "glass_RR", "glass_CR", "apron_R"],
        ];
        for names in from_front_to_back {
            let names: Vec<_> = names.into_iter().filter(has).collect();
            for pair in names.windows(2) {
                assert!(at(pair[0]).z > at(pair[1]).z, "{pair:?} in {}", model.name());
            }
        }
        for [upper, lower] in [["roof", "glass_FL"], ["glass_FL", "doors_FL"], ["hood", "apron_F"]]
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
        for name in ["hood", "roof", "windshield_F"] {
            check(name, 1, -1.0);
        }
        check("windshield_F", 2, 1.0);
        check("windshield_R", 2, -1.0);
    }
}

#[test]
fn embedded_meshes_have_no_coinciding_vertices() {
    for model in embedded() {
        let mesh = model.mesh();
        let corners = |face: usize| mesh.faces[face].map(|i| mesh.vertices[i as usize].coords);
        let shortest = |face: &usize| {
            let [a, b, c] = corners(*face);
            (a - b).norm().min((b - c).norm()).min((c - a).norm())
        };
        // Positions in files are single-precision numbers.
        let faces: Vec<usize> = (0..mesh.faces.len()).filter(|i| shortest(i) < 2e-6).collect();
        let first = faces.first().map(|face| (mesh.parts[*face].name(), corners(*face)));
        assert!(faces.is_empty(), "{}: {} faces, {first:?}", model.name(), faces.len());
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

#[test]
fn every_parameter_is_explained() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/vehicles.md");
    let page = std::fs::read_to_string(page).unwrap();
    let value = serde_json::to_value(ParametricVehicle::sedan()).unwrap();
    for name in value.as_object().unwrap().keys() {
        assert!(page.contains(&format!("`{name}`")), "docs/vehicles.md lacks `{name}`");
    }
    for vehicle in ParametricVehicle::all() {
        assert!(page.contains(&format!("| `{}` |", vehicle.name)), "no {}", vehicle.name);
    }
}

#[test]
fn measures_are_all_numbers_that_there_are() {
    let mut vehicle = ParametricVehicle::sedan();
    let names: Vec<_> = vehicle.measures_mut().iter().map(|(name, _)| *name).collect();
    let value = serde_json::to_value(&vehicle).unwrap();
    let numbers = value.as_object().unwrap().values().map(|value| match value {
        serde_json::Value::Number(_) => 1,
        serde_json::Value::Array(values) => values.len(),
        _ => 0,
    });
    assert_eq!(names.len(), numbers.sum::<usize>());
    assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len());
}

#[test]
fn between_two_vehicles_lie_their_means() {
    let [a, b] = [ParametricVehicle::sedan(), ParametricVehicle::panel_van()];
    assert_eq!(a.lerp(&b, 0.0), a);
    assert_eq!(a.lerp(&b, 1.0), b);
    let middle = a.lerp(&b, 0.5);
    assert!((middle.length - 0.5 * (a.length + b.length)).abs() < ROUNDING);
    assert_eq!(middle.category, "Van");
}

/// Whether a vehicle can be built; panics if what is built is no whole vehicle.
fn builds(vehicle: &ParametricVehicle) -> bool {
    let Ok(model) = vehicle.build() else { return false };
    assert!(model.mesh().is_closed(), "{} is open", vehicle.name);
    assert!(model.mesh().volume() > 2.5, "{} has no volume", vehicle.name);
    let missing = model.missing_parts();
    let expected = expected_missing(vehicle);
    // The window behind the rear door's runs out between belt and roof where these come near each other.
    let may_run_out = |part: &&PartClass| part.name().starts_with("glass_C");
    let unexpected: Vec<_> =
        missing.iter().filter(|part| !(expected.contains(part) || may_run_out(part))).collect();
    assert!(unexpected.is_empty(), "{} lacks {unexpected:?}", vehicle.name);
    true
}

/// Random pairs of vehicles, random shares: how many of how many can be built.
fn built_between(draws: usize, seed: u64) -> usize {
    let vehicles = ParametricVehicle::all();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut any = |count: usize| (random.random::<f64>() * count as f64) as usize % count;
    (0..draws)
        .filter(|_| {
            let [a, b] = [any(vehicles.len()), any(vehicles.len())];
            let share = any(1001) as f64 / 1000.0;
            builds(&vehicles[a].lerp(&vehicles[b], share))
        })
        .count()
}

/// Vehicles with every measure changed by up to 5 %, independently.
fn built_near(draws: usize, seed: u64) -> usize {
    let vehicles = ParametricVehicle::all();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..draws)
        .filter(|draw| {
            let mut vehicle = vehicles[draw % vehicles.len()].clone();
            for (_, measure) in vehicle.measures_mut() {
                *measure *= 1.0 + 0.05 * (2.0 * random.random::<f64>() - 1.0);
            }
            builds(&vehicle)
        })
        .count()
}

/// Nine of ten draws must be vehicles. `DRAWS=1000 cargo test --release -p partpose --test parametric most -- --nocapture`
/// prints the shares that docs/vehicles.md gives.
#[expect(clippy::print_stdout, reason = "shares are worth knowing, too")]
fn assert_most(built: impl Fn(usize) -> usize) {
    let draws = std::env::var("DRAWS").map_or(40, |draws| draws.parse().unwrap());
    let built = built(draws);
    println!("{built} of {draws} can be built");
    assert!(10 * built >= 9 * draws, "{built} of {draws}");
}

#[test]
fn most_vehicles_between_two_can_be_built() {
    assert_most(|draws| built_between(draws, 3));
}

#[test]
fn most_vehicles_near_one_can_be_built() {
    assert_most(|draws| built_near(draws, 4));
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
        let mut measures = vehicle.measures_mut();
        let at = at.index(measures.len());
        *measures[at].1 *= factor;
        let _ = vehicle.build();
    }
}
