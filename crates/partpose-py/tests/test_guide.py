"""The guide's blocks of Python, in order and as they stand; the examples."""

import re
import subprocess
import sys

import numpy as np
import pytest

from conftest import ROOT, script

PAGES = sorted((ROOT / "docs/guide").glob("*.md"))


def blocks(page):
    return re.findall(r"^```python\n(.*?)^```$", page.read_text(), flags=re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)], ids=lambda page: page.stem)
def test_every_block_of_python_runs(page, monkeypatch, tmp_path):
    # They are written for the repository's root and name what is there; what they write goes elsewhere.
    for name in ["examples", "docs", "weights"]:
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    lift = script(ROOT / "examples/python/lift_detectors.py")
    names = {"output": lift.torchvision_output()}
    for block in blocks(page):
        exec(compile(block, str(page), "exec"), names)
    assert names.get("poses") and all(names["poses"])


def test_an_image_becomes_poses_in_less_than_ten_lines():
    first = blocks(ROOT / "docs/guide/8-python.md")[0]
    assert "Detector" in first and "fit" in first
    assert len([line for line in first.splitlines() if line.strip()]) < 10


def test_outputs_of_both_libraries_are_lifted_alike():
    lift = script(ROOT / "examples/python/lift_detectors.py")
    ours = [lift.lift_torchvision(lift.torchvision_output()), lift.lift_ultralytics(lift.ultralytics_result())]
    assert [len(poses) for poses in ours] == [2, 2] and all(map(all, ours))
    for a, b in zip(*ours):
        assert np.array_equal(a.translation, b.translation)
    assert [pose.model for pose in ours[0]] == ["sedan", "suv-compact"]


def test_tensors_are_lifted_as_arrays_are():
    torch = pytest.importorskip("torch")
    lift = script(ROOT / "examples/python/lift_detectors.py")
    output = lift.torchvision_output()
    expected = lift.lift_torchvision(output)
    found = lift.lift_torchvision({name: torch.from_numpy(value) for name, value in output.items()})
    assert [p.translation.tolist() for p in found] == [p.translation.tolist() for p in expected]


def test_rerun_gets_image_boxes_and_models(tmp_path):
    pytest.importorskip("rerun")
    out = tmp_path / "scene.rrd"
    example = [sys.executable, ROOT / "examples/python/rerun_scene.py", "--out", out]
    said = subprocess.run(example, capture_output=True, text=True, check=True).stdout
    assert said.count("poses of") == 4
    # The models' meshes alone are larger than this.
    assert out.stat().st_size > 1_000_000 and out.read_bytes()[:3] == b"RRF"


def test_rerun_that_is_missing_is_named(monkeypatch):
    import partpose

    monkeypatch.setitem(sys.modules, "rerun", None)
    camera = partpose.Camera((9, 9), (1, 1), (3, 3))
    with pytest.raises(ImportError, match=r"partpose\[rerun\]"):
        partpose.log_rerun(camera, [], partpose.ModelZoo.embedded())


def test_quaternions_are_those_of_their_rotations():
    from partpose._rerun import quaternion

    for axis, angle in [((0, 1, 0), 0.7), ((1, 2, 3), 3.1), ((0, 0, 1), np.pi), ((1, 0, 0), 0)]:
        x, y, z = np.array(axis) / np.linalg.norm(axis)
        k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rotation = np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
        expected = [*(np.sin(angle / 2) * np.array([x, y, z])), np.cos(angle / 2)]
        assert abs(np.dot(quaternion(rotation), expected)) == pytest.approx(1)
