"""The Python package, on vehicles that it renders itself."""

import threading
import time

import numpy as np
import partpose
import pytest

CAMERA = partpose.Camera((725.0, 725.0), (620.5, 187.0), (1242, 375))


@pytest.fixture(scope="module")
def zoo():
    return partpose.ModelZoo.embedded()


@pytest.fixture(scope="module")
def estimator(zoo):
    return partpose.PoseEstimator(zoo)


def turn(yaw):
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def scene(zoo):
    """Two vehicles that do not overlap: names, cuboids, label images, boxes."""
    names = [zoo.names[3], zoo.names[8]]
    places = [([-2.5, 1.5, 11.0], 0.4), ([3.5, 1.6, 14.0], 2.6)]
    cuboids = [partpose.Cuboid(place, turn(yaw), zoo[name].extent) for name, (place, yaw) in zip(names, places)]
    images = partpose.render_labels(CAMERA, zoo, list(zip(names, cuboids)))
    boxes = []
    for index in (1, 2):
        rows, columns = np.nonzero(images["instances"] == index)
        boxes.append([columns.min() - 0.5, rows.min() - 0.5, columns.max() + 0.5, rows.max() + 0.5])
    return names, cuboids, images, np.array(boxes)


def test_the_zoo_has_models_with_meshes_and_parts(zoo, tmp_path):
    assert len(zoo) == 17 and len(partpose.PARTS) == 29
    model = zoo[zoo.names[0]]
    assert model.vertices.shape[1] == 3 and model.faces.max() < len(model.vertices)
    assert len(model.parts) == len(model.faces) and set(model.parts) <= set(range(1, 30))
    zoo.save(tmp_path / "zoo")
    assert sorted(partpose.ModelZoo.load(tmp_path / "zoo").names) == sorted(zoo.names)
    with pytest.raises(KeyError):
        zoo["of no zoo"]


def test_rendered_vehicles_are_found_where_they_are(zoo, estimator):
    names, cuboids, images, boxes = scene(zoo)
    probabilities = partpose.probabilities_from_labels(images["parts"], boxes)
    assert probabilities.shape == (2, 30, 28, 28) and np.allclose(probabilities.sum(axis=1), 1, atol=1e-4)
    extents = [cuboid.extent for cuboid in cuboids]
    found = estimator.fit(CAMERA, boxes, [0.9, 0.8], probabilities, extents)
    for pose, name, cuboid in zip(found, names, cuboids):
        assert pose and pose.model == name and pose.confidence > 0 and pose.covariance.shape == (6, 6)
        deviation = partpose.pose_deviation(pose.cuboid, cuboid)
        assert deviation["iou3d"] > 0.85, deviation
        assert np.allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-9)


def test_instances_of_parts_become_the_labels_they_were(zoo):
    _, _, images, _ = scene(zoo)
    parts = np.unique(images["parts"])[1:]
    masks = np.stack([images["parts"] == part for part in parts])[:, None].astype(np.float32)
    assert (partpose.labels_from_instances(masks, parts, np.full(len(parts), 0.8)) == images["parts"]).all()
    assert partpose.labels_from_instances(np.zeros((0, 4, 5)), []).shape == (4, 5)
    with pytest.raises(ValueError, match="1 to 29"):
        partpose.labels_from_instances(masks[:1], [30])


def test_arrays_may_be_slices_and_of_other_types(zoo, estimator):
    _, _, images, boxes = scene(zoo)
    one = partpose.probabilities_from_labels(images["parts"], boxes)
    wide = np.zeros((4, 30, 28, 56))
    wide[::2, :, :, ::2] = one
    a = estimator.fit(CAMERA, boxes, [1, 1], one)
    b = estimator.fit(CAMERA, boxes.tolist(), (1.0, 1.0), wide[::2, :, :, ::2])
    assert [p.translation.tolist() for p in a] == [p.translation.tolist() for p in b]
    shifted = estimator.fit(CAMERA, boxes + 0.5, [1, 1], one, pixel_origin="corner")
    assert [p.translation.tolist() for p in a] == [p.translation.tolist() for p in shifted]
    assert estimator.fit(CAMERA, np.zeros((0, 4)), [], np.zeros((0, 30, 28, 28))) == []


