"""Images, the network, data sets, labels, results: on the sample that the repository ships."""

import json

import numpy as np
import partpose
import pytest

from conftest import ROOT, WORLD

IMAGE = WORLD / "vkitti_1.3.1_rgb/1001/clone/00000.png"
CAMERA = partpose.Camera(**json.loads((WORLD / "camera.json").read_text()))


@pytest.fixture(scope="module")
def frames():
    return partpose.Dataset(WORLD).frames()


def test_the_network_finds_the_vehicles_of_an_image(detector, estimator, frames, tmp_path):
    frame = next(frame for frame in frames if frame.sequence.startswith("1001"))
    found = detector.detect(partpose.read_image(frame.image))
    assert found["boxes"].shape[1:] == (4,) and found["part_probabilities"].shape[1:] == (30, 28, 28)
    poses = estimator.fit(frame.camera, **found)
    truths = [vehicle["cuboid"] for vehicle in frame.vehicles if not vehicle["dont_care"]]
    assert truths and len(poses) == len(found["scores"])
    nearest = min(truths, key=lambda truth: np.linalg.norm(truth.translation))
    near = min((pose.cuboid for pose in poses if pose), key=lambda cuboid: partpose.pose_deviation(cuboid, nearest)["distance"])
    deviation = partpose.pose_deviation(near, nearest)
    # The model's size stands in for the unknown one, and distance follows size.
    assert deviation["distance"] < 0.2 * np.linalg.norm(nearest.translation), deviation
    partpose.write_results(tmp_path, "1001/clone/00000.png", frame.camera, poses)
    written = json.loads((tmp_path / "1001_clone_00000.json").read_text())
    assert len(written["vehicles"]) == sum(map(bool, poses))
    assert len((tmp_path / "1001_clone_00000.txt").read_text().splitlines()) == sum(map(bool, poses))
    with pytest.raises(TypeError, match="`poses` holds"):
        partpose.write_results(tmp_path, "a.png", frame.camera, [1])
    with pytest.raises(ValueError, match="`image`"):
        partpose.write_results(tmp_path, "../..", frame.camera, [])


def test_the_network_is_one_for_all_threads_and_says_what_it_takes(detector):
    image = partpose.read_image(IMAGE)
    assert image.shape == (187, 621, 3) and detector.kernel == 28
    for wrong, said in [
        (image.astype(np.float32) / 255, 'float32.*astype\\("uint8"\\)'),
        (image[..., 0], r"\[187, 621\], but \[H, W, 3\]"),
        (np.zeros((0, 5, 3), np.uint8), "1 to 16384"),
        ("photo.png", "`image` is of <U9"),
    ]:
        with pytest.raises(ValueError, match=said):
            detector.detect(wrong)
    with pytest.raises(ValueError, match="`min_score`"):
        detector.detect(image, min_score=2)
    empty = detector.detect(np.zeros((64, 96, 3), np.uint8))
    assert empty["boxes"].shape == (0, 4) and partpose.PoseEstimator().fit(CAMERA, **empty) == []


def test_a_data_set_has_frames_cameras_vehicles_and_masks(frames):
    dataset = partpose.Dataset(WORLD)
    assert dataset.layout == "Virtual KITTI 1.3.1" and len(frames) == len(dataset.sequences) == 4
    frame = frames[0]
    assert frame.camera == CAMERA and frame.image.endswith("00000.png") and frame.index == 0
    parts = frame.parts()
    assert parts.shape == (187, 621) and parts.max() <= 29
    assert {vehicle["category"] for vehicle in frame.vehicles} <= {"Car", "Van", "Truck"}
    with pytest.raises(ValueError, match="there is no `9999`; there are 1001"):
        dataset.frames(["9999"])


def test_labels_in_memory_are_those_in_files(frames, zoo, tmp_path):
    dataset = partpose.Dataset(WORLD)
    for shard in ["1/2", "2/2"]:
        done = partpose.label_dataset(dataset, zoo, tmp_path / "labels", shard=shard)
        assert done["skipped"] == 0, done
    again = partpose.label_dataset(dataset, zoo, tmp_path / "labels", resume=True)
    assert (again["written"], again["kept"], again["missing_blocks"]) == (0, 4, 0)
    for frame in frames:
        labels = partpose.label_frame(frame, zoo)
        truth = frame.parts()
        assert labels["parts"].shape == truth.shape and labels["instances"].dtype == np.uint16
        assert ((labels["parts"] > 0) == (labels["instances"] > 0)).all()
    with pytest.raises(ValueError, match="`shard`"):
        partpose.label_dataset(dataset, zoo, tmp_path / "other", shard="3/2")
    with pytest.raises(ValueError, match="`models`"):
        partpose.label_frame(frames[0], zoo, models="best")


def test_files_that_are_missing_or_wrong_are_named(tmp_path):
    for read in [partpose.ModelZoo.load, partpose.Dataset, partpose.read_image, partpose.Detector]:
        with pytest.raises(OSError, match="nowhere"):
            read(tmp_path / "nowhere")
    wrong = tmp_path / "a.safetensors"
    wrong.write_bytes(b"not a file of tensors")
    for read in [partpose.read_detections, partpose.Detector]:
        with pytest.raises(ValueError, match="safetensors"):
            read(wrong)
    with pytest.raises(ValueError, match="a.safetensors"):
        partpose.read_image(wrong)
    with pytest.raises(ValueError, match="not a data set"):
        partpose.Dataset(tmp_path)
    (tmp_path / "a.txt").write_text("Car 0 0\n")
    with pytest.raises(ValueError, match="line 1"):
        partpose.score_kitti(tmp_path, tmp_path)
    with pytest.raises(ValueError, match="P2"):
        partpose.Camera.from_kitti(tmp_path / "a.txt", (9, 9))


def test_scores_of_kitti_and_coco_have_their_shapes(tmp_path):
    line = "Car 0.00 0 1.60 300.00 170.00 420.00 260.00 1.60 1.65 3.62 -4.11 1.66 14.06 1.32"
    for name, text in [("labels", line), ("results", line + " 0.9")]:
        (tmp_path / name).mkdir()
        (tmp_path / name / "000000.txt").write_text(text + "\n")
    scores = partpose.score_kitti(tmp_path / "labels", tmp_path / "results")
    assert scores["car"]["3d"]["R11"]["easy"] == pytest.approx(100 / 11)
    assert scores["pedestrian"]["2d"]["R40"]["hard"] is None
    box = {"image_id": 1, "category_id": 3, "bbox": [10, 20, 30, 40]}
    labels = {
        "images": [{"id": 1, "width": 99, "height": 99, "file_name": "a.png"}],
        "categories": [{"id": 3, "name": "car"}],
        "annotations": [{**box, "id": 1, "area": 1200, "iscrowd": 0}],
    }
    (tmp_path / "labels.json").write_text(json.dumps(labels))
    (tmp_path / "results.json").write_text(json.dumps([{**box, "score": 0.9}]))
    figures = partpose.score_coco(tmp_path / "labels.json", tmp_path / "results.json")
    assert figures["AP"] == pytest.approx(1) and figures["AR_100"] == pytest.approx(1)
    with pytest.raises(ValueError, match="segmentation"):
        partpose.score_coco(tmp_path / "labels.json", tmp_path / "results.json", overlap="segm")


def test_the_version_is_that_of_the_workspace():
    assert f'version = "{partpose.__version__}"' in (ROOT / "Cargo.toml").read_text()
