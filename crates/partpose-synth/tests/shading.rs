//! Pictures are the same on any number of threads, labels are those of the label renderer, light adds up.

use std::sync::Arc;

use nalgebra::{Point3, UnitQuaternion, Vector3};
use partpose::geometry::{Camera, Pose};
use partpose::parts::{CoarseClass, PartClass};
use partpose::render::{Instance, render_labels};
use partpose::vehicle::ModelZoo;
use partpose_synth::camera::{CameraEffects, photograph};
use partpose_synth::scene::{
    Air, Light, Material, Object, Scene, SegmentClass, SurfaceMesh, Texture,
};
use partpose_synth::shading::{RenderOptions, Rendered, render};
use partpose_synth::vehicles::{Lamps, Riders, VehicleKind, materials, random_look, vehicle_kind};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const CAMERA: Camera = Camera::pinhole(200.0, [159.5, 59.5], [320, 120]);

fn kinds() -> Vec<VehicleKind> {
    ModelZoo::embedded().models.iter().take(2).map(vehicle_kind).collect()
}

fn place(x: f64, z: f64, turn: f64) -> Pose {
    Pose::from_parts(
        nalgebra::Translation3::new(x, 1.5, z),
        UnitQuaternion::from_euler_angles(0.0, turn, 0.0),
    )
}

fn cars() -> Vec<Object> {
    let kinds = kinds();
    let places = [
        place(-1.5, 7.0, 2.9),
        place(1.8, 9.0, 0.2),
        place(0.8, 11.0, -1.3),
        place(-9.0, 14.0, 0.9),
    ];
    let car = |(i, pose): (usize, Pose)| Object {
        mesh: Arc::clone(&kinds[i % 2].surface),
        materials: materials(
            &random_look(&mut ChaCha8Rng::seed_from_u64(i as u64)),
            Lamps { head: true, brake: true, ..Lamps::default() },
            Riders { driver: i != 1, beside: i == 0, behind: i == 2 },
        ),
        world_from_object: pose,
        scale: Vector3::new(1.02, 0.98, 1.0 + 0.01 * i as f64),
        class: SegmentClass::Car,
        instance: 40 + i as u16,
        has_parts: true,
    };
    places.into_iter().enumerate().map(car).collect()
}

fn plain(color: [f32; 3]) -> Material {
    Material {
        color,
        texture: Texture::Plain,
        roughness: 1.0,
        metallic: 0.0,
        clear_coat: 0.0,
        transmission: 0.0,
        emission: [0.0; 3],
        dirt: 0.0,
    }
}

fn quad(
    corners: [[f32; 3]; 4],
    normal: Vector3<f32>,
    material: Material,
    class: SegmentClass,
) -> Object {
    let mesh = SurfaceMesh {
        vertices: corners.map(Point3::from).to_vec(),
        normals: vec![normal; 4],
        coordinates: corners.map(|p| [p[0], p[2] + p[1]]).to_vec(),
        faces: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![0; 2],
        parts: vec![0; 2],
        ..SurfaceMesh::default()
    };
    Object {
        mesh: Arc::new(mesh),
        materials: Arc::new([material]),
        world_from_object: Pose::identity(),
        scale: Vector3::repeat(1.0),
        class,
        instance: 0,
        has_parts: false,
    }
}

fn road() -> Object {
    let asphalt = Material { texture: Texture::Asphalt, ..plain([0.1; 3]) };
    let corners = [[-40.0, 1.5, -5.0], [40.0, 1.5, -5.0], [40.0, 1.5, 80.0], [-40.0, 1.5, 80.0]];
    quad(corners, -Vector3::y(), asphalt, SegmentClass::Road)
}

fn scene(objects: Vec<Object>) -> Scene {
    Scene {
        objects,
        light: Light { to_sun: Vector3::new(0.4, -0.7, -0.5), turbidity: 3.0, overcast: 0.0 },
        air: Air { fog: 0.002, rain: 0.3, wetness: 0.4 },
        camera: CAMERA,
        world_from_camera: Pose::identity(),
        world_from_camera_after: Pose::translation(0.0, 0.0, 0.2),
        world_from_vehicles_after: Vec::new(),
    }
}

fn street() -> Scene {
    let mut objects = cars();
    objects.push(road());
    let leaves =
        Material { texture: Texture::Leaves { cover: 0.5, size: 0.2 }, ..plain([0.1, 0.2, 0.05]) };
    let corners = [[-1.0, -1.0, 5.0], [1.0, -1.0, 5.0], [1.0, 1.5, 5.0], [-1.0, 1.5, 5.0]];
    objects.push(quad(corners, -Vector3::z(), leaves, SegmentClass::Tree));
    scene(objects)
}

