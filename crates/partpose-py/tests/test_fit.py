"""Zoo, fit of anyone's masks, metrics: on vehicles that the package renders itself."""

import pickle
import threading
import time

import numpy as np
import partpose
import pytest

from conftest import CAMERA


def test_the_zoo_has_models_with_meshes_and_parts(zoo, tmp_path):
    assert len(zoo) == 17 and len(partpose.PARTS) == 29
    model = zoo[zoo.names[0]]
    assert model.vertices.shape[1] == 3 and model.faces.max() < len(model.vertices)
    assert len(model.parts) == len(model.faces) and set(model.parts) <= set(range(1, 30))
    zoo.save(tmp_path / "zoo")
    assert sorted(partpose.ModelZoo.load(tmp_path / "zoo").names) == sorted(zoo.names)
    with pytest.raises(KeyError, match="sedan"):
        zoo["of no zoo"]


def test_cameras_and_cuboids_survive_pickling_and_project(scene):
    cuboid = scene[1][0]
    assert pickle.loads(pickle.dumps(CAMERA)) == CAMERA
    copied = pickle.loads(pickle.dumps(cuboid))
    assert np.allclose(copied.corners(), cuboid.corners()) and cuboid.iou(copied) == pytest.approx(1)
    pixels = CAMERA.project([[0, 0, 10], [0, 0, -1]])
    assert pixels[0].tolist() == [620.5, 187.0] and np.isnan(pixels[1]).all()
    corners = CAMERA.project(cuboid.corners())
    assert np.allclose(cuboid.project(CAMERA), [*corners.min(axis=0), *corners.max(axis=0)])
    guess = partpose.Camera.from_field_of_view((400, 300), 90)
    assert guess.focal == pytest.approx((200, 200)) and guess.principal_point == (199.5, 149.5)


def test_rendered_vehicles_are_found_where_they_are(scene, estimator, probabilities):
    names, cuboids, _, boxes = scene
    assert probabilities.shape == (2, 30, 28, 28) and np.allclose(probabilities.sum(axis=1), 1, atol=1e-4)
    extents = [cuboid.extent for cuboid in cuboids]
    found = estimator.fit(CAMERA, boxes, [0.9, 0.8], probabilities, extents)
    for pose, name, cuboid, box in zip(found, names, cuboids, boxes):
        assert pose and pose.model == name and pose.category == "Car" and pose.bounds == tuple(box)
        assert pose.confidence > 0 and pose.covariance.shape == (6, 6)
        assert sum(pose.model_probabilities.values()) == pytest.approx(1)
        deviation = partpose.pose_deviation(pose.cuboid, cuboid)
        assert deviation["iou3d"] > 0.85, deviation
        assert np.allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-9)


def test_instances_of_parts_become_the_labels_they_were(scene):
    images = scene[2]
    parts = np.unique(images["parts"])[1:]
    masks = np.stack([images["parts"] == part for part in parts])[:, None].astype(np.float32)
    assert (partpose.labels_from_instances(masks, parts, np.full(len(parts), 0.8)) == images["parts"]).all()
    assert partpose.labels_from_instances(np.zeros((0, 4, 5)), []).shape == (4, 5)
    with pytest.raises(ValueError, match="1 to 29"):
        partpose.labels_from_instances(masks[:1], [30])
    with pytest.raises(ValueError, match=r"\(3, 4\)"):
        partpose.labels_from_instances(np.zeros((3, 4)), [1, 2, 3])


def test_arrays_may_be_slices_and_of_other_types(scene, estimator, probabilities):
    boxes = scene[3]
    wide = np.zeros((4, 30, 28, 56))
    wide[::2, :, :, ::2] = probabilities

    def places(*arguments, **named):
        return [pose.translation.tolist() for pose in estimator.fit(CAMERA, *arguments, **named)]

    expected = places(boxes, [1, 1], probabilities)
    assert places(boxes.tolist(), (1.0, 1.0), wide[::2, :, :, ::2]) == expected
    assert places(boxes + 0.5, [1, 1], probabilities, pixel_origin="corner") == expected
    assert places(boxes, [1, 1], probabilities, alone=True) == expected
    assert places(np.zeros((0, 4)), [], np.zeros((0, 30, 28, 28))) == []
    assert places([], [], []) == []


def test_detections_of_several_images_keep_to_themselves(scene, estimator, probabilities):
    boxes = scene[3]
    shuffled = estimator.fit(CAMERA, boxes[[0, 1, 0]], [1, 1, 1], probabilities[[0, 1, 0]], image=[7, 3, 3])
    apart = [estimator.fit(CAMERA, boxes[[i]], [1], probabilities[[i]])[0] for i in (0, 1)]
    together = estimator.fit(CAMERA, boxes[[1, 0]], [1, 1], probabilities[[1, 0]])
    expected = [apart[0], *together]
    assert [p.translation.tolist() for p in shuffled] == [p.translation.tolist() for p in expected]


def test_a_mask_without_parts_has_a_reason(estimator):
    nothing = np.zeros((1, 30, 28, 28))
    nothing[:, 0] = 1
    (found,) = estimator.fit(CAMERA, [[100, 100, 200, 200]], [0.5], nothing)
    assert not found and isinstance(found, partpose.NoPose) and found.reason and found.score == 0.5


