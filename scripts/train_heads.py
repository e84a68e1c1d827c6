#!/usr/bin/env python3
"""Trains heads anew on what a trained network sees, without a GPU; all else in the file of weights stays as it is.

The network looks at every frame once as it is and once varied (train_gpu.py's augmentation). Features of its own
detections, and of boxes around the true ones, are kept in a folder; the heads learn from these.

    python3 scripts/train_heads.py IN.safetensors OUT.safetensors --cache DIR --data DIR... [--held-out DIR...]
        the vehicle head: which zoo model it is, and its size. Files of frames held out say how sure it may be
    python3 scripts/train_heads.py IN.safetensors OUT.safetensors --cache DIR --data DIR... --kernel 42 [--dontcare]
        a part head of another kernel, from random weights, for a comparison of kernels

DIR: what `partpose synth --out DIR` wrote. One thread: about 0.6 s a frame for the features, minutes for a head.
"""
import argparse
import glob
import json
import math
import os
import struct
import time

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

import train_gpu as base

KERNELS = (14, 28, 42, 56)
CELLS = 14  # of a region's features
IGNORED, DONTCARE = 255, 254  # labels of cells: unknown, and a pixel of a vehicle that is not to be learnt from
TYPICAL, TYPICAL_DEVIATION = np.log([1.8, 1.5, 4.3]), 0.08  # as in vehicle_head.rs
MIN_HEIGHT, MIN_PIXELS = 25.0, 60  # of vehicles that are looked at


# ---------------------------------------------------------------- features

def read_weights(path):
    with open(path, "rb") as file:
        (length,) = struct.unpack("<Q", file.read(8))
        header = json.loads(file.read(length))
        data = file.read()
    config = json.loads(header.pop("__metadata__")["partpose.net"])
    state = {}
    for name, entry in header.items():
        begin, end = entry["data_offsets"]
        kind = {"F16": np.float16, "F32": np.float32}[entry["dtype"]]
        state[name] = torch.from_numpy(np.frombuffer(data[begin:end], kind).reshape(entry["shape"]).astype(np.float32))
    return state, config


def fused(net):
    """Normalisation made part of the convolutions before it, as in inference."""
    for module in list(net.modules()):
        children = dict(module.named_children())
        names = list(children)
        for a, b in zip(names, names[1:]):
            if isinstance(children[a], nn.Conv2d) and isinstance(children[b], nn.BatchNorm2d):
                setattr(module, a, fuse_conv_bn_eval(children[a], children[b]))
                setattr(module, b, nn.Identity())
    b = net.backbone
    for block in [m for layer in (b.layer1, b.layer2, b.layer3, b.layer4) for m in layer]:
        for i in (1, 2):
            if not isinstance(getattr(block, f"bn{i}"), nn.Identity):
                setattr(block, f"conv{i}", fuse_conv_bn_eval(getattr(block, f"conv{i}"), getattr(block, f"bn{i}")))
                setattr(block, f"bn{i}", nn.Identity())
    return net


def facts_of(root, models):
    """Model, log extents, distance, orig_label == Car by (file of labels, frame, track)."""
    found = {}
    for file in glob.glob(f"{root}/vkitti_1.3.1_motgt/*.txt"):
        world, variation = os.path.basename(file)[:-4].split("_", 1)
        lines = open(file).read().splitlines()
        column = {name: i for i, name in enumerate(lines[0].split())}
        for line in lines[1:]:
            c = line.split()
            name = c[column["model"]]
            model = models.index(name) if name in models else -1
            size = [math.log(float(c[column[k]])) for k in ("w3d", "h3d", "l3d")]
            found[world, variation, int(c[0]), int(c[1])] = (model, size, float(c[column["z3d"]]), float(c[column["occupr"]]))
    return found


