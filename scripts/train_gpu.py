#!/usr/bin/env python3
"""Trains the default network on a GPU with PyTorch, for machines where burn's CPU backend would take a day.

The same network, losses and matching as crates/partpose-net (same names of parameters, same file), so that the result
loads like one of `partpose train`. Differences: bfloat16 arithmetic, batches of 16, the schedule follows the clock.

    python3 scripts/train_gpu.py OUT.safetensors --minutes 7 --data DIR... [--later DIR...] [--net net.json]

The number of regions differs from step to step, so cuDNN does not search for the fastest kernels.

DIR: what `partpose synth --out DIR` wrote; those after --later are read half way, once their file READY exists.
"""
import argparse
import glob
import json
import math
import os
import struct
import time
from multiprocessing import Pool

import numpy as np
import torch
import torch.nn.functional as F
from PIL import Image
from torch import nn
from torchvision.models import resnet18
from torchvision.ops import nms, roi_align

PARTS = [
    (255, 160, 122), (255, 127, 0), (255, 236, 139), (255, 215, 0), (120, 120, 120), (10, 10, 10), (248, 248, 255),
    (205, 201, 201), (255, 0, 0), (208, 32, 144), (255, 110, 180), (255, 20, 147), (224, 102, 255), (153, 50, 204),
    (210, 105, 0), (139, 69, 19), (0, 0, 238), (139, 35, 35), (135, 206, 250), (28, 134, 238), (39, 64, 139),
    (0, 0, 139), (0, 205, 205), (0, 139, 139), (0, 139, 0), (0, 238, 0), (0, 100, 0), (200, 83, 86), (157, 0, 4)]
SWAP = [0, 2, 1, 4, 3, 6, 5, 8, 7, 9, 10, 12, 11, 14, 13, 16, 15, 17, 18, 20, 19, 22, 21, 24, 23, 25, 26, 27, 29, 28]
MEAN, STD = (123.675, 116.28, 103.53), (58.395, 57.12, 57.375)
SIZES, RATIOS = (28.0, 56.0, 112.0, 224.0, 448.0), (0.75, 1.5, 3.0)
STRIDES = (8, 16, 32, 64, 128)
CODER = (10.0, 10.0, 5.0, 5.0)
CHANNELS, KERNEL = 30, 28
WIDTH, HEIGHT, BATCH, MOST = 768, 384, 16, 24  # images, and most vehicles of one
ITS_IGNORED = 255


# ---------------------------------------------------------------- data

def packed(rgb):
    rgb = rgb.astype(np.int32)
    return rgb[..., 0] << 16 | rgb[..., 1] << 8 | rgb[..., 2]


def read_frame(job):
    root, world, variation, frame, rows, tracks = job
    path = lambda archive: f"{root}/{archive}/{world}/{variation}/{frame:05}.png"
    rgb = np.array(Image.open(path("vkitti_1.3.1_rgb")).convert("RGB"))
    table = np.zeros(1 << 24, np.uint8)
    for i, (r, g, b) in enumerate(PARTS):
        table[r << 16 | g << 8 | b] = i + 1
    labels = table[packed(np.array(Image.open(path("parts")).convert("RGB")))]
    table[:] = 0
    index = {row[0]: i + 1 for i, row in enumerate(rows)}
    for color, track in tracks:
        table[color] = index.get(track, 0)
    owners = table[packed(np.array(Image.open(path("vkitti_1.3.1_scenegt")).convert("RGB")))]
    boxes = np.array([row[1] for row in rows], np.float32)
    learn = np.array([row[2] for row in rows], bool)
    return rgb, labels, owners, boxes, learn


