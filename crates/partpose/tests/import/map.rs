//! What a map of names makes of a scene: axes, unit, sides, extent, parts.

use partpose::geometry::Extent;
use partpose::parts::PartClass;
use partpose::vehicle::import::{ImportMap, Imported, MapError, Sides, apply_map, read_scene};
use partpose::vehicle::{ModelZoo, to_glb};

use crate::{Folder, OBJ, center, import_obj, map, obj_scene};

#[test]
fn axes_unit_and_ground_follow_the_map_and_wheels_are_split_by_side() {
    let rules = [("Body", "roof"), ("Glass", "windshield_F"), ("Wheels", "wheels_RL|wheels_RR")];
    let imported = import_obj(&map(0.01, "-y", "+z", &rules));
    let extent = imported.model.extent;
    assert!((extent.to_vector() - Extent::new(1.8, 1.5, 4.0).to_vector()).norm() < 1e-6);
    // The file's front is -y and its up is +z: +x is the vehicle's left, which is -x in the vehicle frame.
    let left = center(&imported, PartClass::WheelRearLeft);
    assert!((left[0] + 0.8).abs() < 1e-6 && (left[2] + 1.0).abs() < 1e-6, "{left:?}");
    assert!(center(&imported, PartClass::WheelRearRight)[0] > 0.7);
    let lowest = imported.model.vertices.iter().map(|p| p.y).fold(f64::MIN, f64::max);
    assert!(lowest.abs() < 1e-9);
    assert!(imported.unknown.is_empty() && imported.unused.is_empty());
    // Right-handed axes keep faces outwards; a mirror turns them.
    let volume = |imported: &Imported| {
        let model = imported.model.filled_with(PartClass::Roof).unwrap();
        model.mesh().volume()
    };
    assert!((volume(&imported) - 8.64).abs() < 0.1);
    let mirrored = import_obj(&ImportMap { mirror: true, ..map(0.01, "-y", "+z", &rules) });
    assert!((volume(&mirrored) - 8.64).abs() < 0.1);
}

#[test]
fn the_closest_pattern_decides_and_equal_ones_are_refused() {
    let split = ("Wheels", "wheels_RL|wheels_RR");
    // Both the material and the group are called Glass: the group's name is nearer.
    let rules =
        [("material:Glass", "trunk"), ("node:Glass", "windshield_F"), ("Body", "roof"), split];
    let imported = import_obj(&map(0.01, "-y", "+z", &rules));
    assert!(imported.model.parts.contains(&Some(PartClass::WindshieldFront)));
    assert!(!imported.model.parts.contains(&Some(PartClass::Trunk)));
    let rules = [("Gl*", "trunk"), ("G*", "windshield_F"), ("*", "roof")];
    let error = apply_map(&obj_scene(OBJ).unwrap(), &map(0.01, "-y", "+z", &rules)).unwrap_err();
    assert!(matches!(error, MapError::Ambiguous { .. }), "{error}");
    assert!(error.to_string().contains("`Gl*` and `G*` name the group `Car/Glass`"));
}

#[test]
fn unknown_and_unused_names_are_listed_and_not_guessed() {
    let imported = import_obj(&map(0.01, "-y", "+z", &[("Body", "roof"), ("Bonnet", "hood")]));
    assert_eq!((imported.unknown.as_slice(), imported.unused.as_slice()), (&[1, 2][..], &[1][..]));
    assert_eq!(imported.model.unlabeled(), 6);
}

#[test]
fn a_wrong_side_is_told_and_put_right_by_geometry() {
    let text = OBJ.replace("f 12 13 14", "g Wheel_Right\nf 12 13 14");
    let scene = obj_scene(&text).unwrap();
    // +x is left, so `Wheels` at -x is the right one.
    let rules = [("Wheels", "wheels_RL"), ("Wheel_Right", "wheels_RR"), ("*", "unlabeled")];
    let mut map = map(0.01, "-y", "+z", &rules);
    let imported = apply_map(&scene, &map).unwrap();
    let told: Vec<_> =
        imported.wrong_sides.iter().map(|fault| (fault.part, fault.x > 0.0)).collect();
    assert_eq!(told, [(PartClass::WheelRearLeft, true), (PartClass::WheelRearRight, false)]);
    map.sides = Sides::Geometry;
    let imported = apply_map(&scene, &map).unwrap();
    assert!(imported.wrong_sides.is_empty());
    assert!(center(&imported, PartClass::WheelRearLeft)[0] < -0.7);
}

#[test]
fn mirrors_do_not_widen_the_cuboid_unless_asked() {
    let text =
        OBJ.to_owned() + "g Mirror\nv -110 -50 100\nv -90 -50 100\nv -90 -50 110\nf 15 16 17\n";
    let scene = obj_scene(&text).unwrap();
    let rules = [("Mirror", "mirror_R"), ("*", "unlabeled")];
    let mut map = map(0.01, "-y", "+z", &rules);
    let width = |map: &ImportMap| apply_map(&scene, map).unwrap().model.extent.width;
    assert!((width(&map) - 1.8).abs() < 1e-6);
    map.mirrors_in_extent = true;
    assert!((width(&map) - 2.0).abs() < 1e-6);
    map.extent = Some(Extent::new(1.7, 1.4, 3.9));
    assert!((width(&map) - 1.7).abs() < 1e-12);
}

#[test]
fn maps_that_make_no_model_say_why() {
    let scene = obj_scene(OBJ).unwrap();
    let check = |map: &ImportMap, expected: &str| {
        let error = apply_map(&scene, map).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
        assert!(!error.remedy().is_empty());
    };
    let all = [("*", "unlabeled")];
    check(&map(0.01, "+y", "-y", &all), "the same axis");
    check(&map(1.0, "-y", "+z", &all), "180 x 150 x 400 m large");
    check(&map(100.0, "-y", "+z", &all), "more than 1000 m");
    check(&map(f64::NAN, "-y", "+z", &all), "not a positive number");
    check(&map(0.01, "-y", "+z", &[("*", "ignore")]), "leaves no face");
    let name = ImportMap { name: "a\u{1b}[2J".to_owned(), ..map(0.01, "-y", "+z", &all) };
    check(&name, "the name is");
}

#[test]
fn our_own_models_come_back_through_the_import() {
    let folder = Folder::new();
    for model in ModelZoo::embedded().models {
        let path = folder.write("car.glb", to_glb(&model));
        let scene = read_scene(&path).unwrap();
        let names: Vec<&str> = PartClass::ALL.iter().map(|part| part.name()).collect();
        let rules: Vec<_> = names.iter().map(|name| (*name, *name)).collect();
        let imported = apply_map(&scene, &map(1.0, "+z", "+y", &rules)).unwrap();
        let back = imported.model.to_model().unwrap();
        assert!(imported.wrong_sides.is_empty() && imported.unknown.is_empty());
        assert_eq!(back.missing_parts(), model.missing_parts());
        assert!((back.mesh().volume() - model.mesh().volume()).abs() < 1e-3);
        for (part, area) in model.mesh().areas().iter() {
            assert!((back.mesh().areas().get(part).unwrap() - area).abs() < 1e-4);
        }
    }
}
