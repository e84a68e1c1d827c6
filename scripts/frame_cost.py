"""CPU seconds that a frame takes, job by job, in one thread; needs `pip install .`. Rates for scripts/scale_cost.py.

CPU time, so that other programs on the machine do not count.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

os.environ["RAYON_NUM_THREADS"] = "1"
import partpose  # It reads the variable at its first use.

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--dataset", default=Path(__file__).parents[1] / "examples/world")
parser.add_argument("--stride", type=int, default=1)
given = parser.parse_args()

dataset = partpose.Dataset(given.dataset)
frames = [frame for frame in dataset.frames() if frame.image][:: given.stride]
detector, estimator, zoo = partpose.Detector(), partpose.PoseEstimator(), partpose.ModelZoo.embedded()
seconds = dict.fromkeys(["read", "detect", "fit", "label"], 0.0)
vehicles = 0


def timed(job, function, *arguments, **named):
    start = time.process_time()
    done = function(*arguments, **named)
    seconds[job] += time.process_time() - start
    return done


# The first call of each makes buffers that later ones keep.
estimator.fit(frames[0].camera, **detector.detect(partpose.read_image(frames[0].image)))
for frame in frames:
    image = timed("read", partpose.read_image, frame.image)
    found = timed("detect", detector.detect, image)
    vehicles += len(timed("fit", estimator.fit, frame.camera, **found))
with tempfile.TemporaryDirectory() as folder:
    done = timed("label", partpose.label_dataset, dataset, zoo, folder, stride=given.stride)
labelled = done["written"]

width, height = frames[0].camera.size
print(f"{len(frames)} frames of {width} x {height}, {vehicles / len(frames):.1f} vehicles found in each; CPU s a frame:")
estimate = sum(seconds[job] for job in ("read", "detect", "fit")) / len(frames)
for job in ("read", "detect", "fit"):
    print(f"  {job} {seconds[job] / len(frames):.3f}")
print(f"  estimate (these three) {estimate:.3f}")
print(f"  label {seconds['label'] / labelled:.3f} ({labelled} frames)")
print(f"python3 scripts/scale_cost.py --rate estimate={1 / estimate:.2f} --rate label={labelled / seconds['label']:.1f}")
