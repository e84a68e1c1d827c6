from os import PathLike
from typing import Any, Literal, TypedDict, final, type_check_only

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import NotRequired

__all__ = [
    "__version__",
    "PARTS",
    "ModelZoo",
    "VehicleModel",
    "Camera",
    "Cuboid",
    "Dataset",
    "Frame",
    "Detector",
    "PoseEstimator",
    "PoseEstimate",
    "NoPose",
    "probabilities_from_labels",
    "read_detections",
    "read_image",
    "label_dataset",
    "label_frame",
    "write_results",
    "render_labels",
    "pose_deviation",
    "score_coco",
    "score_kitti",
    "_panic_for_tests",
]

__version__: str
PARTS: list[tuple[int, str, tuple[int, int, int]]]
"""Id, name and colour of the 29 parts."""

@type_check_only
class LabelImages(TypedDict):
    parts: NDArray[np.uint8]
    instances: NDArray[np.uint16]

@type_check_only
class RenderedImages(LabelImages):
    depths: NDArray[np.float32]

@type_check_only
class Detections(TypedDict):
    """The arguments of `PoseEstimator.fit`."""

    boxes: NDArray[np.float64]
    scores: NDArray[np.float64]
    part_probabilities: NDArray[np.float32]
    extents: NotRequired[NDArray[np.float64]]

@type_check_only
class DetectionFile(Detections):
    images: list[str]
    image: NDArray[np.int64]

@type_check_only
class VehicleLabel(TypedDict):
    track: int | None
    category: str
    model: str | None
    dont_care: bool
    bounds: tuple[float, float, float, float]
    cuboid: Cuboid

@final
class Camera:
    """A pinhole camera without distortion; numbers in pixels."""

    def __new__(cls, focal: tuple[float, float], principal_point: tuple[float, float], size: tuple[int, int]) -> Camera: ...
    @staticmethod
    def from_field_of_view(size: tuple[int, int], degrees: float) -> Camera:
        """A guess: the angle that the longer side sees, the principal point in the middle."""
    @staticmethod
    def from_kitti(path: str | PathLike[str], size: tuple[int, int]) -> Camera:
        """The left colour camera of a KITTI calibration, for images of a size."""
    @property
    def focal(self) -> tuple[float, float]: ...
    @property
    def principal_point(self) -> tuple[float, float]: ...
    @property
    def size(self) -> tuple[int, int]:
        """Width, height."""
    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """[N, 3] points in the camera frame to [N, 2] pixels; NaN behind the camera."""
    def __getnewargs__(self) -> tuple[tuple[float, float], tuple[float, float], tuple[int, int]]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

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
    def extent(self) -> tuple[float, float, float]: ...
    def corners(self) -> NDArray[np.float64]:
        """[8, 3]; bit 0 of the index is right, bit 1 is top, bit 2 is front."""
    def project(self, camera: Camera) -> list[float] | None:
        """x_min, y_min, x_max, y_max around its picture, beyond the image's borders too; None behind the camera."""
    def iou(self, other: Cuboid) -> float:
        """Intersection over union of the two volumes, exact."""
    def __getnewargs__(self) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[float, float, float]]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

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
    def extent(self) -> tuple[float, float, float]:
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
class Detector:
    """The multi-class Mask R-CNN: images to vehicles with their parts. Thread-safe; an image uses all cores."""

    def __new__(cls, weights: str | PathLike[str] | None = None) -> Detector:
        """`weights`: a file of `partpose train`; those that come with the package if None."""
    @property
    def kernel(self) -> int:
        """Cells a side of the part probabilities."""
    def detect(self, image: ArrayLike, *, min_score: float = 0.5) -> Detections:
        """The vehicles in [H, W, 3] bytes of red, green, blue, best first, as the arguments of `PoseEstimator.fit`."""

@final
class PoseEstimate:
    """The pose of one detection."""

    @property
    def model(self) -> str: ...
    @property
    def category(self) -> str: ...
    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """The detection's box, pixel centres at integers."""
    @property
    def score(self) -> float:
        """The detection's."""
    @property
    def translation(self) -> NDArray[np.float64]:
        """[3], bottom-face centre in the camera frame."""
    @property
    def rotation(self) -> NDArray[np.float64]:
        """[3, 3], takes the vehicle frame to the camera's."""
    @property
    def extent(self) -> tuple[float, float, float]:
        """Width, height, length."""
    @property
    def cuboid(self) -> Cuboid: ...
    @property
    def reasons(self) -> list[str]:
        """What limits what may be made of it; empty for a good pose of known size."""
    @property
    def reprojection_rmse(self) -> float | None:
        """Pixels; None with the dense fit."""
    @property
    def confidence(self) -> float | None:
        """0 to 1; of the dense fit only."""
    @property
    def model_probabilities(self) -> dict[str, float] | None:
        """Of each model of the zoo; of the dense fit only."""
    @property
    def covariance(self) -> NDArray[np.float64] | None:
        """[6, 6] of a rotation vector in camera axes and of the centre's place; of the dense fit only."""

@final
class NoPose:
    """Why a detection has no pose; false as a truth value."""

    @property
    def bounds(self) -> tuple[float, float, float, float]: ...
    @property
    def score(self) -> float: ...
    @property
    def reason(self) -> str: ...
    def __bool__(self) -> bool: ...

