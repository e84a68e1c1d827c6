"""Writes coco.json: random label and result sets with what pycocotools makes of them.

pip install pycocotools==2.0.11; python make_coco.py > coco.json
"""

import contextlib
import io
import json
import sys

import numpy as np
import pycocotools
from importlib.metadata import version
from pycocotools import mask as masks
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

SIZE = (140, 110)  # width, height


def blob(rng):
    """A random ellipse with a hole, as booleans."""
    w, h = SIZE
    y, x = np.mgrid[0:h, 0:w]
    a, b = rng.uniform(4, 60, 2)
    cx, cy = rng.uniform(0, w), rng.uniform(0, h)
    d = ((x - cx) / a) ** 2 + ((y - cy) / b) ** 2
    return (d < 1) & (d > rng.choice([0, 0, 0.2]))


def encoded(mask):
    rle = masks.encode(np.asfortranarray(mask.astype(np.uint8)))
    rle["counts"] = rle["counts"].decode()
    return rle


def lengths(mask):
    flat = mask.flatten(order="F").astype(int)
    edges = np.flatnonzero(np.diff(flat)) + 1
    runs = np.diff(np.concatenate([[0], edges, [flat.size]])).tolist()
    return {"size": [SIZE[1], SIZE[0]], "counts": ([0] if flat[0] else []) + runs}


def polygon(rng):
    n = int(rng.integers(3, 8))
    angles = np.sort(rng.uniform(0, 2 * np.pi, n))
    r = rng.uniform(5, 50, n)
    cx, cy = rng.uniform(0, SIZE[0]), rng.uniform(0, SIZE[1])
    points = np.stack([cx + r * np.cos(angles), cy + r * np.sin(angles)], 1)
    return [round(float(v), 2) for v in points.flatten()]


def case(seed, with_box):
    rng = np.random.default_rng(seed)
    labels = {"images": [], "categories": [{"id": 7, "name": "a"}, {"id": 2, "name": "b"}, {"id": 5, "name": "none"}], "annotations": []}
    results = []
    for image in rng.permutation(7):
        image = int(image) + 1
        labels["images"].append({"id": image, "width": SIZE[0], "height": SIZE[1]})
        if image == 3:
            continue  # nothing at all
        for _ in range(int(rng.integers(0, 5))):
            category = int(rng.choice([7, 2]))
            kind = rng.integers(3)
            crowd = int(kind == 0 and rng.random() < 0.5)
            if kind == 2:
                segmentation = [polygon(rng)]
                if rng.random() < 0.4:
                    segmentation.append(polygon(rng))
                rle = masks.merge(masks.frPyObjects(segmentation, SIZE[1], SIZE[0]))
                mask = masks.decode(rle).astype(bool)
            else:
                mask = blob(rng)
                segmentation = lengths(mask) if kind == 0 else encoded(mask)
            if not mask.any():
                continue
            box = masks.toBbox(encoded(mask)).tolist()
            labels["annotations"].append({"id": len(labels["annotations"]) + 1, "image_id": image, "category_id": category,
                "iscrowd": crowd, "area": int(mask.sum()), "bbox": box, "segmentation": segmentation})
            for _ in range(int(rng.integers(0, 4))):
                shift = rng.integers(-4, 5, 2)
                moved = np.roll(mask, shift, (0, 1))
                found = {"image_id": image, "category_id": category if rng.random() < 0.9 else 2,
                    "score": round(float(rng.random()), 1), "segmentation": encoded(moved)}
                if with_box:
                    noise = rng.normal(0, 1.5, 4)
                    found["bbox"] = [round(float(v), 2) for v in np.maximum(np.array(masks.toBbox(found["segmentation"])) + noise, 0)]
                results.append(found)
        for _ in range(int(rng.integers(0, 3))):
            mask = blob(rng)
            found = {"image_id": image, "category_id": int(rng.choice([7, 2, 5])), "score": round(float(rng.random()), 1), "segmentation": encoded(mask)}
            if with_box:
                found["bbox"] = masks.toBbox(found["segmentation"]).tolist()
            results.append(found)
    out = {"labels": labels, "results": results}
    with contextlib.redirect_stdout(io.StringIO()):
        for kind in ["bbox", "segm"]:
            truth = COCO()
            truth.dataset = json.loads(json.dumps(labels))
            truth.createIndex()
            found = truth.loadRes(json.loads(json.dumps(results)))
            scored = COCOeval(truth, found, kind)
            scored.evaluate()
            scored.accumulate()
            scored.summarize()
            out[kind] = [float(v) for v in scored.stats]
    return out


def main():
    rng = np.random.default_rng(3)
    shapes = []
    for i in range(12):
        parts = [polygon(rng) for _ in range(1 + i % 3)]
        rle = masks.merge(masks.frPyObjects(parts, SIZE[1], SIZE[0]))
        shapes.append({"polygons": parts, "counts": rle["counts"].decode(), "area": int(masks.area(rle)), "bbox": masks.toBbox(rle).tolist()})
    pairs = []
    for i in range(12):
        a, b = blob(rng), blob(rng)
        pairs.append({"a": encoded(a), "b": encoded(b), "lengths": lengths(a),
            "union": encoded(a | b)["counts"], "iou": [float(masks.iou([encoded(a)], [encoded(b)], [crowd])[0][0]) for crowd in [0, 1]]})
    origin = f"make_coco.py, pycocotools {version('pycocotools')}, numpy {np.__version__}"
    json.dump({"origin": origin, "size": SIZE, "polygons": shapes, "pairs": pairs,
        "sets": [case(seed, seed % 2 == 0) for seed in range(6)]}, sys.stdout, separators=(",", ":"))
    print()


main()
