"""From an image to a recording for the viewer Rerun: photograph, boxes in 2D and 3D, part-coloured models.

    pip install ".[rerun]"
    python examples/python/rerun_scene.py --out scene.rrd [IMAGE ...]
    rerun scene.rrd

Without images, the four of examples/world are taken, whose camera is known.
"""

import argparse
import json
from pathlib import Path

import partpose
import rerun as rr
import rerun.blueprint as rrb

WORLD = Path(__file__).parents[1] / "world"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", nargs="*", type=Path)
    parser.add_argument("--out", type=Path, default=Path("scene.rrd"))
    parser.add_argument("--camera", type=Path, default=WORLD / "camera.json", help="focal, principal_point, size")
    given = parser.parse_args()
    camera = partpose.Camera(**json.loads(given.camera.read_text()))
    images = given.images or sorted(WORLD.glob("vkitti_1.3.1_rgb/*/*/*.png"))
    detector, estimator = partpose.Detector(), partpose.PoseEstimator()
    recording = rr.RecordingStream("partpose")
    recording.save(str(given.out))
    views = [rrb.Spatial2DView(origin="world/camera/image"), rrb.Spatial3DView(origin="world")]
    recording.send_blueprint(rrb.Blueprint(rrb.Vertical(*views)))
    for number, path in enumerate(images):
        image = partpose.read_image(path)
        poses = estimator.fit(camera, **detector.detect(image))
        recording.set_time("image", sequence=number)
        partpose.log_rerun(camera, poses, estimator.zoo, image, recording=recording)
        print(f"{path}: {sum(map(bool, poses))} poses of {len(poses)} vehicles")
    recording.flush()


if __name__ == "__main__":
    main()