GOOD = {"boxes": [[1, 2, 30, 40]], "scores": [0.5], "part_probabilities": np.full((1, 30, 28, 28), 1 / 30)}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"boxes": [[1, 2, 3]]}, r"`boxes` has the shape \[1, 3\], but \[N, 4\], x_min"),
        ({"boxes": [1, 2, 3, 4]}, r"`boxes` has the shape \[4\]"),
        ({"boxes": "none"}, "`boxes` is no array of numbers"),
        ({"boxes": None}, "`boxes`"),
        ({"boxes": [[9, 2, 3, 40]]}, "`boxes`: box 0 is .* with an area"),
        ({"boxes": [[float("nan"), 2, 30, 40]]}, "box 0"),
        ({"boxes": [[-1e300, 2, 1e300, 40]]}, "box 0"),
        ({"scores": [1.5]}, "`scores`: that of detection 0 is 1.5, but 0 to 1"),
        ({"scores": [0.5, 0.5]}, "`boxes` has 1 boxes, but `scores` 2"),
        ({"scores": 0.5}, r"`scores` has the shape \[\], but \[N\]"),
        ({"part_probabilities": np.zeros((1, 29, 28, 28))}, r"shape \[1, 29, 28, 28\], but \[1, 30, m, m\]"),
        ({"part_probabilities": np.zeros((1, 30, 28, 27))}, r"\[1, 30, 28, 27\]"),
        ({"part_probabilities": np.zeros((2, 30, 28, 28))}, r"\[1, 30, m, m\]"),
        ({"part_probabilities": np.zeros((1, 30, 0, 0))}, r"m from 1 to 512"),
        ({"part_probabilities": np.full((1, 30, 28, 28), 0.5)}, "soft-max"),
        ({"part_probabilities": np.full((1, 30, 28, 28), np.nan)}, "not a probability"),
        ({"extents": [0, 1, 1]}, "`extents` has .* metres"),
        ({"extents": [[1, 1, 1], [1, 1, 1]]}, "1 boxes, but `extents` 2"),
        ({"extents": "large"}, "`free`"),
        ({"image": [1, 2]}, "1 boxes, but `image` 2"),
        ({"pixel_origin": "middle"}, "`corner`"),
        ({"camera_height": 1.6}, "ground=True"),
        ({"gravity": [0, 0, 0]}, "`gravity`"),
    ],
)
def test_what_makes_no_sense_is_named(estimator, change, said):
    with pytest.raises(ValueError, match=said):
        estimator.fit(CAMERA, **{**GOOD, **change})


def test_options_methods_and_cameras_are_checked(zoo):
    with pytest.raises(ValueError, match="`method`"):
        partpose.PoseEstimator(zoo, method="magic")
    with pytest.raises(ValueError, match="unknown field"):
        partpose.PoseEstimator(zoo, options={"magic": 1})
    with pytest.raises(ValueError, match="`focal`"):
        partpose.Camera((0, 725), (1, 1), (9, 9))
    with pytest.raises(ValueError, match="`size`"):
        partpose.Camera((725, 725), (1, 1), (-9, 9))
    with pytest.raises(ValueError, match="`degrees`"):
        partpose.Camera.from_field_of_view((9, 9), 200)
    with pytest.raises(ValueError, match="`rotation`"):
        partpose.Cuboid([0, 0, 9], np.eye(3) * 2, [1, 1, 1])
    with pytest.raises(ValueError, match="`translation`"):
        partpose.Cuboid([0, 0], np.eye(3), [1, 1, 1])
    with pytest.raises(TypeError):
        partpose.PoseEstimator("zoo")
    with pytest.raises(ValueError, match="`points`"):
        CAMERA.project([[1, 2]])


@pytest.mark.parametrize(
    ("labels", "said"),
    [
        (np.full((4, 4), 77), "`labels` holds 77"),
        (np.full((4, 4), 300), "`labels` holds 300"),
        (np.full((4, 4), -1), "`labels` holds -1"),
        (np.zeros((4, 4)), "float64"),
        (np.zeros((4, 4, 3), int), r"\[4, 4, 3\]"),
        (np.zeros((4, 0), int), "1 to 16384"),
    ],
)
def test_label_images_are_checked(labels, said):
    with pytest.raises(ValueError, match=said):
        partpose.probabilities_from_labels(labels, [[0, 0, 2, 2]])
    with pytest.raises(ValueError, match="`size`"):
        partpose.probabilities_from_labels(np.zeros((4, 4), int), [[0, 0, 2, 2]], size=0)


def test_a_panic_is_an_exception_that_is_caught():
    with pytest.raises(RuntimeError, match="bug in partpose: asked for"):
        partpose._partpose._panic_for_tests()


def test_other_threads_run_while_a_fit_does(scene, estimator, probabilities):
    boxes = scene[3].repeat(8, axis=0)
    many = probabilities.repeat(8, axis=0)
    done, ticks = threading.Event(), []

    def work():
        estimator.fit(CAMERA, boxes, np.ones(16), many, alone=True)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.is_set():
        ticks.append(time.perf_counter())
        time.sleep(0.001)
    thread.join()
    assert len(ticks) > 5


def test_one_estimator_serves_several_threads(scene, estimator, probabilities):
    boxes, found = scene[3], [None] * 4

    def work(index):
        found[index] = [p.translation.tolist() for p in estimator.fit(CAMERA, boxes, [1, 1], probabilities)]

    threads = [threading.Thread(target=work, args=(index,)) for index in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(places == found[0] for places in found) and len(found[0]) == 2
