from os import PathLike
from typing import Any, Literal, TypedDict, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str
PARTS: list[tuple[int, str, list[int]]]
"""Id, name and colour of the 29 parts."""

class LabelImages(TypedDict):
    parts: NDArray[np.uint8]
    instances: NDArray[np.uint16]
    depths: NDArray[np.float32]

@final
class Camera:
    """A pinhole camera without distortion; numbers in pixels."""

    def __new__(cls, focal: tuple[float, float], principal_point: tuple[float, float], size: tuple[int, int]) -> Camera: ...
    @property
    def focal(self) -> list[float]: ...
    @property
    def principal_point(self) -> list[float]: ...
    @property
    def size(self) -> list[int]:
        """Width, height."""
    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """[N, 3] points in the camera frame to [N, 2] pixels; NaN behind the camera."""

@final
class Cuboid:
    """A vehicle's place, turn and size in the camera frame."""

    def __new__(cls, translation: ArrayLike, rotation: ArrayLike, extent: ArrayLike) -> Cuboid:
        """Bottom-face centre; matrix [3, 3] that takes the vehicle frame to the camera's; width, height, length."""
    @property
    def translation(self) -> NDArray[np.float64]: ...
    @property
    def rotation(self) -> NDArray[np.float64]: ...
    @property
    def extent(self) -> list[float]: ...
    def corners(self) -> NDArray[np.float64]:
        """[8, 3]; bit 0 of the index is right, bit 1 is top, bit 2 is front."""
    def iou(self, other: Cuboid) -> float:
        """Intersection over union of the two volumes, exact."""

@final
class VehicleModel:
    """An annotated model; lengths in metres, in the vehicle frame."""

    @property
    def name(self) -> str: ...
    @property
    def category(self) -> str: ...
    @property
    def body_style(self) -> str: ...
    @property
    def extent(self) -> list[float]:
        """Width, height, length of the cuboid."""
    @property
    def vertices(self) -> NDArray[np.float64]:
        """[V, 3]."""
    @property
    def faces(self) -> NDArray[np.uint32]:
        """[F, 3] indices of vertices, counter-clockwise from outside."""
    @property
    def parts(self) -> NDArray[np.uint8]:
        """[F] ids of parts."""

@final
class ModelZoo:
    """Models to choose from."""

    @staticmethod
    def embedded() -> ModelZoo:
        """The seventeen procedural models."""
    @staticmethod
    def load(path: str | PathLike[str]) -> ModelZoo:
        """A folder of GLB files, or one such file. ValueError for what is no zoo, OSError for what cannot be read."""
    def save(self, path: str | PathLike[str]) -> None: ...
    @property
    def names(self) -> list[str]: ...
    def __len__(self) -> int: ...
    def __getitem__(self, name: str, /) -> VehicleModel: ...

@final
class PoseEstimate:
    """The pose of one detection."""

    @property
    def model(self) -> str: ...
    @property
    def translation(self) -> NDArray[np.float64]:
        """[3], bottom-face centre in the camera frame."""
    @property
    def rotation(self) -> NDArray[np.float64]:
        """[3, 3], takes the vehicle frame to the camera's."""
    @property
    def extent(self) -> list[float]:
        """Width, height, length."""
    @property
    def cuboid(self) -> Cuboid: ...
    @property
    def reprojection_rmse(self) -> float | None:
        """Pixels; None with the dense fit."""
    @property
    def confidence(self) -> float | None:
        """0 to 1; of the dense fit only."""
    @property
    def covariance(self) -> NDArray[np.float64] | None:
        """[6, 6] of a rotation vector in camera axes and of the centre's place; of the dense fit only."""

@final
class NoPose:
    """Why a detection has no pose; false as a truth value."""

    @property
    def reason(self) -> str: ...
    def __bool__(self) -> bool: ...

@final
class PoseEstimator:
    """Fits the models of a zoo to detections; making one computes tables, fitting many uses all cores."""

    def __new__(
        cls,
        zoo: ModelZoo,
        method: Literal["dense", "epnp", "sqpnp", "ransac"] = "dense",
        options: dict[str, Any] | None = None,
    ) -> PoseEstimator:
        """`options` are those of `settings.pose` in the results of `partpose fit`."""
    def fit(
        self,
        camera: Camera,
        boxes: ArrayLike,
        scores: ArrayLike,
        part_probabilities: ArrayLike,
        extents: ArrayLike | Literal["free"] | None = None,
        pixel_origin: Literal["center", "corner"] = "center",
    ) -> list[PoseEstimate | NoPose]:
        """A pose, or the reason for none, of each of N detections.

        boxes [N, 4]: x_min, y_min, x_max, y_max. scores [N]. part_probabilities [N, 30, m, m]: background first, rows
        top to bottom, summing to 1 over the channels. extents: width, height, length, [3] for all or [N, 3]; None
        keeps the models' sizes; "free" lets the mask stretch them.
        """

def probabilities_from_labels(
    labels: ArrayLike, boxes: ArrayLike, size: int = 28, pixel_origin: Literal["center", "corner"] = "center"
) -> NDArray[np.float32]:
    """[N, 30, size, size] for boxes [N, 4] of a label image [H, W] with 0 for background, 1 to 29 for parts."""

def read_detections(path: str | PathLike[str]) -> dict[str, Any]:
    """A file of detections: images, image, boxes, scores, part_probabilities, and extents where it has them."""

def render_labels(camera: Camera, zoo: ModelZoo, vehicles: list[tuple[str, Cuboid]]) -> LabelImages:
    """Images [H, W] of part ids, of vehicles (1 + index, 0 for none) and of depths in metres (infinite for none)."""

def pose_deviation(predicted: Cuboid, truth: Cuboid) -> dict[str, Any]:
    """iou3d; translation and rotation by axis; distance in metres; angle in radians."""

def score_kitti(
    labels: str | PathLike[str], results: str | PathLike[str], subset: bool = False
) -> dict[str, dict[str, dict[str, dict[str, float | None]]]]:
    """KITTI's average precision in percent: class, metric (2d, aos, bev, 3d), R11 or R40, difficulty."""

def _panic_for_tests() -> None: ...
