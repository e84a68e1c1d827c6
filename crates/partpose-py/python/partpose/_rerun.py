"""Results for the viewer Rerun; needs its package, `pip install partpose[rerun]`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from partpose._partpose import PARTS, Camera, ModelZoo, NoPose, PoseEstimate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

COLORS = np.array([(0, 0, 0), *(tuple(color) for _, _, color in PARTS)], dtype=np.uint8)


def log_rerun(
    camera: Camera,
    poses: Sequence[PoseEstimate | NoPose],
    zoo: ModelZoo,
    image: ArrayLike | None = None,
    *,
    entity: str = "world",
    recording: Any = None,
) -> None:
    """Logs an image's camera, photograph, 2D boxes, 3D boxes and part-coloured models to Rerun.

    recording: a `rerun.RecordingStream`; Rerun's current one if None. Call `set_time` on it before, for sequences.
    """
    try:
        import rerun as rr
    except ImportError as error:
        raise ImportError("log_rerun needs the package rerun-sdk: pip install partpose[rerun]") from error

    def log(path: str, *parts: Any) -> None:
        rr.log(f"{entity}/{path}" if path else entity, *parts, recording=recording)

    (fx, fy), (cx, cy), (width, height) = camera.focal, camera.principal_point, camera.size
    # Rerun's pixels begin at their edge, ours are centred at integers.
    matrix = [[fx, 0, cx + 0.5], [0, fy, cy + 0.5], [0, 0, 1]]
    log("", rr.ViewCoordinates.RDF)
    log("camera", rr.Pinhole(image_from_camera=matrix, resolution=[width, height]))
    if image is not None:
        log("camera/image", rr.Image(np.asarray(image)).compress(jpeg_quality=90))
    posed = [pose for pose in poses if isinstance(pose, PoseEstimate)]
    log(
        "camera/image/boxes",
        rr.Boxes2D(
            array=np.array([pose.bounds for pose in poses]).reshape(-1, 4) + 0.5,
            array_format=rr.Box2DFormat.XYXY,
            labels=[f"{pose.score:.2f}" for pose in poses],
        ),
    )
    corners = np.array([pose.cuboid.corners() for pose in posed]).reshape(-1, 8, 3)
    turns = [rr.Quaternion(xyzw=quaternion(pose.rotation)) for pose in posed]
    log(
        "boxes",
        rr.Boxes3D(
            centers=corners.mean(axis=1),
            sizes=[pose.extent for pose in posed],
            quaternions=turns,
            labels=[f"{pose.model}, {pose.translation[2]:.1f} m" for pose in posed],
        ),
    )
    # What an earlier image showed and this one does not is taken away.
    log("models", rr.Clear(recursive=True))
    for index, pose in enumerate(posed):
        model = zoo[pose.model]
        scale = np.array(pose.extent) / np.array(model.extent)
        # A vertex has one colour, so each face gets vertices of its own.
        triangles = (model.vertices * scale)[model.faces].reshape(-1, 3)
        log(
            f"models/{index}",
            rr.Mesh3D(
                vertex_positions=triangles @ pose.rotation.T + pose.translation,
                triangle_indices=np.arange(len(triangles), dtype=np.uint32).reshape(-1, 3),
                vertex_colors=COLORS[model.parts].repeat(3, axis=0),
            ),
        )


def quaternion(rotation: np.ndarray[Any, np.dtype[np.float64]]) -> list[float]:
    """x, y, z, w of a rotation matrix: the eigenvector of Bar-Itzhack's symmetric matrix (JGCD 23(6), 2000)."""
    r = np.asarray(rotation)
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]],
            [0, r[1, 1] - r[0, 0] - r[2, 2], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]],
            [0, 0, r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
            [0, 0, 0, r[0, 0] + r[1, 1] + r[2, 2]],
        ]
    )
    _, vectors = np.linalg.eigh(k, UPLO="U")
    return [float(value) for value in vectors[:, 3]]