def jobs_of(root):
    jobs = []
    for file in sorted(glob.glob(f"{root}/vkitti_1.3.1_motgt/*.txt")):
        world, variation = os.path.basename(file)[:-4].split("_", 1)
        encoding = f"{root}/vkitti_1.3.1_scenegt/{world}_{variation}_scenegt_rgb_encoding.txt"
        tracks = []
        for line in open(encoding).read().splitlines()[1:]:
            name, r, g, b = line.split()
            if ":" in name:
                tracks.append((int(r) << 16 | int(g) << 8 | int(b), int(name.split(":")[1])))
        frames = {}
        for line in open(file).read().splitlines()[1:]:
            c = line.split()
            l, t, r, b = map(float, c[6:10])
            frames.setdefault(int(c[0]), []).append((int(c[1]), (l, t, r + 1, b + 1), c[2] != "DontCare"))
        jobs += [(root, world, variation, f, rows[:250], tracks) for f, rows in sorted(frames.items())]
    return jobs


def load(roots, pool, device):
    out = []
    for rgb, labels, owners, boxes, learn in pool.imap(read_frame, [j for r in roots for j in jobs_of(r)], 4):
        if learn.any():
            to = lambda a: torch.from_numpy(a).to(device)
            out.append((to(rgb).permute(2, 0, 1).contiguous(), to(np.stack([labels, owners])), boxes, learn))
    return out


# ---------------------------------------------------------------- augmentation

def view(item, rng):
    """One varied image: [3, h, w] float, labels, owners (0, i + 1, or ignored), boxes, ignored boxes."""
    rgb, maps, boxes, learn = item
    H, W = rgb.shape[1:]
    scale = math.exp(rng.uniform(math.log(0.55), math.log(1.5)))
    around = rng.random() < 0.9
    pick = boxes[rng.choice(np.flatnonzero(learn))]
    if around:
        scale = min(scale, max(1.1 * HEIGHT / max(pick[3] - pick[1], 1.0), 0.55))
    span, origin = [], []
    for i, (most, side) in enumerate(((WIDTH, W), (HEIGHT, H))):
        window = most / scale
        free, share = max(side - window, 0.0), rng.random()
        start = pick[i + 2] - window + share * (window - (pick[i + 2] - pick[i])) if around else share * free
        start = int(min(max(start, 0.0), free))
        origin.append(start)
        span.append(int(min(window, side - start)))
    (x, y), (w, h) = origin, span
    out_w, out_h = min(round(w * scale), WIDTH), min(round(h * scale), HEIGHT)
    sx, sy = out_w / w, out_h / h
    image = F.interpolate(rgb[None, :, y:y + h, x:x + w].float(), (out_h, out_w), mode="bilinear",
                          antialias=True, align_corners=False)[0]
    maps = F.interpolate(maps[None, :, y:y + h, x:x + w].float(), (out_h, out_w), mode="nearest-exact")[0].long()
    whole = (boxes - np.array([x, y, x, y], np.float32)) * np.array([sx, sy, sx, sy], np.float32)
    if rng.random() < 0.5:
        image, maps = image.flip(2), maps.flip(2)
        maps = torch.stack([SWAP_T[maps[0]], maps[1]])
        whole = np.stack([out_w - whole[:, 2], whole[:, 1], out_w - whole[:, 0], whole[:, 3]], 1)
    seen = whole.clip(0, [out_w, out_h, out_w, out_h])
    area = lambda b: (b[:, 2] - b[:, 0]).clip(0) * (b[:, 3] - b[:, 1]).clip(0)
    enough = (area(seen) >= 0.3 * area(whole)) & (seen[:, 3] - seen[:, 1] >= 12) & learn
    return image, maps, seen, enough, area(seen) > 0