def look(net, image, rows):
    """One view: `image` [3, h, w] normalised; `rows`: boxes [N, 4]. Feature maps and the best detection of each row."""
    _, h, w = image.shape
    base.HEIGHT, base.WIDTH = -(-h // 32) * 32, -(-w // 32) * 32
    x = F.pad(image, (0, base.WIDTH - w, 0, base.HEIGHT - h))[None].contiguous(memory_format=torch.channels_last)
    with torch.autocast("cpu", torch.bfloat16):
        maps = net.maps(x)
        logits, deltas = net.proposals_of(maps)
    maps = [m.float().contiguous() for m in maps[:3]]
    size = torch.tensor([[w, h]], dtype=torch.float32)
    rois = base.propose([l.float() for l in logits], torch.cat(deltas, 1).float(), base.anchors("cpu"),
                        torch.zeros(1, 0, 4), size, 300, 100)[0]
    scores, moves = net.boxes(net.read(maps, F.pad(rois, (1, 0)), 7))
    found = torch.minimum(base.decode(moves, rois).clamp(min=0), torch.cat([size, size], 1))
    iou, _ = base.overlap(found[None], rows[None])
    score = scores.softmax(1)[:, 1]
    fits = (iou[0] >= 0.5) & (score[:, None] > 0.3)
    value, at = torch.where(fits, score[:, None], -1.0).max(0)
    return maps, found[at], value > 0


def cell_labels(roi, own, labels, owners, learn, m):
    """[m, m] labels at the cells' centres, read where train_gpu.py reads them."""
    h, w = labels.shape
    at = (np.arange(m) + 0.5) / m
    x = (roi[0] + at * (roi[2] - roi[0])).astype(int).clip(0, w - 1)
    y = (roi[1] + at * (roi[3] - roi[1])).astype(int).clip(0, h - 1)
    label, owner = labels[y][:, x], owners[y][:, x]
    other = np.where((owner > 0) & ~learn[np.maximum(owner, 1) - 1], DONTCARE, 0)
    return np.where(owner == own + 1, label, other).astype(np.uint8)


def regions_of(net, item, facts, varied, rng, jitters):
    """Features and labels of the vehicles in one view of a frame."""
    rgb, maps, boxes, learn = item
    base.BATCH = 1
    if varied:
        base.WIDTH, base.HEIGHT = 1248, 384
        image, maps, seen, _, _ = base.view(item, rng)
        image = base.colors(image[None], torch.ones(1, 1, *image.shape[1:]), "cpu")[0]
    else:
        image, seen = (rgb.float() - base.MEAN_T[0]) / base.STD_T[0], boxes
        maps = maps.long()
    labels, owners = maps.numpy()
    enough = (seen[:, 3] - seen[:, 1] >= MIN_HEIGHT) & (seen[:, 2] - seen[:, 0] >= 8)
    enough &= np.bincount(owners.ravel(), minlength=len(seen) + 1)[1:len(seen) + 1] >= MIN_PIXELS
    feature_maps, refined, hit = look(net, image, torch.from_numpy(np.ascontiguousarray(seen, np.float32)))
    rois, rows, kinds = [], [], []
    for i in np.flatnonzero(enough):
        b = seen[i]
        if hit[i]:
            rois.append(refined[i].numpy()), rows.append(i), kinds.append(0)
        size = np.array([b[2] - b[0], b[3] - b[1]] * 2)
        for _ in range(jitters if learn[i] else jitters // 2):
            rois.append(b + rng.normal(0, 0.035, 4) * size), rows.append(i), kinds.append(1)
    if not rois:
        return None
    rois = np.stack(rois).astype(np.float32)
    h, w = labels.shape
    rois = np.minimum(np.maximum(rois, 0), [w, h, w, h]).astype(np.float32)
    features = net.read(feature_maps, F.pad(torch.from_numpy(rois), (1, 0)), CELLS)
    out = dict(features=features.half().numpy(), roi=rois, kind=np.array(kinds, np.uint8), learn=learn[rows],
               model=np.array([facts[i][0] for i in rows], np.int16), size=np.array([facts[i][1] for i in rows], np.float32),
               distance=np.array([facts[i][2] for i in rows], np.float32),
               seen=np.array([facts[i][3] for i in rows], np.float32), row=np.array(rows, np.int16))
    for m in KERNELS:
        out[f"cells{m}"] = np.stack([cell_labels(r, i, labels, owners, learn, m) for r, i in zip(rois, rows)])
    return out


def write_features(net, root, folder, models, jitters, seed):
    """One file for each 20 frames of a set; those that are there are left alone."""
    facts = facts_of(root, models)
    jobs = base.jobs_of(root)
    for start in range(0, len(jobs), 20):
        path = f"{folder}/{os.path.basename(root.rstrip('/'))}-{start:04}.npz"
        if os.path.exists(path):
            continue
        rng = np.random.default_rng([seed, start])
        torch.manual_seed(seed + start)
        found = []
        for job in jobs[start:start + 20]:
            rgb, labels, owners, boxes, learn = base.read_frame(job)
            own = [facts[job[1], job[2], job[3], row[0]] for row in job[4]]
            item = (torch.from_numpy(rgb).permute(2, 0, 1), torch.from_numpy(np.stack([labels, owners])), boxes, learn)
            one = regions_of(net, item, own, learn.any() and rng.random() < 0.6, rng, jitters)
            if one is not None:
                found.append(one)
        np.savez(path + ".tmp.npz", **{k: np.concatenate([f[k] for f in found]) for k in found[0]})
        os.replace(path + ".tmp.npz", path)
        print(path, flush=True)


# ---------------------------------------------------------------- heads

def proportions(roi):
    return np.log((roi[:, 2] - roi[:, 0]).clip(1) / (roi[:, 3] - roi[:, 1]).clip(1))[:, None].astype(np.float32)


def read_features(folder, roots, wanted, names):
    found = []
    for root in roots:
        for path in sorted(glob.glob(f"{folder}/{os.path.basename(root.rstrip('/'))}-*.npz")):
            file = np.load(path)
            chosen = np.flatnonzero(wanted(file))
            found.append({name: file[name][chosen] for name in names})
    return {name: np.concatenate([one[name] for one in found]) for name in names}


class VehicleHead(nn.Module):
    """As crates/partpose-net/src/vehicle_head.rs; `drop` in training only."""

    def __init__(self, models, inputs=128, channels=64, width=160, drop=0.3):
        super().__init__()
        self.conv, self.fc = nn.Conv2d(inputs, channels, 3, 2, 1), nn.Linear(49 * channels + 1, width)
        self.model, self.extent, self.drop = nn.Linear(width, models), nn.Linear(width, 6), drop
        for layer in (self.conv, self.fc):
            nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
        nn.init.normal_(self.model.weight, std=0.01)
        nn.init.normal_(self.extent.weight, std=0.001)
        for layer in (self.conv, self.fc, self.model, self.extent):
            nn.init.zeros_(layer.bias)

    def forward(self, x, proportion):
        x = F.dropout(F.relu(self.conv(x)).flatten(1), self.drop / 2, self.training)
        x = F.dropout(F.relu(self.fc(torch.cat([x, proportion], 1))), self.drop, self.training)
        return self.model(x), self.extent(x)


def extent_loss(values, size):
    error, deviation = values[:, :3] - size, values[:, 3:].clamp(-2, 2)
    robust = F.smooth_l1_loss(10 * error, torch.zeros_like(error), reduction="none")
    likelihood = deviation + 0.5 * (error.detach() / (TYPICAL_DEVIATION * deviation.exp())) ** 2
    return (robust + likelihood).sum(1).mean()


def rate_at(progress, step, most):
    return most * min(1.0, (step + 1) / 50) * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * progress)))