#[test]
fn pictures_do_not_depend_on_the_number_of_threads() {
    let scene = street();
    let effects = CameraEffects {
        drops: 3,
        rain: 0.5,
        noise: 0.02,
        flare: 0.5,
        motion_blur: 1.0,
        softness: 0.5,
        aberration: 0.5,
        sharpening: 0.3,
        vignette: 0.2,
        jpeg: Some(80),
        ..CameraEffects::default()
    };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let rendered = render(&scene, &RenderOptions::default());
            let image = photograph(&scene, &rendered, &effects, 7);
            (rendered, image)
        })
    };
    let [one, three] = [on(1), on(3)];
    assert!(one.0 == three.0, "the rendered pictures differ");
    assert!(one.1 == three.1, "the photographs differ");
}

/// Compares with what `render_labels` says of the vehicles; returns how many pixels show one.
fn check_labels(scene: &Scene) -> (Rendered, usize) {
    let rendered = render(scene, &RenderOptions::cheap());
    let zoo = ModelZoo::embedded();
    let cars: Vec<&Object> = scene.objects.iter().filter(|object| object.has_parts).collect();
    let instances: Vec<Instance> = cars
        .iter()
        .enumerate()
        .map(|(i, car)| Instance {
            mesh: zoo.models[i % 2].mesh(),
            scale: car.scale,
            camera_from_vehicle: scene.world_from_camera.inverse() * car.world_from_object,
            id: car.instance,
        })
        .collect();
    let labels = render_labels(&scene.camera, &instances);
    let mut count = 0;
    for i in 0..labels.parts.len() {
        let is_hidden = rendered.depths[i] < labels.depths[i];
        if labels.parts[i] != 0 && !is_hidden {
            count += 1;
            assert_eq!(rendered.parts[i], labels.parts[i], "part of pixel {i}");
            assert_eq!(rendered.instances[i], labels.instances[i], "instance of pixel {i}");
            let [mine, theirs] = [rendered.depths[i], labels.depths[i]].map(f32::to_bits);
            assert_eq!(mine, theirs, "depth of pixel {i}");
        } else {
            assert_eq!(rendered.parts[i], 0, "pixel {i} shows no vehicle");
        }
    }
    (rendered, count)
}

#[test]
fn labels_of_vehicles_are_those_of_the_label_renderer() {
    let (_, count) = check_labels(&scene(cars()));
    assert!(count > 4000, "{count} pixels of vehicles");
}

#[test]
fn every_pixel_of_a_vehicle_carries_a_part_and_what_stands_before_it_hides_it() {
    let (rendered, count) = check_labels(&street());
    let classes = rendered.classes.iter();
    let of = |class: SegmentClass| {
        classes.clone().map(|c| usize::from(*c == class as u8)).sum::<usize>()
    };
    assert_eq!(of(SegmentClass::Car), count);
    assert!(of(SegmentClass::Tree) > 500);
}

#[test]
fn the_picture_shows_vehicles_where_the_labels_say_so() {
    // Before a shining wall, which shows wherever no vehicle hides it.
    let mut objects = cars();
    let corners =
        [[-60.0, -40.0, 40.0], [60.0, -40.0, 40.0], [60.0, 40.0, 40.0], [-60.0, 40.0, 40.0]];
    let shining = Material { emission: [50.0; 3], ..plain([0.0; 3]) };
    objects.push(quad(corners, -Vector3::z(), shining, SegmentClass::Building));
    let mut scene = scene(objects);
    scene.air = Air::default();
    let rendered = render(&scene, &RenderOptions::cheap());
    let mut wrong = 0;
    for (part, color) in rendered.parts.iter().zip(&rendered.color) {
        let is_glass =
            PartClass::from_id(*part).is_some_and(|part| part.coarse() == CoarseClass::Glass);
        let shines = color.iter().all(|value| *value > 40.0);
        wrong += usize::from(!is_glass && shines == (*part != 0));
    }
    assert!(wrong < 8, "{wrong} pixels where picture and labels disagree");
}

#[test]
fn a_white_surface_has_the_radiance_that_the_overcast_sky_gives_it() {
    let corners =
        [[-400.0, 2.0, -400.0], [400.0, 2.0, -400.0], [400.0, 2.0, 400.0], [-400.0, 2.0, 400.0]];
    let white = quad(corners, -Vector3::y(), plain([1.0; 3]), SegmentClass::Terrain);
    let mut scene = scene(vec![white]);
    scene.air = Air::default();
    scene.light.overcast = 1.0;
    let rendered = render(&scene, &RenderOptions::cheap());
    let [width, height] = rendered.size.map(|side| side as usize);
    let ground = rendered.color[(height - 5) * width + width / 2][1];
    let above = rendered.color[width / 2][1];
    // Under the CIE's overcast sky a level surface has 7/9 of the zenith's radiance, the sky at a height a third of it
    // and two thirds times the height's sine.
    let sine = (59.5_f32 / 200.0).atan().sin();
    let expected = 7.0 / 9.0 / ((1.0 + 2.0 * sine) / 3.0);
    // A dark band stands along the horizon, and clouds lie in the sky.
    assert!((ground / above / expected - 1.0).abs() < 0.2, "{ground} {above} {expected}");
}

