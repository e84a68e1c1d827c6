"""Writes bop.json: a random test set, estimates, and their recalls by the formulas of the BOP challenge.

The bop_toolkit is on no package index. Its definitions (pose_error.py, pose_matching.py, score.py and
eval_calc_scores.py of 2024: k most visible truths, matching by score, errors below the threshold) are written out
here in numpy and scipy, independently of the Rust code.

pip install numpy scipy; python make_bop.py > bop.json
"""

import json
import sys

import numpy as np
import scipy
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

K = np.array([[900.0, 0, 500], [0, 905, 380], [0, 0, 1]])
WIDTH = 1024


def symmetries(info):
    fixed = [(np.eye(3), np.zeros(3))]
    for s in info.get("symmetries_discrete", []):
        m = np.reshape(s, (4, 4))
        fixed.append((m[:3, :3], m[:3, 3]))
    turns = []
    for s in info.get("symmetries_continuous", []):
        axis, offset = np.array(s["axis"], float), np.array(s["offset"], float)
        n = int(np.ceil(np.pi / 0.01))
        for i in range(n):
            R = Rotation.from_rotvec(axis / np.linalg.norm(axis) * 2 * np.pi * i / n).as_matrix()
            turns.append((R, offset - R @ offset))
    if not turns:
        return fixed
    return [(Rc @ Rd, Rc @ td + tc) for Rd, td in fixed for Rc, tc in turns]


def errors(est, gt, points, syms, diameter):
    (Re, te), (Rg, tg) = est, gt
    pe = points @ Re.T + te
    pg = points @ Rg.T + tg
    project = lambda p: (p @ K.T)[:, :2] / p[:, 2:]
    alike = [points @ (Rg @ R).T + Rg @ t + tg for R, t in syms]
    mssd = min(np.linalg.norm(pe - p, axis=1).max() for p in alike)
    mspd = min(np.linalg.norm(project(pe) - project(p), axis=1).max() for p in alike)
    if len(syms) > 1:
        add = cKDTree(pe).query(pg, k=1)[0].mean()
    else:
        add = np.linalg.norm(pe - pg, axis=1).mean()
    return [mssd / diameter, mspd * 640 / WIDTH, add / diameter]


def main():
    rng = np.random.default_rng(11)
    half = np.diag([-1.0, -1, 1, 1]).flatten().tolist()
    infos = {1: {}, 2: {"symmetries_discrete": [half]}, 5: {"symmetries_continuous": [{"axis": [0, 0, 1], "offset": [3, -2, 0]}]}}
    models = {}
    for i, info in infos.items():
        points = np.round(rng.uniform(-60, 60, (14, 3)), 2)
        if i == 2:
            points = np.concatenate([points, points * [-1, -1, 1]])
        models[i] = points
        info["diameter"] = float(np.linalg.norm(points[:, None] - points[None], axis=2).max())
    pose = lambda: (Rotation.random(random_state=rng).as_matrix(), np.array([*rng.uniform(-150, 150, 2), rng.uniform(600, 1400)]))
    images, estimates = [], []
    for image in range(12):
        truths = []
        for _ in range(int(rng.integers(0, 5))):
            R, t = pose()
            truths.append({"obj_id": int(rng.choice([1, 2, 5])), "R": R, "t": t, "visib_fract": round(float(rng.choice([0.05, 0.3, 0.6, 0.9])), 2)})
        images.append(truths)
        for truth in truths:
            for _ in range(int(rng.integers(0, 3))):
                R = truth["R"] @ Rotation.from_rotvec(rng.normal(0, 0.15, 3)).as_matrix()
                if truth["obj_id"] == 5 and rng.random() < 0.5:
                    R = R @ Rotation.from_rotvec([0, 0, rng.uniform(0, 6)]).as_matrix()
                if truth["obj_id"] == 2 and rng.random() < 0.5:
                    R = R @ np.diag([-1, -1, 1])
                estimates.append({"im_id": image, "obj_id": truth["obj_id"], "score": round(float(rng.random()), 1), "R": R, "t": truth["t"] + rng.normal(0, 1, 3) * [4, 4, 12]})
        R, t = pose()
        estimates.append({"im_id": image, "obj_id": int(rng.choice([1, 2, 5])), "score": 0.5, "R": R, "t": t})
    thresholds = [np.arange(0.05, 0.51, 0.05), np.arange(5, 51, 5), np.array([0.1])]
    valid, work = {}, []
    for image, truths in enumerate(images):
        for obj in infos:
            mine = [i for i, t in enumerate(truths) if t["obj_id"] == obj]
            count = sum(truths[i]["visib_fract"] >= 0.1 for i in mine)
            kept = sorted(mine, key=lambda i: truths[i]["visib_fract"], reverse=True)[:count]
            valid.update({(image, i): obj for i in kept})
            if count == 0:
                continue
            ests = [e for e in estimates if e["im_id"] == image and e["obj_id"] == obj]
            for e in sorted(ests, key=lambda e: e["score"], reverse=True)[:count]:
                errs = {i: errors((e["R"], e["t"]), (truths[i]["R"], truths[i]["t"]), models[obj], symmetries(infos[obj]), infos[obj]["diameter"]) for i in mine}
                work.append((image, errs))
    recalls = []
    for kind, ths in enumerate(thresholds):
        row = []
        for th in ths:
            taken = set()
            for image, errs in work:
                best, best_error = None, th
                for i, e in errs.items():
                    if (image, i) in valid and (image, i) not in taken and e[kind] < best_error:
                        best, best_error = i, e[kind]
                if best is not None:
                    taken.add((image, best))
            row.append(len(taken) / len(valid))
        recalls.append(row)
    flat = lambda a: [float(v) for v in np.array(a).flatten()]
    out = {
        "origin": f"make_bop.py, numpy {np.__version__}, scipy {scipy.__version__}", "width": WIDTH,
        "models_info": {str(i): info for i, info in infos.items()}, "models": {str(i): p.tolist() for i, p in models.items()},
        "scene_camera": {str(i): {"cam_K": flat(K), "depth_scale": 1.0} for i in range(len(images))},
        "scene_gt": {str(i): [{"obj_id": t["obj_id"], "cam_R_m2c": flat(t["R"]), "cam_t_m2c": flat(t["t"])} for t in ts] for i, ts in enumerate(images)},
        "scene_gt_info": {str(i): [{"visib_fract": t["visib_fract"]} for t in ts] for i, ts in enumerate(images)},
        "estimates": "scene_id,im_id,obj_id,score,R,t,time\n" + "\n".join(",".join(["4", str(e["im_id"]), str(e["obj_id"]), str(e["score"]), " ".join(map(repr, flat(e["R"]))), " ".join(map(repr, flat(e["t"]))), "-1"]) for e in estimates),
        "targets": len(valid), "mssd": recalls[0], "mspd": recalls[1], "add": recalls[2],
    }
    json.dump(out, sys.stdout, separators=(",", ":"))
    print()


main()
