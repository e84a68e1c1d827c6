//! Every kind of world in every kind of weather makes pictures whose labels agree with each other.

use std::sync::Arc;

use partpose::geometry::Camera;
use partpose::vehicle::ModelZoo;
use partpose_synth::scene::SegmentClass;
use partpose_synth::shading::{RenderOptions, render};
use partpose_synth::world::{CameraOptions, Fleet, SceneKind, Variation, World, WorldOptions};

const CAMERA: Camera = Camera::pinhole(180.0, [155.0, 47.0], [310, 94]);

fn fleet() -> Arc<Fleet> {
    let models = ModelZoo::embedded().models.into_iter().take(2).collect();
    Arc::new(Fleet::new(&ModelZoo { models }))
}

fn world(kind: SceneKind, fleet: &Arc<Fleet>) -> World {
    let camera = CameraOptions { camera: CAMERA, ..CameraOptions::default() };
    let options = WorldOptions { kind, index: 0, seed: 5, duration: 20.0, camera, open: 0.1 };
    World::new(&options, Arc::clone(fleet))
}

#[test]
fn pixels_of_vehicles_have_a_part_and_a_number_and_no_others_have() {
    let fleet = fleet();
    let mut shown = 0;
    for (i, kind) in SceneKind::ALL.into_iter().enumerate() {
        let moment = world(kind, &fleet).moment(3, 0.5, Variation::ALL[3 * i % 10]);
        let rendered = render(&moment.scene, &RenderOptions::cheap());
        for j in 0..rendered.parts.len() {
            let class = rendered.classes[j];
            let is_vehicle = class == SegmentClass::Car as u8 || class == SegmentClass::Van as u8;
            assert_eq!(is_vehicle, rendered.parts[j] != 0, "{kind:?}, part of pixel {j}");
            assert_eq!(is_vehicle, rendered.instances[j] != 0, "{kind:?}, number of pixel {j}");
            shown += usize::from(is_vehicle);
        }
        assert!(rendered.color.iter().flatten().all(|value| value.is_finite()), "{kind:?}");
    }
    assert!(shown > 500, "{shown} pixels of vehicles");
}

#[test]
fn a_moment_does_not_depend_on_the_moments_before_it() {
    let fleet = fleet();
    for kind in SceneKind::ALL {
        let [fresh, used] = [world(kind, &fleet), world(kind, &fleet)];
        for frame in [40, 2, 17] {
            used.moment(frame, 0.1, Variation::Clone);
        }
        let [a, b] = [&fresh, &used].map(|world| world.moment(9, 0.1, Variation::Rain));
        assert_eq!(a.vehicles, b.vehicles, "{kind:?}");
        assert_eq!(a.scene.world_from_camera, b.scene.world_from_camera, "{kind:?}");
        assert_eq!(a.scene.objects.len(), b.scene.objects.len(), "{kind:?}");
        for (a, b) in a.scene.objects.iter().zip(&b.scene.objects) {
            assert_eq!(a.world_from_object, b.world_from_object, "{kind:?}");
            assert_eq!(a.materials, b.materials, "{kind:?}");
        }
    }
}