def train(module, loss_of, steps, rate, decay, report):
    optimizer = torch.optim.AdamW(module.parameters(), lr=rate, weight_decay=decay)
    sums, begin = 0.0, time.process_time()
    for step in range(steps):
        for group in optimizer.param_groups:
            group["lr"] = rate_at(step / steps, step, rate)
        loss = loss_of()
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(module.parameters(), 5.0)
        optimizer.step()
        sums += loss.item()
        if (step + 1) % 100 == 0 or step + 1 == steps:
            seconds = time.process_time() - begin
            print(f"step {step + 1}: loss {sums / (step % 100 + 1):.4f}, {seconds:.0f} s of processor time {report(step)}", flush=True)
            sums = 0.0


def hidden(net, features):
    """What the trained part head's convolutions make of the features, in their place."""
    with torch.no_grad(), torch.autocast("cpu", torch.bfloat16):
        for i in range(0, len(features), 64):
            x = torch.from_numpy(features[i:i + 64]).float().contiguous(memory_format=torch.channels_last)
            for conv in net.part_head["convs"]:
                x = F.relu(conv(x))
            features[i:i + 64] = x.half().numpy()


def train_vehicle_head(net, args, models, rng):
    names = ("features", "roi", "model", "size", "kind", "learn", "distance")
    # Vans, which detectors are not to learn, are models too; of what is mostly hidden a model cannot be told.
    data = read_features(args.cache, args.data, lambda f: (f["model"] >= 0) & (f["learn"] | (f["seen"] > 0.45)), names)
    held = read_features(args.cache, args.held_out, lambda f: (f["model"] >= 0) & f["learn"] & (f["kind"] == 0), names)
    for one in (data, held):
        hidden(net, one["features"])
    head = VehicleHead(len(models)).to(memory_format=torch.channels_last)
    of = lambda d, at: (torch.from_numpy(d["features"][at]).float().contiguous(memory_format=torch.channels_last),
                        torch.from_numpy(proportions(d["roi"][at])), torch.from_numpy(d["model"][at]).long(),
                        torch.from_numpy((d["size"][at] - TYPICAL).astype(np.float32)))

    def loss_of():
        x, proportion, model, size = of(data, rng.integers(len(data["model"]), size=args.batch))
        logits, extents = head(x, proportion)
        return F.cross_entropy(logits, model, label_smoothing=0.02) + 0.3 * extent_loss(extents, size)

    def told():
        head.eval()
        with torch.no_grad():
            parts = [head(*of(held, slice(i, i + 256))[:2]) for i in range(0, len(held["model"]), 256)]
        head.train()
        logits, extents = (torch.cat(p) for p in zip(*parts))
        return logits, extents, torch.from_numpy(held["model"]).long(), torch.from_numpy((held["size"] - TYPICAL).astype(np.float32))

    def report(step):
        if (step + 1) % 400 and step + 1 < args.steps:
            return ""
        logits, extents, model, size = told()
        right, error = (logits.argmax(1) == model).float(), extents[:, :3] - size
        bands = [right[(held["distance"] >= a) & (held["distance"] < b)].mean().item() for a, b in ((0, 15), (15, 30), (30, 99))]
        z = (error / (TYPICAL_DEVIATION * extents[:, 3:].clamp(-2, 2).exp())).pow(2).mean(0).sqrt()
        return (f"held out: right model {right.mean():.3f} (to 15 m, 30 m, beyond: {[round(b, 3) for b in bands]}), "
                f"log extents off by {[round(v, 4) for v in error.pow(2).mean(0).sqrt().tolist()]}, "
                f"in deviations {[round(v, 2) for v in z.tolist()]}")

    print(f"{len(data['model'])} regions to learn from, {len(held['model'])} held out", flush=True)
    train(head, loss_of, args.steps, 1e-3, 0.05, report)
    # What was learnt by heart is too sure; frames held out say by how much.
    logits, extents, model, size = told()
    scales = torch.linspace(0.3, 1.5, 121)
    best = scales[torch.stack([F.cross_entropy(s * logits, model) for s in scales]).argmin()].item()
    z = ((extents[:, :3] - size) / (TYPICAL_DEVIATION * extents[:, 3:].clamp(-2, 2).exp())).pow(2).mean(0).sqrt()
    with torch.no_grad():
        head.model.weight *= best
        head.model.bias *= best
        head.extent.bias[3:] += z.log()
    print(f"logits times {best:.2f}, deviations times {[round(v, 2) for v in z.tolist()]}")
    return {f"vehicle_head.{k}": v for k, v in head.state_dict().items()}


