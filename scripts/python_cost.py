"""What `fit` costs from Python over Rust, on the same detections, in the same calls; needs `pip install .`.

Rust's time is that of the fit alone, once the detections are its own types; Python's is the whole call with arrays in
and objects out. Detections: the labelled vehicles of a data set, with their part masks as probabilities.
"""

import argparse
import statistics
import time
from pathlib import Path

import numpy as np
import partpose

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--dataset", default=Path(__file__).parents[1] / "examples/world")
parser.add_argument("--stride", type=int, default=1)
parser.add_argument("--rounds", type=int, default=5)
parser.add_argument("--method", default="dense", choices=["dense", "epnp", "sqpnp"])
given = parser.parse_args()

estimator = partpose.PoseEstimator(method=given.method)
frames = []
for frame in partpose.Dataset(given.dataset).frames()[:: given.stride]:
    boxes = np.array([vehicle["bounds"] for vehicle in frame.vehicles if not vehicle["dont_care"]])
    parts = frame.parts()
    if len(boxes) and parts is not None:
        probabilities = partpose.probabilities_from_labels(parts, boxes)
        frames.append((frame.camera, boxes, np.ones(len(boxes)), probabilities))
rust, python = [], []
for _ in range(given.rounds):
    for frame in frames:
        start = time.perf_counter()
        _, seconds = estimator._fit_and_seconds(*frame)
        python.append(time.perf_counter() - start)
        rust.append(seconds)
ratios = [whole / fit for whole, fit in zip(python, rust)]
count = given.rounds * sum(len(boxes) for _, boxes, _, _ in frames)
print(f"{count} fits in {len(ratios)} calls, {given.method}:")
print(f"Rust {1000 * sum(rust) / count:.3f} ms, Python {1000 * sum(python) / count:.3f} ms a detection")
print(f"Python / Rust: {statistics.median(ratios):.4f} in the median call, {sum(python) / sum(rust):.4f} of all")
