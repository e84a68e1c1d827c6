"""Six-degree-of-freedom vehicle poses, from images or from anyone's part masks.

Metres, radians, pixels. Camera frame: x right, y down, z forward. Vehicle frame: x to the vehicle's right, y down,
z forward, origin at the centre of the bottom face of its cuboid. Pixel centres lie at integers; boxes of torchvision
and Ultralytics begin at the pixel's edge: say so with ``pixel_origin="corner"``.

    image = partpose.read_image("photo.jpg")
    camera = partpose.Camera(focal=(725, 725), principal_point=(620.5, 187), size=(1242, 375))
    found = partpose.Detector().detect(image)
    for pose in partpose.PoseEstimator().fit(camera, **found):
        print(pose)
"""

from partpose._masks import labels_from_instances
from partpose._partpose import (
    PARTS,
    Camera,
    Cuboid,
    Dataset,
    Detector,
    Frame,
    ModelZoo,
    NoPose,
    PoseEstimate,
    PoseEstimator,
    VehicleModel,
    __version__,
    label_dataset,
    label_frame,
    pose_deviation,
    probabilities_from_labels,
    read_detections,
    read_image,
    render_labels,
    score_coco,
    score_kitti,
    write_results,
)
from partpose._rerun import log_rerun

__all__ = [
    "PARTS",
    "Camera",
    "Cuboid",
    "Dataset",
    "Detector",
    "Frame",
    "ModelZoo",
    "NoPose",
    "PoseEstimate",
    "PoseEstimator",
    "VehicleModel",
    "__version__",
    "label_dataset",
    "label_frame",
    "labels_from_instances",
    "log_rerun",
    "pose_deviation",
    "probabilities_from_labels",
    "read_detections",
    "read_image",
    "render_labels",
    "score_coco",
    "score_kitti",
    "write_results",
]
