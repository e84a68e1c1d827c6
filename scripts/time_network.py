#!/usr/bin/env python3
"""Times our network beside torchvision's Mask R-CNN: one run, two threads each, in turns.

The same ResNet-18 with a pyramid of 128 channels on strides 8 to 128, anchors, 100 proposals (300 in training), 64
samples, heads of the same layers, 30 channels of masks, 10 detections. Both start from random weights and see noise with
six bright boxes. torchvision's inference includes what it does after the heads but for the pasting of masks into the
image, which ours leaves to others. With onnxruntime installed the same network is timed by it too, as `partpose export
onnx` writes it.

    cargo build --release --workspace --examples
    python3 scripts/time_network.py target/release/examples/step [--rounds 3]

Processes run one after the other, in turns; the first two runs of each are left out. Other work on the machine lengthens
wall times more than processor times, and both of all alike: the ratios hold within a tenth or so.
"""
import argparse
import importlib.util
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time

THREADS = 2
CASES = [("inference", 1248, 384, 1), ("training", 640, 192, 2), ("training", 1248, 384, 1)]


def model():
    from torchvision.models.detection import MaskRCNN
    from torchvision.models.detection.anchor_utils import AnchorGenerator
    from torchvision.models.detection.backbone_utils import BackboneWithFPN
    from torchvision.models.detection.faster_rcnn import FastRCNNPredictor, TwoMLPHead
    from torchvision.models.detection.mask_rcnn import MaskRCNNHeads, MaskRCNNPredictor
    from torchvision.models import resnet18
    from torchvision.ops import MultiScaleRoIAlign
    from torchvision.ops.feature_pyramid_network import LastLevelMaxPool
    from torch import nn
    import torch.nn.functional as F

    class TwoLevels(LastLevelMaxPool):
        def forward(self, x, y, names):
            return x + [F.max_pool2d(x[-1], 1, 2), F.max_pool2d(x[-1], 1, 4)], names + ["p6", "p7"]

    layers = {f"layer{i}": str(i - 2) for i in (2, 3, 4)}
    backbone = BackboneWithFPN(resnet18(weights=None), layers, [128, 256, 512], 128, TwoLevels(), nn.BatchNorm2d)
    pool = lambda cells: MultiScaleRoIAlign(["0", "1", "2"], cells, 2)
    sizes = tuple((s,) for s in (28, 56, 112, 224, 448))
    return MaskRCNN(
        backbone, min_size=1, max_size=4096, rpn_anchor_generator=AnchorGenerator(sizes, ((0.75, 1.5, 3.0),) * 5),
        rpn_pre_nms_top_n_train=1000, rpn_pre_nms_top_n_test=300, rpn_post_nms_top_n_train=300, rpn_post_nms_top_n_test=100,
        box_roi_pool=pool(7), box_head=TwoMLPHead(128 * 49, 512), box_predictor=FastRCNNPredictor(512, 2),
        box_batch_size_per_image=64, box_detections_per_img=10, mask_roi_pool=pool(14),
        mask_head=MaskRCNNHeads(128, (128,) * 4, 1, nn.BatchNorm2d), mask_predictor=MaskRCNNPredictor(128, 128, 30))