def batch_of(items, rng, device):
    images = torch.zeros(BATCH, 3, HEIGHT, WIDTH, device=device)
    inside = torch.zeros(BATCH, 1, HEIGHT, WIDTH, device=device)
    labels = torch.zeros(BATCH, HEIGHT, WIDTH, dtype=torch.long, device=device)
    owners = torch.full((BATCH, HEIGHT, WIDTH), ITS_IGNORED, dtype=torch.long, device=device)
    boxes, ignore = np.zeros((BATCH, MOST, 4), np.float32), np.zeros((BATCH, MOST, 4), np.float32)
    rename = np.full((BATCH, 256), ITS_IGNORED)
    rename[:, 0] = 0
    sizes = np.zeros((BATCH, 2), np.float32)
    for b in range(BATCH):
        image, maps, seen, enough, some = view(items[rng.integers(len(items))], rng)
        h, w = image.shape[1:]
        images[b, :, :h, :w], inside[b, :, :h, :w] = image, 1.0
        labels[b, :h, :w], owners[b, :h, :w] = maps[0], maps[1]
        sizes[b] = w, h
        own, other = np.flatnonzero(enough)[:MOST], np.flatnonzero(some & ~enough)[:MOST]
        boxes[b, :len(own)], ignore[b, :len(other)] = seen[own], seen[other]
        rename[b, own + 1] = np.arange(len(own)) + 1
    to = lambda a: torch.from_numpy(a).to(device, non_blocking=True)
    rename = to(rename)
    padding = inside[:, 0] == 0
    owners = torch.gather(rename, 1, owners.flatten(1)).view_as(owners)
    owners[padding] = ITS_IGNORED
    images = colors(images, inside, device)
    return images, labels, owners, to(boxes), to(ignore), to(sizes)


def colors(x, inside, device):
    r = lambda most: most * (2 * torch.rand(BATCH, 1, 1, 1, device=device) - 1)
    mean = (x.sum((1, 2, 3)) / (3 * inside.sum((1, 2, 3)))).view(-1, 1, 1, 1)
    x = (x - mean) * torch.exp(r(0.25)) + mean + 255 * r(0.12)
    grey = x.mean(1, keepdim=True)
    x = grey + (x - grey) * torch.exp(r(0.35))
    x = x * (1 + 0.06 * (2 * torch.rand(BATCH, 3, 1, 1, device=device) - 1))
    x = 255 * (x.clamp(0, 255) / 255).pow(torch.exp(r(0.25)))
    blurred = F.avg_pool2d(F.pad(x, (1, 1, 1, 1), mode="replicate"), 3, 1)
    much = torch.rand(BATCH, 1, 1, 1, device=device) * (torch.rand(BATCH, 1, 1, 1, device=device) < 0.2)
    x = x + much * (blurred - x)
    x = x + 6 * torch.rand(BATCH, 1, 1, 1, device=device).pow(2) * torch.randn_like(x)
    x = (x.clamp(0, 255) - MEAN_T) / STD_T
    return x * inside


# ---------------------------------------------------------------- network

def norm(c):
    return nn.BatchNorm2d(c, momentum=0.05)