class PartHead(nn.Module):
    """As train_gpu.py's, for any kernel: a transposed convolution doubles the cells, else they are resized."""

    def __init__(self, kernel, c=128):
        super().__init__()
        self.kernel = kernel
        self.convs = nn.ModuleList(nn.Sequential(nn.Conv2d(c, c, 3, padding=1, bias=False), base.norm(c)) for _ in range(4))
        self.conv5_mask = nn.ConvTranspose2d(c, c, 2, 2) if kernel == 2 * CELLS else None
        self.mask_fcn_logits = nn.Conv2d(c, base.CHANNELS, 1)
        for module in self.convs:
            nn.init.kaiming_normal_(module[0].weight, nonlinearity="relu")
        if self.conv5_mask is not None:
            nn.init.kaiming_normal_(self.conv5_mask.weight, nonlinearity="relu")

    def forward(self, x):
        for conv in self.convs:
            x = F.relu(conv(x))
        if self.conv5_mask is not None:
            x = F.relu(self.conv5_mask(x))
        # Resizing commutes with a 1x1 convolution, which is cheaper on fewer cells.
        x = self.mask_fcn_logits(x)
        return x if x.shape[2] == self.kernel else F.interpolate(x, (self.kernel,) * 2, mode="bilinear", align_corners=False)