#[test]
fn no_light_is_lost_to_numbers_that_are_none() {
    for (overcast, turbidity, height) in [(0.0, 2.0, 0.02), (0.5, 10.0, -0.1), (0.0, 1.0, 1.0)] {
        let mut scene = street();
        let across = f64::sqrt(1.0 - height * height);
        scene.light = Light { to_sun: Vector3::new(across, -height, 0.0), turbidity, overcast };
        let rendered = render(&scene, &RenderOptions::default());
        let is_sound = |value: &f32| value.is_finite() && *value >= 0.0;
        assert!(rendered.color.iter().flatten().all(is_sound), "{overcast} {turbidity} {height}");
    }
}

#[test]
fn an_empty_scene_is_sky() {
    let rendered = render(&scene(Vec::new()), &RenderOptions::default());
    assert!(rendered.classes.iter().all(|class| *class == SegmentClass::Sky as u8));
    assert!(rendered.depths.iter().all(|depth| *depth == f32::INFINITY));
}

#[test]
fn surfaces_that_lack_normals_or_materials_are_drawn_nevertheless() {
    let mut broken = road();
    let mesh = Arc::make_mut(&mut broken.mesh);
    mesh.normals.clear();
    mesh.coordinates.clear();
    mesh.materials = vec![9; 2];
    mesh.faces.push([0, 1, 77]);
    let rendered = render(&scene(vec![broken]), &RenderOptions::default());
    assert!(rendered.classes.contains(&(SegmentClass::Road as u8)));
}

#[test]
fn finer_sampling_changes_the_picture_and_no_label() {
    let scene = street();
    let [cheap, fine] =
        [RenderOptions::cheap(), RenderOptions::default()].map(|options| render(&scene, &options));
    assert!(cheap.color != fine.color);
    assert!(cheap.parts == fine.parts);
    assert!(cheap.instances == fine.instances);
    assert!(cheap.classes == fine.classes);
}

#[test]
fn wet_roads_mirror_what_stands_on_them_in_the_cheap_preset_too() {
    let road_of = |color: [f32; 3], wetness: f64| {
        let corners = [[-4.0, -3.0, 9.0], [4.0, -3.0, 9.0], [4.0, 1.5, 9.0], [-4.0, 1.5, 9.0]];
        let wall = quad(corners, -Vector3::z(), plain(color), SegmentClass::Building);
        let scene = Scene { air: Air { wetness, ..Air::default() }, ..scene(vec![road(), wall]) };
        let rendered = render(&scene, &RenderOptions { shadows: 0, ..RenderOptions::cheap() });
        let seen = rendered.color.iter().zip(&rendered.classes);
        let road = seen.filter(|(_, class)| **class == SegmentClass::Road as u8);
        road.map(|(color, _)| *color).collect::<Vec<_>>()
    };
    let [red, blue] = [[0.8, 0.05, 0.05], [0.05, 0.05, 0.8]];
    let (a, b) = (road_of(red, 1.0), road_of(blue, 1.0));
    let redder = a.iter().zip(&b).filter(|(a, b)| a[0] > b[0] && a[2] < b[2]).count();
    assert!(redder > 500, "{redder} of {} pixels of the road mirror the wall", a.len());
    assert_eq!(road_of(red, 0.0), road_of(blue, 0.0));
}

#[test]
fn an_effect_that_is_switched_on_leaves_the_others_as_they_were() {
    let scene = street();
    let rendered = render(&scene, &RenderOptions::cheap());
    let without = CameraEffects { noise: 0.02, sharpening: 0.3, ..CameraEffects::default() };
    let with = CameraEffects { drops: 2, rain: 0.2, ..without };
    let [a, b] = [without, with].map(|effects| photograph(&scene, &rendered, &effects, 5));
    let same = a.pixels().zip(b.pixels()).filter(|(a, b)| a == b).count();
    let all = rendered.parts.len();
    // Only drops and streaks differ: noise is the same, number by number.
    assert!(same > all * 6 / 10 && same < all, "{same} of {all} pixels are the same");
}

#[test]
fn far_vehicles_and_shadows_come_from_a_body_as_large_as_the_near_one() {
    for kind in kinds() {
        let size = |mesh: &SurfaceMesh| {
            let corners = mesh.faces.iter().flatten().map(|i| mesh.vertices[*i as usize].coords);
            let first = (Vector3::repeat(f32::MAX), Vector3::repeat(f32::MIN));
            let (low, high) = corners.fold(first, |(low, high), p| (low.inf(&p), high.sup(&p)));
            high - low
        };
        let near = kind.surface.coarse.as_ref().unwrap();
        let far = near.coarse.as_ref().unwrap();
        for (coarse, share) in [(near, 0.9), (far, 0.5)] {
            let difference = (size(coarse) - size(&kind.surface)).amax();
            assert!(difference < 0.15, "{}: {difference} m", kind.name);
            let share = share * kind.surface.faces.len() as f64;
            assert!((coarse.faces.len() as f64) < share, "{}", kind.name);
            assert_eq!(coarse.vertices.len(), coarse.normals.len());
        }
    }
}
