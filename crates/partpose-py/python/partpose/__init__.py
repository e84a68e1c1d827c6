"""Six-degree-of-freedom vehicle poses from part masks.

Metres, radians, pixels. Camera frame: x right, y down, z forward. Vehicle frame: x to the vehicle's right, y down,
z forward, origin at the centre of the bottom face of its cuboid. Pixel centres lie at integers; boxes of torchvision
and Ultralytics begin at the pixel's edge: say so with ``pixel_origin="corner"``.
"""

from partpose._masks import labels_from_instances
from partpose._partpose import (
    PARTS,
    Camera,
    Cuboid,
    ModelZoo,
    NoPose,
    PoseEstimate,
    PoseEstimator,
    VehicleModel,
    __version__,
    pose_deviation,
    probabilities_from_labels,
    read_detections,
    render_labels,
    score_kitti,
)

__all__ = [
    "PARTS",
    "Camera",
    "Cuboid",
    "ModelZoo",
    "NoPose",
    "PoseEstimate",
    "PoseEstimator",
    "VehicleModel",
    "__version__",
    "labels_from_instances",
    "pose_deviation",
    "probabilities_from_labels",
    "read_detections",
    "render_labels",
    "score_kitti",
]
