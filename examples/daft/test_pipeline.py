"""The three jobs on both runners, with a worker that is killed in the middle."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("daft")
pytest.importorskip("PIL")
parquet = pytest.importorskip("pyarrow.parquet")

HERE = Path(__file__).parent
WORLD = HERE.parent / "world"

# Kills its process once; the file tells that it has.
MORTAL = """
import os, signal, sys
sys.path.insert(0, {here!r})
import daft, pipeline
from pathlib import Path

def once():
    try:
        os.close(os.open({mark!r}, os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return
    os.kill(os.getpid(), signal.SIGKILL)

class Mortal(pipeline.Estimator):
    @daft.method(return_dtype=daft.DataType.list(pipeline.VEHICLE))
    def estimate(self, picture, focal, center):
        once()
        return self.vehicles(picture, focal, center)

class MortalLabeller(pipeline.Labeller):
    @daft.method(return_dtype=pipeline.DONE)
    def label(self, shard):
        done = self.write(shard)
        once()
        return done

if {runner!r} == "ray":
    daft.set_runner_ray()
else:
    daft.set_runner_native()
{job}
"""


def python(arguments, timeout=900):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")])}
    environment |= {"DAFT_PROGRESS_BAR": "0", "RAY_raylet_start_wait_time_s": "300"}
    done = subprocess.run([sys.executable, *arguments], env=environment, capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def rows(folder):
    return [row for path in sorted(folder.glob("*.parquet")) for row in parquet.read_table(path).to_pylist()]


@pytest.fixture(params=["native", "ray"])
def runner(request):
    if request.param == "ray":
        pytest.importorskip("ray")
    return request.param


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """What the package finds without Daft."""
    import partpose

    estimator, detector = partpose.PoseEstimator(), partpose.Detector()
    found = {}
    for frame in partpose.Dataset(WORLD).frames():
        poses = estimator.fit(frame.camera, **detector.detect(partpose.read_image(frame.image)))
        found[frame.name] = [pose.translation.tolist() if pose else None for pose in poses]
    return found


def test_a_killed_worker_costs_no_frame(runner, expected, tmp_path):
    mark, out = tmp_path / "killed", tmp_path / "estimates"
    job = f"pipeline.estimate(pipeline.frames_of({str(WORLD)!r}), Path({str(out)!r}), workers=2, chunk=3, worker=Mortal)"
    python(["-c", MORTAL.format(here=str(HERE), mark=str(mark), runner=runner, job=job)])
    assert mark.exists()
    found = {row["name"]: [vehicle["translation"] for vehicle in row["vehicles"]] for row in rows(out)}
    assert found == expected
    assert sorted(path.name for path in out.iterdir()) == ["000000000.parquet", "000000003.parquet"]
    # A second run keeps what is there and does what is missing.
    times = {path: path.stat().st_mtime_ns for path in out.iterdir()}
    (out / "000000003.parquet").unlink()
    shared = [HERE / "pipeline.py", "--dataset", WORLD, "--runner", runner]
    python([shared[0], "estimate", *shared[1:], "--out", out, "--chunk", "3"])
    assert {row["name"] for row in rows(out)} == set(expected)
    assert (out / "000000000.parquet").stat().st_mtime_ns == times[out / "000000000.parquet"]
    said = python([shared[0], "evaluate", *shared[1:], "--estimates", out, "--out", tmp_path / "scores"])
    scores = [score for row in rows(tmp_path / "scores") for score in row["scores"]]
    assert f"'vehicles': {len(scores)}" in said and sum(score["found"] for score in scores) >= 0.8 * len(scores)


def test_a_killed_labeller_costs_no_label(runner, tmp_path):
    import partpose

    mark, out = tmp_path / "killed", tmp_path / "out"
    job = f"pipeline.label({str(WORLD)!r}, Path({str(out)!r}), shards=4, worker=MortalLabeller)"
    python(["-c", MORTAL.format(here=str(HERE), mark=str(mark), runner=runner, job=job)])
    assert mark.exists()
    alone = tmp_path / "alone"
    partpose.label_dataset(partpose.Dataset(WORLD), partpose.ModelZoo.embedded(), alone)
    written = {path.relative_to(alone): path.read_bytes() for path in alone.rglob("*.*") if path.is_file()}
    assert len(written) > 4
    assert {path.relative_to(out / "labels"): path.read_bytes() for path in (out / "labels").rglob("*.*")} == written


def test_an_image_that_cannot_be_read_costs_its_row(runner, tmp_path):
    (tmp_path / "bad.png").write_bytes(b"no picture")
    job = f"""
good = pipeline.frames_of({str(WORLD)!r})[0]
bad = [{{**good, "name": name, "path": {str(tmp_path)!r} + "/" + name}} for name in ("bad.png", "missing.png")]
pipeline.estimate([good, *bad], Path({str(tmp_path / "out")!r}))
"""
    python(["-c", MORTAL.format(here=str(HERE), mark=str(tmp_path / "no"), runner=runner, job=job)])
    found = {row["name"]: row["vehicles"] for row in rows(tmp_path / "out")}
    assert found.pop("bad.png") is None and found.pop("missing.png") is None
    assert len(found) == 1 and all(found.values())
