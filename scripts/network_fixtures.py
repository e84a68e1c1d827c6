"""Writes what torchvision computes, for the tests of `partpose-net`: numbers to be compared with.

Needs torch and torchvision (made with torchvision 0.29.2, torch 2.15.0):

    python scripts/network_fixtures.py > crates/partpose-net/fixtures/torchvision.json

Weights and inputs follow a rule that the tests repeat, so that only results are stored.
"""

import json
import sys

import numpy
import torch
import torchvision
from torchvision.models.detection._utils import BoxCoder
from torchvision.models.detection.mask_rcnn import MaskRCNNPredictor
from torchvision.ops import FeaturePyramidNetwork, nms, roi_align


def numbers(count, seed):
    """Numbers between -1 and 1: the tests' rule."""
    i = numpy.arange(count, dtype=numpy.uint64)
    mixed = ((i + seed * 7919) * 2654435761 % 2**32).astype(numpy.uint64)
    return ((mixed >> numpy.uint64(8)) % 2001).astype(numpy.float32) / 1000 - 1


def tensor(shape, seed):
    return torch.from_numpy(numbers(int(numpy.prod(shape)), seed)).reshape(shape)


def fill(module):
    """Fills a module in the order of its state."""
    for seed, (name, value) in enumerate((n, v) for n, v in module.state_dict().items() if "num_batches" not in n):
        filled = tensor(value.shape, seed)
        if value.dim() > 1:
            fan = value.numel() // value.shape[0]
            filled = filled * (6 / fan) ** 0.5
        elif name.endswith("running_var"):
            filled = 1 + 0.5 * filled
        elif name.endswith("weight"):
            filled = 0.5 + 0.1 * filled
        else:
            filled = 0.1 * filled
        value.copy_(filled)


def some(values):
    """Twenty values spread over a tensor."""
    flat = values.detach().flatten()
    step = max(flat.numel() // 20, 1)
    return [float(v) for v in flat[::step][:20]]


def resnet(make):
    net = make().eval()
    fill(net)
    x = net.maxpool(net.relu(net.bn1(net.conv1(tensor((1, 3, 64, 96), 1000)))))
    stages = []
    for layer in (net.layer1, net.layer2, net.layer3, net.layer4):
        x = layer(x)
        stages.append(some(x))
    return stages


def pyramid():
    net = FeaturePyramidNetwork([8, 16, 32], 8)
    fill(net)
    sizes = [(8, 12, 20), (16, 6, 10), (32, 3, 5)]
    maps = {str(i): tensor((1, *size), 1000 + i) for i, size in enumerate(sizes)}
    return [some(level) for level in net(maps).values()]


def part_predictor():
    net = MaskRCNNPredictor(8, 16, 30)
    fill(net)
    return some(net(tensor((2, 8, 5, 5), 1000)))


def normalisation():
    """Batch normalisation in training, a residual, ReLU: results, statistics and gradients."""
    net = torch.nn.BatchNorm2d(6)
    fill(net)
    net.running_mean.zero_()
    net.running_var.zero_()
    net.momentum = 1.0
    net.train()
    x, residual = tensor((2, 6, 5, 7), 1000), tensor((2, 6, 5, 7), 1001)
    x.requires_grad_()
    with torch.enable_grad():
        for parameter in net.parameters():
            parameter.requires_grad_()
        y = torch.relu(net(x) + residual)
        (y * tensor(y.shape, 1002)).sum().backward()
    return {
        "result": some(y),
        "mean": some(net.running_mean),
        "variance": some(net.running_var),
        "of_input": some(x.grad),
        "of_weight": some(net.weight.grad),
        "of_bias": some(net.bias.grad),
    }


def regions():
    boxes = torch.tensor([[1, 2.0, 1.0, 9.0, 8.0], [0, -4.0, 3.0, 15.5, 40.0], [0, 3.0, 3.0, 3.0, 3.0]])
    return some(roi_align(tensor((2, 3, 6, 9), 1000), boxes, 3, 0.5, 2, True))


def boxes(count, seed):
    values = tensor((count, 4), seed)
    start, size = 30 * values[:, :2] + 30, 15 * values[:, 2:] + 20
    return torch.cat([start, start + size], 1)


def main():
    torch.manual_seed(0)
    coder = BoxCoder((10.0, 10.0, 5.0, 5.0))
    a, b = boxes(20, 1), boxes(20, 2)
    with torch.no_grad():
        result = {
            "resnet18": resnet(torchvision.models.resnet18),
            "resnet50": resnet(torchvision.models.resnet50),
            "pyramid": pyramid(),
            "part_predictor": part_predictor(),
            "normalisation": normalisation(),
            "regions": regions(),
            "encoded": coder.encode_single(a, b).flatten().tolist(),
            "decoded": coder.decode_single(5 * tensor((20, 4), 3), b).flatten().tolist(),
            "kept": nms(boxes(60, 4), torch.arange(60, 0, -1).float(), 0.4).tolist(),
        }
    json.dump(result, sys.stdout)
    print()


main()
