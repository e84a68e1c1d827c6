"""What `fit` costs from Python over Rust, on the same detections, turn by turn; needs `pip install .`.

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
rust, python, ratios = [], [], []
for _ in range(given.rounds):
    seconds = [0.0, 0.0]
    for frame in frames:
        seconds[0] += estimator._seconds_of_fit(*frame)
        start = time.perf_counter()
        estimator.fit(*frame)
        seconds[1] += time.perf_counter() - start
    rust.append(seconds[0])
    python.append(seconds[1])
    ratios.append(seconds[1] / seconds[0])
count = sum(len(boxes) for _, boxes, _, _ in frames)
print(f"{count} detections in {len(frames)} images, {given.method}, median of {given.rounds} rounds:")
print(f"Rust {1000 * statistics.median(rust) / count:.3f} ms, Python {1000 * statistics.median(python) / count:.3f} ms a detection")
print(f"Python / Rust: {statistics.median(ratios):.3f} (from {min(ratios):.3f} to {max(ratios):.3f})")
