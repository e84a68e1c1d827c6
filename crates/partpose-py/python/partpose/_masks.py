"""Label images from the instance masks of other people's detectors."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def labels_from_instances(
    masks: ArrayLike, parts: ArrayLike, scores: ArrayLike | None = None, threshold: float = 0.5
) -> NDArray[np.uint8]:
    """One label image from masks of parts, where each detection is a part.

    masks: [N, H, W], or [N, 1, H, W] as torchvision gives them; probabilities or booleans.
    parts: [N], ids of parts, 1 to 29. scores: [N], by which overlapping masks are weighed; 1 without them.
    A pixel gets the part whose mask times score is largest, if the mask is above the threshold there, else 0.
    """
    masks = np.asarray(masks, dtype=np.float32)
    parts = np.asarray(parts)
    if masks.ndim == 4 and masks.shape[1] == 1:
        masks = masks[:, 0]
    if masks.ndim != 3 or parts.shape != masks.shape[:1]:
        raise ValueError(f"masks have the shape {masks.shape} and parts {parts.shape}, but [N, H, W] and [N] are needed")
    if len(parts) == 0:
        return np.zeros(masks.shape[1:], dtype=np.uint8)
    if parts.min() < 1 or parts.max() > 29:
        raise ValueError("parts are ids from 1 to 29")
    weights = np.ones(len(parts)) if scores is None else np.asarray(scores, dtype=np.float64)
    if weights.shape != parts.shape:
        raise ValueError(f"{len(parts)} masks, but scores of the shape {weights.shape}")
    best = np.where(masks > threshold, masks * weights[:, None, None], 0.0)
    return np.where(best.max(axis=0) > 0, parts[best.argmax(axis=0)], 0).astype(np.uint8)