def train_part_head(args, rng):
    cells = f"cells{args.kernel}"
    data = read_features(args.cache, args.data, lambda f: f["learn"] | args.dontcare, ("features", cells))
    head = PartHead(args.kernel).to(memory_format=torch.channels_last)

    def loss_of():
        at = rng.integers(len(data[cells]), size=args.batch)
        target = torch.from_numpy(data[cells][at]).long()
        target[target == DONTCARE] = 0 if args.dontcare else -1
        x = torch.from_numpy(data["features"][at]).float().contiguous(memory_format=torch.channels_last)
        with torch.autocast("cpu", torch.bfloat16):
            logits = head(x)
        return F.cross_entropy(logits.float(), target, ignore_index=-1)

    print(f"{len(data[cells])} regions to learn from", flush=True)
    train(head, loss_of, args.steps, 2e-3, 0.03, lambda step: "")
    return {f"part_head.{k}": v for k, v in head.state_dict().items()}


# ---------------------------------------------------------------- main

def main():
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("weights")
    flags.add_argument("out")
    flags.add_argument("--cache", required=True)
    flags.add_argument("--data", nargs="+", required=True)
    flags.add_argument("--held-out", nargs="*", default=[])
    flags.add_argument("--kernel", type=int, choices=KERNELS)
    flags.add_argument("--dontcare", action="store_true")
    flags.add_argument("--steps", type=int, default=1600)
    flags.add_argument("--batch", type=int, default=96)
    flags.add_argument("--seed", type=int, default=1)
    args = flags.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)
    base.MEAN_T, base.STD_T = (torch.tensor(v).view(1, 3, 1, 1) for v in (base.MEAN, base.STD))
    base.SWAP_T, base.CODER_T = torch.tensor(base.SWAP), torch.tensor(base.CODER)
    state, config = read_weights(args.weights)
    models = [name.split()[0] for name in json.load(open(f"{args.data[0]}/synth.json"))["models"]]
    net = base.Net()
    net.load_state_dict({k: v for k, v in state.items() if not k.startswith("vehicle_head.")})
    net = fused(net.eval()).to(memory_format=torch.channels_last)
    os.makedirs(args.cache, exist_ok=True)
    with torch.no_grad():
        for root in args.data + args.held_out:
            write_features(net, root, args.cache, models, 2, args.seed)
    rng = np.random.default_rng(args.seed)
    if args.kernel:
        state = {k: v for k, v in state.items() if not k.startswith("part_head.")} | train_part_head(args, rng)
        config["parts"] = config.get("parts", {}) | {"kernel": args.kernel}
    else:
        state |= train_vehicle_head(net, args, models, rng)
        config |= {"models": models, "extents": True}
    base.save(args.out, state, config)
    print(f"wrote {args.out}, {os.path.getsize(args.out) / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
