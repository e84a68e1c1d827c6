"""A rendered scene that the tests share."""

import importlib.util
from pathlib import Path

import numpy as np
import partpose
import pytest

ROOT = Path(__file__).parents[3]
WORLD = ROOT / "examples/world"
CAMERA = partpose.Camera((725.0, 725.0), (620.5, 187.0), (1242, 375))


@pytest.fixture(scope="session")
def zoo():
    return partpose.ModelZoo.embedded()


@pytest.fixture(scope="session")
def estimator(zoo):
    return partpose.PoseEstimator(zoo)


@pytest.fixture(scope="session")
def detector():
    return partpose.Detector()


def turn(yaw):
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


@pytest.fixture(scope="session")
def scene(zoo):
    """Two vehicles that do not overlap: names, cuboids, label images, boxes."""
    names = ["sedan", "suv-compact"]
    places = [([-2.5, 1.5, 11.0], 0.4), ([3.5, 1.6, 14.0], 2.6)]
    cuboids = [partpose.Cuboid(place, turn(yaw), zoo[name].extent) for name, (place, yaw) in zip(names, places)]
    images = partpose.render_labels(CAMERA, zoo, list(zip(names, cuboids)))
    boxes = []
    for index in (1, 2):
        rows, columns = np.nonzero(images["instances"] == index)
        boxes.append([columns.min() - 0.5, rows.min() - 0.5, columns.max() + 0.5, rows.max() + 0.5])
    return names, cuboids, images, np.array(boxes)


@pytest.fixture(scope="session")
def probabilities(scene):
    _, _, images, boxes = scene
    return partpose.probabilities_from_labels(images["parts"], boxes)


def script(path):
    """A script of the repository as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