def theirs(what, width, height, count, rounds):
    import torch
    torch.set_num_threads(THREADS)
    torch.manual_seed(1)
    net = model()
    images, targets = torch.randn(count, 3, height, width) * 0.3, []
    for image in images:
        boxes, masks = [], torch.zeros(6, height, width, dtype=torch.uint8)
        for i in range(6):
            w = int(torch.randint(30, min(160, width // 3), (1,)))
            h = w * 2 // 3
            x, y = int(torch.randint(0, width - w, (1,))), int(torch.randint(0, height - h, (1,)))
            boxes.append([x, y, x + w, y + h])
            image[:, y:y + h, x:x + w], masks[i, y:y + h, x:x + w] = 1.5, 1
        targets.append(dict(boxes=torch.tensor(boxes, dtype=torch.float32), labels=torch.ones(6, dtype=torch.int64), masks=masks))
    from torchvision.models.detection.image_list import ImageList
    batch = ImageList(images, [(height, width)] * count)
    optimizer = torch.optim.SGD(net.parameters(), lr=0.01, momentum=0.9)

    def run():
        features = net.backbone(batch.tensors)
        known = targets if what == "training" else None
        proposals, losses = net.rpn(batch, features, known)
        found, more = net.roi_heads(features, proposals, batch.image_sizes, known)
        if what == "training":
            total = sum(losses.values()) + sum(more.values())
            optimizer.zero_grad()
            total.backward()
            optimizer.step()
            return len(known)
        return len(found[0]["boxes"])

    net.train(what == "training")
    with torch.set_grad_enabled(what == "training"):
        for _ in range(rounds):
            begin, used = time.time(), time.process_time()
            result = run()
            print(f"{what} all {1e3 * (time.time() - begin):.0f} (processor {1e3 * (time.process_time() - used):.0f}) ms, {result} found")
    tell_memory()


def onnx(path, width, height, rounds):
    """ONNX Runtime on our network as `partpose export onnx` writes it."""
    import numpy as np
    import onnxruntime
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = THREADS
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    rng = np.random.default_rng(1)
    image = rng.normal(110, 20, (1, 3, height, width)).clip(0, 255).astype(np.float32)
    for _ in range(6):
        w = int(rng.integers(30, min(160, width // 3)))
        h = w * 2 // 3
        x, y = int(rng.integers(0, width - w)), int(rng.integers(0, height - h))
        image[:, :, y:y + h, x:x + w] = 210
    for _ in range(rounds):
        begin, used = time.time(), time.process_time()
        found = session.run(["scores"], {"image": image})
        print(f"inference {1e3 * (time.time() - begin):.0f} (processor {1e3 * (time.process_time() - used):.0f}) ms, {len(found[0])} found")
    tell_memory()


def tell_memory():
    print("peak memory", re.search(r"VmHWM:\s*(\d+)", open("/proc/self/status").read())[1], "kB")


def measure(command):
    """Wall and processor times of each run, ms, without the first two of a process; peak memory, MB; what was found."""
    # Threads that wait must sleep: spinning on a busy machine would count as their work.
    environment = dict(os.environ, RAYON_NUM_THREADS=str(THREADS), OMP_NUM_THREADS=str(THREADS),
                       OMP_WAIT_POLICY="passive", GOMP_SPINCOUNT="0", KMP_BLOCKTIME="0")
    run = subprocess.run(command, env=environment, capture_output=True, text=True)
    if run.returncode:
        sys.exit(f"{' '.join(command)} failed:\n{run.stderr[-2000:]}")
    times = [tuple(map(float, t)) for t in re.findall(r"(?:all|inference) (\d+) \(processor (\d+)\) ms", run.stdout)][2:]
    memory, unit = re.search(r"peak memory (\d+) (\w+)", run.stdout).groups()
    found = re.findall(r"ms, (\d+) found", run.stdout)
    return times, float(memory) / (1000 if unit == "kB" else 1), found[-1] if found else ""


def row(name, runs, base=None):
    """A line of the table: medians of all runs and the ratios to the first line's."""
    median = lambda k: statistics.median(t[k] for times, _, _ in runs for t in times)
    values = [median(0), median(1), max(memory for _, memory, _ in runs)]
    ratios = ["" if base is None else f" ({value / of:.2f})" for value, of in zip(values, base or values)]
    cells = " | ".join(f"{value:.0f}{ratio}" for value, ratio in zip(values, ratios))
    print(f"| {name} | {cells} | {runs[-1][2]} |", flush=True)
    return values


def main():
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("ours")
    flags.add_argument("--rounds", type=int, default=3)
    flags.add_argument("--repeat", type=int, default=6)
    flags.add_argument("--case", nargs="+", help=argparse.SUPPRESS)
    args = flags.parse_args()
    if args.case and args.case[0].endswith(".onnx"):
        return onnx(args.case[0], *map(int, args.case[1:3]), args.repeat)
    if args.case:
        return theirs(args.case[0], *map(int, args.case[1:]), args.repeat)
    again = lambda *case: [sys.executable, __file__, args.ours, "--repeat", str(args.repeat), "--case", *map(str, case)]
    loads = []
    print("| medians (ratio to torchvision) | wall, ms | processor, ms | peak memory, MB | found |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for what, *sizes in CASES:
            commands = {"torchvision": again(what, *sizes), "ours": [args.ours, str(args.repeat), what, *map(str, sizes)]}
            if what == "inference" and importlib.util.find_spec("onnxruntime"):
                path = f"{folder}/network.onnx"
                subprocess.run([args.ours, "1", path, *map(str, sizes)], check=True)
                commands["ours by ONNX Runtime"] = again(path, *sizes)
            runs = {name: [] for name in commands}
            for _ in range(args.rounds):
                for name, command in commands.items():
                    runs[name].append(measure(command))
                    loads.append(os.getloadavg()[0])
            title = f"{what}, {sizes[2]} x {sizes[0]} x {sizes[1]}: "
            base = row(title + "torchvision", runs.pop("torchvision"))
            for name, measured in runs.items():
                row(name, measured, base)
    print(f"\nload {min(loads):.1f} to {max(loads):.1f}")


if __name__ == "__main__":
    main()
