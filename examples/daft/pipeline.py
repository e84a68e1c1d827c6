"""Labelling, estimation and evaluation over folders of frames with Daft, on one machine or on a Ray cluster.

    python pipeline.py label    --dataset DIR --out DIR [--runner ray] [--workers N]
    python pipeline.py estimate --dataset DIR --out DIR ...
    python pipeline.py evaluate --dataset DIR --estimates DIR --out DIR ...

Needs `pip install .` in the clone and `pip install "daft[ray]"`. Frames go to the workers in chunks; each chunk's rows
become one parquet file, written whole or not at all. A chunk that a worker dies in is done again, up to three times
(Ray replaces the worker itself; Daft's native runner gives the query up, and the loop here starts it again). Run the
same command again after a crash of the whole: chunks that are there are kept. docs/scale.md has the measurements.
"""

import argparse
import functools
import io
import os
import time
from pathlib import Path

import daft
import numpy as np
import PIL.Image
import pyarrow.parquet
from daft import DataType, col

NUMBERS = DataType.list(DataType.float64())
VEHICLE = DataType.struct(
    {
        "model": DataType.string(),
        "category": DataType.string(),
        "score": DataType.float64(),
        "confidence": DataType.float64(),
        "bounds": NUMBERS,
        "translation": NUMBERS,
        "rotation": NUMBERS,
        "extent": NUMBERS,
        "no_pose": DataType.string(),
    }
)
DONE = DataType.struct({"written": DataType.int64(), "kept": DataType.int64()})
SCORE = DataType.struct(
    {
        "found": DataType.bool(),
        "posed": DataType.bool(),
        "iou3d": DataType.float64(),
        "distance": DataType.float64(),
        "angle": DataType.float64(),
    }
)


class Worker:
    """What a process holds: made once, used for many frames."""

    def __init__(self, threads: int):
        # One process a core, so that workers do not fight for cores; partpose reads this at its first use.
        os.environ["RAYON_NUM_THREADS"] = str(threads)


class Estimator(Worker):
    """The network and the fit."""

    def __init__(self, threads: int, zoo: str | None = None):
        super().__init__(threads)
        import partpose

        self.partpose = partpose
        self.detector = partpose.Detector()
        self.estimator = partpose.PoseEstimator(partpose.ModelZoo.load(zoo) if zoo else None)

    @daft.method(return_dtype=DataType.list(VEHICLE))
    def estimate(self, picture, focal, center):
        return self.vehicles(picture, focal, center)

    def vehicles(self, picture, focal, center):
        try:
            image = np.asarray(PIL.Image.open(io.BytesIO(picture or b"")).convert("RGB"))
        except OSError:
            return None
        height, width = image.shape[:2]
        camera = self.partpose.Camera(focal, center, (width, height))
        poses = self.estimator.fit(camera, **self.detector.detect(image))
        return [row(pose) for pose in poses]


def row(pose):
    if not pose:
        return {"score": pose.score, "bounds": list(pose.bounds), "no_pose": pose.reason}
    return {
        "model": pose.model,
        "category": pose.category,
        "score": pose.score,
        "confidence": pose.confidence,
        "bounds": list(pose.bounds),
        "translation": pose.translation.tolist(),
        "rotation": pose.rotation.ravel().tolist(),
        "extent": list(pose.extent),
    }


class Labeller(Worker):
    """Part labels of one share of a data set; all shares write to one folder and keep what they find done."""

    def __init__(self, threads: int, dataset: str, out: str, zoo: str | None = None):
        super().__init__(threads)
        import partpose

        self.partpose, self.out = partpose, out
        self.dataset = partpose.Dataset(dataset)
        self.zoo = partpose.ModelZoo.load(zoo) if zoo else partpose.ModelZoo.embedded()

    @daft.method(return_dtype=DONE)
    def label(self, shard):
        return self.write(shard)

    def write(self, shard):
        done = self.partpose.label_dataset(self.dataset, self.zoo, self.out, shard=shard)
        return {"written": done["written"], "kept": done["kept"]}


