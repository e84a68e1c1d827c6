"""From other people's detectors to 6DoF poses: a Mask R-CNN of torchvision, a segmentation of Ultralytics.

Run it after `pip install .`, as a script or cell by cell: `python examples/python/lift_detectors.py`. Both detectors are
supposed to be trained on part labels, as `partpose label` and `partpose synth` write them (COCO): 29 classes of parts
and one of whole vehicles. Neither library is needed here: two rendered vehicles, cut into instances, stand in for a
detector that makes no mistakes, in the form in which each library gives its output. Tensors on the CPU will do as well.
"""

# %% What is known: the camera, and the models.
import types

import numpy as np
import partpose

CAMERA = partpose.Camera(focal=(725, 725), principal_point=(620.5, 187), size=(1242, 375))
ESTIMATOR = partpose.PoseEstimator()
VEHICLE = 30


# %% torchvision: `output = model([image])[0]`, classes 1 to 29 parts, 30 vehicles.
def lift_torchvision(output):
    vehicle = output["labels"] == VEHICLE
    part = ~vehicle
    labels = partpose.labels_from_instances(output["masks"][part], output["labels"][part], output["scores"][part])
    boxes, scores = output["boxes"][vehicle], output["scores"][vehicle]
    probabilities = partpose.probabilities_from_labels(labels, boxes, pixel_origin="corner")
    return ESTIMATOR.fit(CAMERA, boxes, scores, probabilities, pixel_origin="corner")


# %% Ultralytics: `result = model(image, retina_masks=True)[0]`, classes from 0, so 0 to 28 parts, 29 vehicles.
# Without `retina_masks` the masks have the network's size and margins instead of the image's.
def lift_ultralytics(result):
    classes = np.asarray(result.boxes.cls).astype(int) + 1
    vehicle = classes == VEHICLE
    part = ~vehicle
    labels = partpose.labels_from_instances(result.masks.data[part], classes[part], result.boxes.conf[part])
    boxes, scores = result.boxes.xyxy[vehicle], result.boxes.conf[vehicle]
    probabilities = partpose.probabilities_from_labels(labels, boxes, pixel_origin="corner")
    return ESTIMATOR.fit(CAMERA, boxes, scores, probabilities, pixel_origin="corner")


# %% The stand-in: what a perfect detector would say of two rendered vehicles.
def instances():
    """Class, mask and box of every part and every vehicle; boxes count from the first pixel's edge."""
    zoo = ESTIMATOR.zoo
    vehicles = []
    for x, z, yaw, name in [(-2.5, 11.0, 0.4, "sedan"), (3.5, 14.0, 2.6, "suv-compact")]:
        c, s = np.cos(yaw), np.sin(yaw)
        rotation = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
        vehicles.append((name, partpose.Cuboid([x, 1.5, z], rotation, zoo[name].extent)))
    images = partpose.render_labels(CAMERA, zoo, vehicles)
    found = []
    for index in range(1, len(vehicles) + 1):
        mine = images["instances"] == index
        found.append((VEHICLE, mine))
        found += [(part, mine & (images["parts"] == part)) for part in np.unique(images["parts"][mine])]
    boxes = []
    for _, mask in found:
        rows, columns = np.nonzero(mask)
        boxes.append([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])
    classes = np.array([label for label, _ in found])
    return classes, np.stack([mask for _, mask in found]), np.array(boxes, dtype=np.float32)


def torchvision_output():
    classes, masks, boxes = instances()
    scores = np.full(len(classes), 0.9, dtype=np.float32)
    return {"boxes": boxes, "labels": classes, "scores": scores, "masks": masks[:, None].astype(np.float32)}


def ultralytics_result():
    classes, masks, boxes = instances()
    conf = np.full(len(classes), 0.9, dtype=np.float32)
    found = types.SimpleNamespace(xyxy=boxes, cls=(classes - 1).astype(np.float32), conf=conf)
    return types.SimpleNamespace(boxes=found, masks=types.SimpleNamespace(data=masks.astype(np.float32)))


# %% Both give the same poses.
if __name__ == "__main__":
    for pose in lift_torchvision(torchvision_output()):
        print("torchvision:", pose)
    for pose in lift_ultralytics(ultralytics_result()):
        print("ultralytics:", pose)
