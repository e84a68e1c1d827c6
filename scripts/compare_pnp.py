#!/usr/bin/env python3
"""Runs OpenCV's PnP solvers and ours on the same problem sets, cell by cell, in one run.

    cargo build --release
    python3 scripts/compare_pnp.py --problems DIR [--rounds 3] [--only TEXT] [--out FILE.md]

Needs numpy, safetensors and opencv-python-headless; poselib is used if it can be imported. In every round each cell is
first solved by `partpose evaluate pnp`, then by the others, on one thread, so that a busy machine slows all alike. A
round gives the median time of a call; the table shows the median over the rounds of each solver and of the ratios.

Times of Python packages include their binding. An estimate of it is measured (an OpenCV call of the same arguments that
does next to nothing) and printed; ratios are given as measured and with that estimate subtracted.
"""

import argparse
import importlib.util
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
from safetensors import safe_open

HAS_POSELIB = importlib.util.find_spec("poselib") is not None
PAIRS = [
    ("EPnP", "OpenCV EPNP"),
    ("EPnP + LM", "OpenCV EPNP + LM"),
    ("SQPnP", "OpenCV SQPNP"),
    ("SQPnP + LM", "OpenCV SQPNP + LM"),
    ("SQPnP + LM, two modes", "OpenCV SQPNP + LM"),
    ("P3P-RANSAC + LM", "PoseLib LO-RANSAC"),
]


def main():
    arguments = parse()
    cv2.setNumThreads(1)
    paths = sorted(p for p in Path(arguments.problems).glob("*.safetensors") if arguments.only in p.stem)
    if not paths:
        sys.exit(f"error: no problem set `*{arguments.only}*.safetensors` in `{arguments.problems}`")
    lines = [
        f"binding: about {binding_us():.1f} us of every OpenCV time is the call from Python",
        "",
        "| cell | ours | peer | failures % ours | peer | us ours | peer | ratio | ratio less binding |",
        "|---|---|---|--:|--:|--:|--:|--:|--:|",
    ]
    overhead = binding_us()
    for path in paths:
        rounds = [measure(path, arguments) for _ in range(arguments.rounds)]
        for ours, peer in PAIRS:
            if peer in rounds[0]:
                lines.append(row(path.stem, ours, peer, rounds, overhead))
        print("\n".join(lines[-len(PAIRS):]) if len(lines) > 4 + len(PAIRS) else "\n".join(lines), flush=True)
    if arguments.out:
        Path(arguments.out).write_text("\n".join(lines) + "\n")


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", required=True, help="folder of problem sets")
    parser.add_argument("--partpose", default="target/release/partpose", help="our program")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", default="", help="only cells whose names contain this")
    parser.add_argument("--out", help="Markdown file to write the table to")
    return parser.parse_args()


def measure(path, arguments):
    """Failure share and median time by solver, ours and theirs, one after the other."""
    result = ours(path, arguments.partpose)
    result.update(theirs(path))
    return result


def ours(path, program):
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        (folder / path.name).symlink_to(path.resolve())
        command = [program, "evaluate", "pnp", "--problems", folder, "--out", folder / "out"]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
        cell = json.loads((folder / "out/metrics.json").read_text())["cells"][path.stem]
    return {name: (s["failure"], s["time_us_median"]) for name, s in cell["solvers"].items()}


def theirs(path):
    with safe_open(path, "numpy") as file:
        data = {key: file.get_tensor(key) for key in file.keys()}
        meta = file.metadata()
    camera = np.array([[float(meta["fx"]), 0, float(meta["cx"])], [0, float(meta["fy"]), float(meta["cy"])], [0, 0, 1]])
    points = data["points"].astype(np.float64)
    pixels = data["pixels"].astype(np.float64)
    sigma = float(meta["sigma_px"])
    solvers = {
        "OpenCV EPNP": lambda p, u: opencv(p, u, camera, cv2.SOLVEPNP_EPNP, False),
        "OpenCV EPNP + LM": lambda p, u: opencv(p, u, camera, cv2.SOLVEPNP_EPNP, True),
        "OpenCV SQPNP": lambda p, u: opencv(p, u, camera, cv2.SOLVEPNP_SQPNP, False),
        "OpenCV SQPNP + LM": lambda p, u: opencv(p, u, camera, cv2.SOLVEPNP_SQPNP, True),
    }
    if HAS_POSELIB:
        solvers["PoseLib LO-RANSAC"] = poselib_solver(meta, max(4.0, 4.0 * sigma))
    result = {}
    for name, solve in solvers.items():
        failures, times = 0, []
        for p, u, rotation, translation in zip(points, pixels, data["R"], data["t"]):
            start = time.perf_counter()
            pose = solve(p, u)
            times.append(time.perf_counter() - start)
            failures += failed(pose, rotation, translation)
        result[name] = (failures / len(points), 1e6 * statistics.median(times))
    return result


def opencv(points, pixels, camera, flag, refine):
    try:
        found, rotation, translation = cv2.solvePnP(points, pixels, camera, None, flags=flag)
        if found and refine:
            rotation, translation = cv2.solvePnPRefineLM(points, pixels, camera, None, rotation, translation)
    except cv2.error:
        return None
    return (rotation, translation) if found else None


def poselib_solver(meta, threshold):
    import poselib

    parameters = [float(meta[key]) for key in ("fx", "fy", "cx", "cy")]
    camera = {"model": "PINHOLE", "width": int(meta["width"]), "height": int(meta["height"]), "params": parameters}
    options = {"max_reproj_error": threshold, "min_iterations": 50, "seed": 0}

    def solve(points, pixels):
        pose, _ = poselib.estimate_absolute_pose(pixels, points, camera, options, {})
        return pose.R, pose.t

    return solve


def failed(pose, true_rotation, true_translation):
    if pose is None:
        return True
    rotation, translation = np.asarray(pose[0], float), np.asarray(pose[1], float).ravel()
    if rotation.size == 3:
        rotation = cv2.Rodrigues(rotation)[0]
    cosine = 0.5 * (np.trace(rotation.T @ true_rotation) - 1.0)
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    far = np.linalg.norm(translation - true_translation) > 0.2 * np.linalg.norm(true_translation)
    return bool(not np.isfinite(angle) or angle > 20.0 or far or translation[2] <= 0.0)


def binding_us():
    """Time of an OpenCV call with array arguments that projects a single point."""
    point, vector, camera = np.zeros((1, 3)), np.array([0.0, 0.0, 9.0]), np.eye(3)
    times = []
    for _ in range(2000):
        start = time.perf_counter()
        cv2.projectPoints(point, vector, vector, camera, None)
        times.append(time.perf_counter() - start)
    return 1e6 * statistics.median(times)


def row(cell, ours, peer, rounds, overhead):
    failure = [100.0 * rounds[0][name][0] for name in (ours, peer)]
    times = [statistics.median(r[name][1] for r in rounds) for name in (ours, peer)]
    ratio = statistics.median(r[ours][1] / r[peer][1] for r in rounds)
    less = statistics.median(r[ours][1] / max(r[peer][1] - overhead, 1e-3) for r in rounds)
    return (
        f"| {cell} | {ours} | {peer} | {failure[0]:.1f} | {failure[1]:.1f} "
        f"| {times[0]:.1f} | {times[1]:.1f} | {ratio:.2f} | {less:.2f} |"
    )


if __name__ == "__main__":
    main()