class Evaluator(Worker):
    """Estimates against the truth: one score for each labelled vehicle that is to be found."""

    def __init__(self, threads: int):
        super().__init__(threads)
        import partpose

        self.partpose = partpose

    @daft.method(return_dtype=DataType.list(SCORE))
    def score(self, vehicles, truths):
        free = sorted(vehicles or [], key=lambda vehicle: -vehicle["score"])
        scores = []
        for truth in truths:
            best = max(free, key=lambda vehicle: overlap(vehicle["bounds"], truth["bounds"]), default=None)
            if best is None or overlap(best["bounds"], truth["bounds"]) < 0.5:
                scores.append({"found": False, "posed": False})
                continue
            free.remove(best)
            if best["translation"] is None:
                scores.append({"found": True, "posed": False})
                continue
            deviation = self.partpose.pose_deviation(self.cuboid(best), self.cuboid(truth))
            said = {key: deviation[key] for key in ("iou3d", "distance", "angle")}
            scores.append({"found": True, "posed": True, **said})
        return scores

    def cuboid(self, vehicle):
        rows = [vehicle["rotation"][at : at + 3] for at in (0, 3, 6)]
        return self.partpose.Cuboid(vehicle["translation"], rows, vehicle["extent"])


def overlap(a, b):
    """Intersection over union of two boxes."""
    sides = [max(0.0, min(a[i + 2], b[i + 2]) - max(a[i], b[i])) for i in (0, 1)]
    area = [(box[2] - box[0]) * (box[3] - box[1]) for box in (a, b)]
    shared = sides[0] * sides[1]
    return shared / (area[0] + area[1] - shared)


def in_chunks(rows, query, out: Path, chunk: int, attempts: int = 3):
    """Sends rows through a query, chunk by chunk; a parquet file each."""
    out.mkdir(parents=True, exist_ok=True)
    for start in range(0, len(rows), chunk):
        path = out / f"{start:09d}.parquet"
        if path.exists():
            continue
        for attempt in range(1, attempts + 1):
            try:
                table = query(daft.from_pylist(rows[start : start + chunk])).to_arrow()
                break
            except Exception as error:  # What a dead worker raises differs between runners and versions.
                if attempt == attempts:
                    raise
                print(f"chunk {start}: {error}; attempt {attempt + 1} of {attempts}", flush=True)
        part = path.with_suffix(".part")
        pyarrow.parquet.write_table(table, part)
        os.replace(part, path)


def pool(worker, workers: int, **arguments):
    """So many processes of a worker's class."""
    return daft.cls(worker, max_concurrency=workers, use_process=True, max_retries=2)(**arguments)


def frames_of(dataset: str, stride: int = 1):
    """One row a frame: the photograph's path, the camera, what is labelled."""
    import partpose

    return [
        {
            "name": frame.name,
            "path": str(Path(frame.image).absolute()),
            "focal": list(frame.camera.focal),
            "center": list(frame.camera.principal_point),
            "truths": [
                {
                    "bounds": list(vehicle["bounds"]),
                    "translation": vehicle["cuboid"].translation.tolist(),
                    "rotation": vehicle["cuboid"].rotation.ravel().tolist(),
                    "extent": list(vehicle["cuboid"].extent),
                }
                for vehicle in frame.vehicles
                if not vehicle["dont_care"]
            ],
        }
        for frame in partpose.Dataset(dataset).frames()[::stride]
        if frame.image
    ]