@final
class PoseEstimator:
    """Fits the models of a zoo to detections. Thread-safe; making one computes tables, so make it once."""

    def __new__(
        cls,
        zoo: ModelZoo | None = None,
        method: Literal["dense", "epnp", "sqpnp", "ransac"] = "dense",
        options: dict[str, Any] | None = None,
    ) -> PoseEstimator:
        """`zoo`: the embedded one if None. `options` are those of `settings.pose` in the results of `partpose fit`."""
    @property
    def zoo(self) -> ModelZoo: ...
    def fit(
        self,
        camera: Camera,
        boxes: ArrayLike,
        scores: ArrayLike,
        part_probabilities: ArrayLike,
        extents: ArrayLike | Literal["free"] | None = None,
        image: ArrayLike | None = None,
        *,
        pixel_origin: Literal["center", "corner"] = "center",
        alone: bool = False,
        ground: bool = False,
        camera_height: float | None = None,
        gravity: ArrayLike | None = None,
    ) -> list[PoseEstimate | NoPose]:
        """A pose, or the reason for none, of each of N detections, as `partpose fit` finds it.

        boxes [N, 4]: x_min, y_min, x_max, y_max. scores [N]. part_probabilities [N, 30, m, m]: background first, rows
        top to bottom, summing to 1 over the channels. extents: width, height, length, [3] for all or [N, 3]; None
        keeps the models' sizes; "free" lets the mask stretch them. image [N]: a number for each image, where the
        detections are of several; images use all cores.

        Of one image, nearer vehicles tell farther ones what they hide, unless all are fitted `alone` (which uses all
        cores). `ground` estimates the road and puts the vehicles on it; `camera_height` is that above it in metres;
        `gravity` [3] points down in the camera frame.
        """
    def _fit_and_seconds(
        self, camera: Camera, boxes: ArrayLike, scores: ArrayLike, part_probabilities: ArrayLike
    ) -> tuple[list[PoseEstimate | NoPose], float]: ...

@final
class Frame:
    """One image of a data set with its camera and its labels."""

    @property
    def name(self) -> str:
        """World, variation and index."""
    @property
    def sequence(self) -> str: ...
    @property
    def index(self) -> int: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def image(self) -> str | None:
        """Path of the photograph, where there is one."""
    @property
    def vehicles(self) -> list[VehicleLabel]: ...
    def parts(self) -> NDArray[np.uint8] | None:
        """The part mask [H, W], where the data set has one."""

@final
class Dataset:
    """A folder in the layout of Virtual KITTI 1.3.1 or 2.0.3, or of KITTI object."""

    def __new__(cls, path: str | PathLike[str], *, camera: int = 0) -> Dataset: ...
    @property
    def path(self) -> str: ...
    @property
    def layout(self) -> str: ...
    @property
    def sequences(self) -> list[str]: ...
    def frames(self, sequences: list[str] | None = None) -> list[Frame]:
        """Those that could be read; `partpose dataset check` tells what is wrong with others."""

def read_image(path: str | PathLike[str]) -> NDArray[np.uint8]:
    """A PNG or JPEG file as [H, W, 3], turned as its camera says."""

def probabilities_from_labels(
    labels: ArrayLike, boxes: ArrayLike, size: int = 28, *, pixel_origin: Literal["center", "corner"] = "center"
) -> NDArray[np.float32]:
    """[N, 30, size, size] for boxes [N, 4] of a label image [H, W] with 0 for background, 1 to 29 for parts."""

def read_detections(path: str | PathLike[str]) -> DetectionFile:
    """A file of detections: `images`, their names, and the arguments of `PoseEstimator.fit`."""

def write_results(
    folder: str | PathLike[str], image: str, camera: Camera, poses: list[PoseEstimate | NoPose]
) -> None:
    """STEM.json and STEM.txt (KITTI's label text), which `partpose view`, `report`, `export` and `evaluate` read."""

def render_labels(camera: Camera, zoo: ModelZoo, vehicles: list[tuple[str, Cuboid]]) -> RenderedImages:
    """Images [H, W] of part ids, of vehicles (1 + index, 0 for none) and of depths in metres (infinite for none)."""

def label_frame(
    frame: Frame, zoo: ModelZoo, *, models: Literal["size", "name"] = "size", categories: list[str] | None = None
) -> LabelImages:
    """Images [H, W] of part ids and of vehicles (track + 1) from a frame's 3D boxes."""

def label_dataset(
    dataset: Dataset,
    zoo: ModelZoo,
    out: str | PathLike[str],
    *,
    sequences: list[str] | None = None,
    stride: int = 1,
    models: Literal["size", "name"] = "size",
    categories: list[str] | None = None,
    shard: str | None = None,
    resume: bool = False,
) -> dict[str, Any]:
    """The same as files, as `partpose label` writes them, on all cores.

    `shard`: "I/N" does a part; all parts write to one folder and keep what they find done. Returns how many frames were
    `written`, `kept` and `skipped` (with `reasons`), `vehicles`, and `missing_blocks` that other shards have still to do.
    """

def pose_deviation(predicted: Cuboid, truth: Cuboid) -> dict[str, Any]:
    """iou3d; translation and rotation by axis; distance in metres; angle in radians."""

def score_kitti(
    labels: str | PathLike[str], results: str | PathLike[str], *, subset: bool = False
) -> dict[str, dict[str, dict[str, dict[str, float | None]]]]:
    """KITTI's average precision in percent: class, metric (2d, aos, bev, 3d), R11 or R40, difficulty."""

def score_coco(
    labels: str | PathLike[str], results: str | PathLike[str], *, overlap: Literal["bbox", "segm"] = "bbox"
) -> dict[str, float | None]:
    """COCO's twelve figures, 0 to 1, of a file of annotations and one of results."""

def _panic_for_tests() -> None: ...