def test_a_mask_without_parts_has_a_reason(estimator):
    nothing = np.zeros((1, 30, 28, 28))
    nothing[:, 0] = 1
    (found,) = estimator.fit(CAMERA, [[100, 100, 200, 200]], [0.5], nothing)
    assert not found and isinstance(found, partpose.NoPose) and found.reason


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"boxes": [[1, 2, 3]]}, "4"),
        ({"boxes": [[9, 2, 3, 40]]}, "box 0"),
        ({"boxes": [[float("nan"), 2, 30, 40]]}, "box 0"),
        ({"scores": [1.5]}, "score 1.5"),
        ({"scores": [0.5, 0.5]}, "2 scores"),
        ({"part_probabilities": np.zeros((1, 29, 28, 28))}, "29"),
        ({"part_probabilities": np.full((1, 30, 28, 28), 0.5)}, "soft-max"),
        ({"part_probabilities": np.full((1, 30, 28, 28), np.nan)}, "not a probability"),
        ({"extents": [0, 1, 1]}, "metres"),
        ({"extents": "large"}, "free"),
        ({"pixel_origin": "middle"}, "corner"),
    ],
)
def test_what_makes_no_sense_is_named(estimator, change, said):
    arguments = {"boxes": [[1, 2, 30, 40]], "scores": [0.5], "part_probabilities": np.full((1, 30, 28, 28), 1 / 30)}
    with pytest.raises(ValueError, match=said):
        estimator.fit(CAMERA, **{**arguments, **change})


def test_options_methods_and_cameras_are_checked(zoo):
    with pytest.raises(ValueError, match="method"):
        partpose.PoseEstimator(zoo, method="magic")
    with pytest.raises(ValueError, match="unknown field"):
        partpose.PoseEstimator(zoo, options={"magic": 1})
    with pytest.raises(ValueError, match="focal"):
        partpose.Camera((0, 725), (1, 1), (9, 9))
    with pytest.raises(ValueError, match="rotation"):
        partpose.Cuboid([0, 0, 9], np.eye(3) * 2, [1, 1, 1])
    with pytest.raises(TypeError):
        partpose.PoseEstimator("zoo")
    with pytest.raises(ValueError, match="label 77"):
        partpose.probabilities_from_labels(np.full((4, 4), 77), [[0, 0, 2, 2]])


def test_files_that_are_missing_or_wrong_are_named(tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        partpose.ModelZoo.load(tmp_path / "nowhere")
    wrong = tmp_path / "a.safetensors"
    wrong.write_bytes(b"not a file of tensors")
    with pytest.raises(ValueError, match="safetensors"):
        partpose.read_detections(wrong)
    (tmp_path / "a.txt").write_text("Car 0 0\n")
    with pytest.raises(ValueError, match="line 1"):
        partpose.score_kitti(tmp_path, tmp_path)


def test_scores_of_kitti_have_its_shape(tmp_path):
    line = "Car 0.00 0 1.60 300.00 170.00 420.00 260.00 1.60 1.65 3.62 -4.11 1.66 14.06 1.32"
    for name, text in [("labels", line), ("results", line + " 0.9")]:
        (tmp_path / name).mkdir()
        (tmp_path / name / "000000.txt").write_text(text + "\n")
    scores = partpose.score_kitti(tmp_path / "labels", tmp_path / "results")
    assert scores["car"]["3d"]["R11"]["easy"] == pytest.approx(100 / 11)
    assert scores["pedestrian"]["2d"]["R40"]["hard"] is None


def test_a_panic_is_an_exception_that_is_caught():
    with pytest.raises(RuntimeError, match="bug in partpose: asked for"):
        partpose._partpose._panic_for_tests()


def test_other_threads_run_while_a_fit_does(zoo, estimator):
    _, _, images, boxes = scene(zoo)
    probabilities = partpose.probabilities_from_labels(images["parts"], boxes).repeat(8, axis=0)
    boxes = boxes.repeat(8, axis=0)
    done, ticks = threading.Event(), []

    def work():
        estimator.fit(CAMERA, boxes, np.ones(16), probabilities)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.is_set():
        ticks.append(time.perf_counter())
        time.sleep(0.001)
    thread.join()
    assert len(ticks) > 5


def test_the_example_finds_poses():
    import importlib.util
    from pathlib import Path

    path = Path(__file__).parents[3] / "examples/python/lift_mask_rcnn.py"
    spec = importlib.util.spec_from_file_location("lift_mask_rcnn", path)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    poses = example.lift(example.detector_output())
    assert len(poses) == 2 and all(poses)