def estimate(rows, out: Path, workers=2, threads=1, chunk=256, zoo=None, worker=Estimator):
    """Vehicles of every frame. `path` may be anything that Daft reads: a file, s3://, gs://, https://."""
    found = pool(worker, workers, threads=threads, zoo=zoo)
    rows = [{key: row[key] for key in ("name", "path", "focal", "center")} for row in rows]

    def query(frames):
        # An image that cannot be read costs its own row, never the chunk's. The workers decode: what is given images of
        # Daft's own type, its native runner keeps in the driver's process.
        frames = spread(frames, workers).with_column("picture", col("path").download(on_error="null"))
        frames = frames.with_column("vehicles", found.estimate(col("picture"), col("focal"), col("center")))
        return frames.exclude("picture")

    in_chunks(rows, query, out, chunk)


def label(dataset: str, out: Path, workers=2, threads=1, shards=None, zoo=None, worker=Labeller):
    """Part labels of a data set below `out`/labels; what each shard did in `out`/done."""
    count = shards or 4 * workers
    labels = pool(worker, workers, threads=threads, dataset=dataset, out=str(out / "labels"), zoo=zoo)
    rows = [{"shard": f"{index}/{count}"} for index in range(1, count + 1)]

    def query(shards):
        return spread(shards, workers).with_column("done", labels.label(col("shard")))

    in_chunks(rows, query, out / "done", count)


def evaluate(rows, estimates: Path, out: Path, workers=2, threads=1, chunk=4096, worker=Evaluator):
    """Scores of every labelled vehicle below `out`; returns their summary."""
    judge = pool(worker, workers, threads=threads)
    found = daft.read_parquet(f"{estimates}/*.parquet").select("name", "vehicles")
    truths = [{"name": row["name"], "truths": row["truths"]} for row in rows if row["truths"]]

    def query(frames):
        frames = frames.join(found, on="name", how="left").sort("name")
        return frames.select("name", judge.score(col("vehicles"), col("truths")).alias("scores"))

    in_chunks(truths, query, out, chunk)
    scores = daft.read_parquet(f"{out}/*.parquet").explode("scores")
    score = functools.partial(col("scores").get)
    table = scores.agg(
        score("found").count().alias("vehicles"),
        score("found").cast(DataType.int64()).sum().alias("found"),
        score("posed").cast(DataType.int64()).sum().alias("posed"),
        score("iou3d").mean().alias("iou3d"),
        score("distance").mean().alias("distance"),
        score("angle").mean().alias("angle"),
    )
    return table.to_pylist()[0]


def spread(frames, workers):
    """Enough pieces for all workers: Ray deals out partitions, the native runner batches."""
    if daft.get_or_create_runner().name == "ray":
        return frames.into_partitions(4 * workers)
    return frames.into_batches(1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("job", choices=["label", "estimate", "evaluate"])
    parser.add_argument("--dataset", required=True)
    parser.add_argument("--out", required=True, type=Path)
    parser.add_argument("--estimates", type=Path)
    parser.add_argument("--zoo")
    parser.add_argument("--stride", type=int, default=1)
    parser.add_argument("--runner", choices=["native", "ray"], default="native")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--threads", type=int, default=1, help="of each worker")
    parser.add_argument("--chunk", type=int, default=256, help="frames a file")
    given = parser.parse_args()
    if given.runner == "ray":
        # On a cluster: its address, from the variable RAY_ADDRESS.
        daft.set_runner_ray(os.environ.get("RAY_ADDRESS"))
    else:
        daft.set_runner_native()
    shared = {"workers": given.workers, "threads": given.threads}
    frames = frames_of(given.dataset, given.stride)
    start = time.perf_counter()
    if given.job == "label":
        label(given.dataset, given.out, zoo=given.zoo, **shared)
    elif given.job == "estimate":
        estimate(frames, given.out, chunk=given.chunk, zoo=given.zoo, **shared)
    else:
        if not given.estimates:
            parser.error("evaluate needs --estimates, the folder that estimate wrote")
        print(evaluate(frames, given.estimates, given.out, **shared))
    seconds = time.perf_counter() - start
    print(f"{given.job}: {len(frames)} frames in {seconds:.1f} s, {len(frames) / seconds:.2f} frames/s")


if __name__ == "__main__":
    main()