class Fpn(nn.Module):
    def __init__(self, inputs, c):
        super().__init__()
        block = lambda i, k: nn.Sequential(nn.Conv2d(i, c, k, padding=k // 2, bias=False), norm(c))
        self.inner_blocks = nn.ModuleList(block(i, 1) for i in inputs)
        self.layer_blocks = nn.ModuleList(block(c, 3) for _ in inputs)

    def forward(self, maps):
        above, levels = None, []
        for inner, layer, x in reversed(list(zip(self.inner_blocks, self.layer_blocks, maps))):
            x = inner(x)
            above = x if above is None else x + F.interpolate(above, x.shape[2:], mode="nearest")
            levels.insert(0, layer(above))
        for _ in range(2):
            levels.append(F.max_pool2d(levels[-1], 1, 2))
        return levels


class Net(nn.Module):
    def __init__(self, c=128, width=256):
        super().__init__()
        self.backbone = resnet18(norm_layer=norm, zero_init_residual=True)
        del self.backbone.fc
        self.fpn = Fpn((128, 256, 512), c)
        kinds = len(RATIOS)
        self.rpn = nn.ModuleDict(dict(conv=nn.Conv2d(c, c, 3, padding=1), cls_logits=nn.Conv2d(c, kinds, 1),
                                      bbox_pred=nn.Conv2d(c, 4 * kinds, 1)))
        self.box_head = nn.ModuleDict(dict(fc6=nn.Linear(49 * c, width), fc7=nn.Linear(width, width),
                                           cls_score=nn.Linear(width, 2), bbox_pred=nn.Linear(width, 4)))
        self.part_head = nn.ModuleDict(dict(
            convs=nn.ModuleList(nn.Sequential(nn.Conv2d(c, c, 3, padding=1, bias=False), norm(c)) for _ in range(4)),
            conv5_mask=nn.ConvTranspose2d(c, c, 2, 2), mask_fcn_logits=nn.Conv2d(c, CHANNELS, 1)))
        for module in (self.rpn["cls_logits"], self.rpn["bbox_pred"], self.box_head["cls_score"]):
            nn.init.normal_(module.weight, std=0.01)
        nn.init.normal_(self.box_head["bbox_pred"].weight, std=0.001)
        for module in (*self.part_head["convs"], [self.rpn["conv"]], [self.part_head["conv5_mask"]]):
            nn.init.kaiming_normal_(module[0].weight, nonlinearity="relu")
        for module in (self.box_head["fc6"], self.box_head["fc7"]):
            nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
        for name, parameter in self.named_parameters():
            if name.endswith("bias"):
                nn.init.zeros_(parameter)

    def maps(self, x):
        b = self.backbone
        x = b.layer1(b.maxpool(F.relu(b.bn1(b.conv1(x)))))
        found = []
        for layer in (b.layer2, b.layer3, b.layer4):
            x = layer(x)
            found.append(x)
        return self.fpn(found)

    def proposals_of(self, maps):
        """Logits [B, A], deltas [B, A, 4] over all levels, kind-major in each."""
        logits, deltas = [], []
        for x in maps:
            x = F.relu(self.rpn["conv"](x))
            b, _, h, w = x.shape
            logits.append(self.rpn["cls_logits"](x).flatten(1))
            d = self.rpn["bbox_pred"](x).view(b, len(RATIOS), 4, h * w)
            deltas.append(d.transpose(2, 3).reshape(b, -1, 4))
        return logits, deltas

    def read(self, maps, rois, cells):
        """rois: [K, 5], image first."""
        side = ((rois[:, 3] - rois[:, 1]).clamp(min=0) * (rois[:, 4] - rois[:, 2]).clamp(min=0)).sqrt()
        level = (4 + torch.log2(side / 224 + 1e-6)).floor().clamp(3, 5) - 3
        out = torch.zeros(len(rois), maps[0].shape[1], cells, cells, device=rois.device)
        for i in range(3):
            at = torch.nonzero(level == i)[:, 0]
            if len(at):
                out[at] = roi_align(maps[i].float(), rois[at], (cells, cells), 1 / STRIDES[i], 2, aligned=True)
        return out

    def boxes(self, features):
        h = self.box_head
        x = F.relu(h["fc7"](F.relu(h["fc6"](features.flatten(1)))))
        return h["cls_score"](x).float(), h["bbox_pred"](x).float()

    def parts(self, x):
        for conv in self.part_head["convs"]:
            x = F.relu(conv(x))
        return self.part_head["mask_fcn_logits"](F.relu(self.part_head["conv5_mask"](x))).float()


# ---------------------------------------------------------------- boxes and losses

def anchors(device):
    found = []
    for size, stride in zip(SIZES, STRIDES):
        h, w = -(-HEIGHT // stride), -(-WIDTH // stride)
        y, x = torch.meshgrid((torch.arange(h) + 0.5) * stride, (torch.arange(w) + 0.5) * stride, indexing="ij")
        for ratio in RATIOS:
            half = torch.tensor([size * ratio ** 0.5 / 2, size / ratio ** 0.5 / 2])
            c = torch.stack([x, y], -1).reshape(-1, 2)
            found.append(torch.cat([c - half, c + half], 1))
    return torch.cat(found).to(device)


def centre(b):
    size = (b[..., 2:] - b[..., :2]).clamp(min=1e-3)
    return (b[..., :2] + b[..., 2:]) / 2, size


def encode(b, a):
    (c, s), (ac, a_s) = centre(b), centre(a)
    return torch.cat([(c - ac) / a_s, (s / a_s).log()], -1) * CODER_T


def decode(d, a):
    d = d / CODER_T
    c, s = centre(a)
    c, s = c + d[..., :2] * s, s * d[..., 2:].clamp(max=4.135).exp()
    return torch.cat([c - s / 2, c + s / 2], -1)


def overlap(a, b):
    """a: [B, N, 4], b: [B, G, 4] to IoU and share of a inside b, [B, N, G]."""
    low, high = torch.maximum(a[:, :, None, :2], b[:, None, :, :2]), torch.minimum(a[:, :, None, 2:], b[:, None, :, 2:])
    shared = (high - low).clamp(min=0).prod(-1)
    area = lambda x: (x[..., 2:] - x[..., :2]).clamp(min=0).prod(-1)
    own = area(a)[:, :, None]
    return shared / (own + area(b)[:, None, :] - shared).clamp(min=1e-6), shared / own.clamp(min=1e-6)


def match(b, truth, ignore, positive, negative, force):
    """1 vehicle, 0 background, -1 neither; and the vehicle."""
    iou, _ = overlap(b, truth)
    best, which = iou.max(2)
    kind = torch.full_like(which, -1)
    kind[best < negative] = 0
    kind[best >= positive] = 1
    if force:
        most = iou.amax(1, keepdim=True)
        forced = ((iou >= most) & (most > 0)).float() * iou
        value, at = forced.max(2)
        take = (value > 0) & (kind != 1)
        kind[take], which = 1, torch.where(take, at, which)
    inside = overlap(b, ignore)[1].amax(2) >= 0.5
    kind[(kind == 0) & inside] = -1
    return kind, which


def choose(kind, count, most):
    """A random choice of at most `count`, at most `most` of them positive: a mask."""
    key = torch.rand(kind.shape, device=kind.device)
    rank = lambda chosen: torch.where(chosen, key, key.new_tensor(-1.0)).argsort(1, descending=True).argsort(1)
    positive = (kind == 1) & (rank(kind == 1) < most)
    room = count - positive.sum(1, keepdim=True)
    return positive | ((kind == 0) & (rank(kind == 0) < room))


def smooth_l1(x, y):
    return F.smooth_l1_loss(x, y, reduction="none").sum(-1)


def losses(net, batch, boxes_of_anchors):
    images, labels, owners, truth, ignore, sizes = batch
    B = len(images)
    with torch.autocast("cuda", torch.bfloat16):
        maps = net.maps(images.contiguous(memory_format=torch.channels_last))
        logit_levels, delta_levels = net.proposals_of(maps)
    logits, deltas = torch.cat(logit_levels, 1).float(), torch.cat(delta_levels, 1).float()
    with torch.no_grad():
        a = boxes_of_anchors[None].expand(B, -1, -1)
        kind, which = match(a, truth, ignore, 0.7, 0.3, True)
        chosen = choose(kind, 256, 128)
        positive = chosen & (kind == 1)
        aim = encode(torch.gather(truth, 1, which[..., None].expand(-1, -1, 4)), a)
    n = chosen.sum()
    rpn_class = F.binary_cross_entropy_with_logits(logits[chosen], (kind[chosen] == 1).float(), reduction="sum") / n
    rpn_box = smooth_l1(deltas[positive], aim[positive]).sum() / n
    with torch.no_grad():
        rois = propose(logit_levels, deltas, boxes_of_anchors, truth, sizes)
        kind, which = match(rois, truth, ignore, 0.5, 0.5, False)
        kind[(rois[..., 2] - rois[..., 0] < 2) | (rois[..., 3] - rois[..., 1] < 2)] = -1
        chosen = choose(kind, 64, 16)
        image, at = torch.nonzero(chosen, as_tuple=True)
        kind, which, roi = kind[image, at], which[image, at], rois[image, at]
        own = truth[image, which]
        aim = encode(own, roi)
        five = torch.cat([image[:, None].float(), roi], 1)
    with torch.autocast("cuda", torch.bfloat16):
        scores, moves = net.boxes(net.read(maps, five, 7))
    positive = kind == 1
    box_class = F.cross_entropy(scores, kind.clamp(min=0))
    box = smooth_l1(moves[positive], aim[positive]).sum() / len(kind)
    with torch.no_grad():
        roi, image, which = roi[positive], image[positive], which[positive]
        m = (torch.arange(KERNEL, device=roi.device) + 0.5) / KERNEL
        x = (roi[:, :1] + m * (roi[:, 2:3] - roi[:, :1])).long().clamp(0, WIDTH - 1)
        y = (roi[:, 1:2] + m * (roi[:, 3:] - roi[:, 1:2])).long().clamp(0, HEIGHT - 1)
        at = (image[:, None, None], y[:, :, None], x[:, None, :])
        owner, label = owners[at], labels[at]
        target = torch.where(owner == which[:, None, None] + 1, label, torch.zeros_like(label))
        target[owner == ITS_IGNORED] = -1
    with torch.autocast("cuda", torch.bfloat16):
        masks = net.parts(net.read(maps, five[positive], 14))
    mask = F.cross_entropy(masks, target, ignore_index=-1)
    with torch.no_grad():
        known = target >= 0
        right = (masks.argmax(1) == target)[known].float().mean()
    return (rpn_class, rpn_box, box_class, box, mask), right


def propose(logit_levels, deltas, boxes_of_anchors, truth, sizes, before=250, after=200):
    B, start, picked = len(deltas), 0, []
    for level, logits in enumerate(logit_levels):
        score, at = logits.float().topk(min(before, logits.shape[1]), 1)
        at = at + start
        start += logits.shape[1]
        d = torch.gather(deltas, 1, at[..., None].expand(-1, -1, 4))
        b = decode(d, boxes_of_anchors[at])
        limit = torch.cat([sizes, sizes], 1)[:, None]
        picked.append((score, torch.minimum(b.clamp(min=0), limit), torch.full_like(at, level)))
    score, box, level = (torch.cat(x, 1) for x in zip(*picked))
    group = level + 8 * torch.arange(B, device=box.device)[:, None]
    keep = batched_nms_by_offset(box.flatten(0, 1), score.flatten(), group.flatten())
    kept = torch.full(score.shape, -1e9, device=box.device).flatten()
    kept[keep] = score.flatten()[keep]
    top, at = kept.view(B, -1).topk(after, 1)
    rois = torch.gather(box, 1, at[..., None].expand(-1, -1, 4))
    rois = rois * (top > -1e8)[..., None]
    return torch.cat([rois, truth], 1)


def batched_nms_by_offset(box, score, group):
    return nms(box + (group * 4096.0)[:, None], score, 0.7)


# ---------------------------------------------------------------- saving

def save(path, state, config):
    header, data, offset = {"__metadata__": {"partpose.net": json.dumps(config)}}, [], 0
    for name, tensor in state.items():
        if name.endswith("num_batches_tracked"):
            continue
        raw = tensor.detach().float().clamp(-65504, 65504).half().cpu().contiguous().numpy().tobytes()
        header[name] = {"dtype": "F16", "shape": list(tensor.shape), "data_offsets": [offset, offset + len(raw)]}
        data.append(raw)
        offset += len(raw)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + b"".join(data))


# ---------------------------------------------------------------- main

def main():
    global SWAP_T, MEAN_T, STD_T, CODER_T
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("out")
    flags.add_argument("--minutes", type=float, default=7.0)
    flags.add_argument("--data", nargs="+", required=True)
    flags.add_argument("--later", nargs="*", default=[])
    flags.add_argument("--net", default='{"boxes": {"width": 256}}')
    flags.add_argument("--rate", type=float, default=1e-3)
    flags.add_argument("--seed", type=int, default=1)
    args = flags.parse_args()
    pool = Pool(min(14, os.cpu_count()))  # before the GPU is touched
    device = torch.device("cuda")
    torch.manual_seed(args.seed)
    rng = np.random.default_rng(args.seed)
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = True
    SWAP_T = torch.tensor(SWAP, device=device)
    MEAN_T, STD_T = (torch.tensor(v, device=device).view(1, 3, 1, 1) for v in (MEAN, STD))
    CODER_T = torch.tensor(CODER, device=device)
    begin = time.time()
    items = load(args.data, pool, device)
    print(f"{len(items)} frames read in {time.time() - begin:.0f} s on {torch.cuda.get_device_name()}", flush=True)
    later = list(args.later)
    net = Net().to(device, memory_format=torch.channels_last).train()
    decayed = [p for p in net.parameters() if p.dim() > 1]
    rest = [p for p in net.parameters() if p.dim() <= 1]
    groups = [dict(params=decayed, weight_decay=0.03), dict(params=rest, weight_decay=0.0)]
    optimizer = torch.optim.AdamW(groups, lr=args.rate, fused=True)
    average = {k: v.detach().clone() for k, v in net.state_dict().items()}
    a = anchors(device)
    begin, step, last, sums = time.time(), 0, time.time(), torch.zeros(6, device=device)
    total_seconds = 60 * args.minutes
    while (spent := time.time() - begin) < total_seconds:
        if later and spent > 0.3 * total_seconds:
            ready = [d for d in later if os.path.exists(f"{d}/READY")]
            if ready:
                more = load(ready, pool, device)
                items += more
                later = [d for d in later if d not in ready]
                print(f"{len(more)} frames more after {spent:.0f} s", flush=True)
            later = later if spent < 0.6 * total_seconds else []
        progress = spent / total_seconds
        rate = args.rate * min(1.0, (step + 1) / 150) * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * progress)))
        for group in optimizer.param_groups:
            group["lr"] = rate
        parts, right = losses(net, batch_of(items, rng, device), a)
        weights = (1.0, 2.0, 1.0, 2.0, 4.0)
        total = sum(w * p for w, p in zip(weights, parts))
        optimizer.zero_grad(set_to_none=True)
        total.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 10.0)
        optimizer.step()
        keep = min(0.998, (1 + step) / (10 + step))
        with torch.no_grad():
            state = net.state_dict()
            pairs = [(average[k], v) for k, v in state.items() if v.is_floating_point()]
            torch._foreach_lerp_([p[0] for p in pairs], [p[1] for p in pairs], 1 - keep)
            sums += torch.stack([*parts, right]).detach()
        step += 1
        if step % 50 == 0:
            means = (sums / 50).tolist()
            if not all(map(math.isfinite, means)):
                raise SystemExit(f"the losses of steps {step - 50} to {step} are no finite numbers: {means}")
            now = time.time()
            print(f"step {step} at {spent:.0f} s: rpn {means[0]:.4f} {means[1]:.4f} class {means[2]:.4f} box {means[3]:.4f} "
                  f"mask {means[4]:.4f} right {means[5]:.4f} rate {rate:.1e}, {50 * BATCH / (now - last):.0f} images/s",
                  flush=True)
            last = now
            sums.zero_()
        if step % 500 == 0:
            save(args.out, average, json.loads(args.net))
    save(args.out, average, json.loads(args.net))
    print(f"{step} steps, {step * BATCH} images, {time.time() - begin:.0f} s", flush=True)
    pool.terminate()


if __name__ == "__main__":
    main()
