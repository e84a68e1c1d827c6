"""Lifts the output of a Mask R-CNN, or of an Ultralytics segmentation, to 6DoF poses.

Run it after `pip install .`: `python examples/python/lift_mask_rcnn.py`. The detector knows 29 classes of parts, by
the ids of `partpose.PARTS`, and 30 for whole vehicles; its output has the form of torchvision's: `boxes` [N, 4],
`labels` [N], `scores` [N], `masks` [N, 1, H, W]. Of Ultralytics take `result.boxes.xyxy`, `result.boxes.cls`,
`result.boxes.conf` and `result.masks.data`.
"""

import numpy as np
import partpose

CAMERA = partpose.Camera((725.0, 725.0), (620.5, 187.0), (1242, 375))
ZOO = partpose.ModelZoo.embedded()
ESTIMATOR = partpose.PoseEstimator(ZOO)


def lift(output):
    """The poses of the vehicles in a detector's output."""
    vehicle = output["labels"] == 30
    part = ~vehicle
    labels = partpose.labels_from_instances(output["masks"][part], output["labels"][part], output["scores"][part])
    boxes, scores = output["boxes"][vehicle], output["scores"][vehicle]
    probabilities = partpose.probabilities_from_labels(labels, boxes, pixel_origin="corner")
    return ESTIMATOR.fit(CAMERA, boxes, scores, probabilities, pixel_origin="corner")


def detector_output():
    """Stands in for a network: what a perfect one would say of two rendered vehicles."""
    cuboids = []
    for x, z, yaw, name in [(-2.5, 11.0, 0.4, ZOO.names[3]), (3.5, 14.0, 2.6, ZOO.names[8])]:
        c, s = np.cos(yaw), np.sin(yaw)
        rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        cuboids.append((name, partpose.Cuboid([x, 1.5, z], rotation, ZOO[name].extent)))
    images = partpose.render_labels(CAMERA, ZOO, cuboids)
    found = []
    for index in range(1, len(cuboids) + 1):
        mine = images["instances"] == index
        found.append((30, mine))
        found += [(part, mine & (images["parts"] == part)) for part in np.unique(images["parts"][mine])]
    boxes = []
    for _, mask in found:
        rows, columns = np.nonzero(mask)
        boxes.append([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])
    return {
        "boxes": np.array(boxes, dtype=np.float32),
        "labels": np.array([label for label, _ in found]),
        "scores": np.full(len(found), 0.9, dtype=np.float32),
        "masks": np.stack([mask for _, mask in found])[:, None].astype(np.float32),
    }


if __name__ == "__main__":
    for pose in lift(detector_output()):
        print(pose)
