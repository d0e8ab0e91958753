"""Writes efficientnet_lite0.safetensors: feature maps of the Python package for synthetic weights.

    pip install torch numpy safetensors efficientnet-lite-pytorch==0.1.0
    python make_efficientnet_lite0.py
"""

from pathlib import Path

import numpy as np
import torch
from efficientnet_lite_pytorch import EfficientNet
from safetensors.numpy import save_file

SIZE = 64
STAGES = {"stride8": 4, "stride16": 10, "stride32": 15}


def uniform(name, count):
    """The numbers u in [-1, 1) of nn/synthetic_weights.h."""
    seed = np.uint64(0xCBF29CE484222325)
    with np.errstate(over="ignore"):
        for byte in name.encode():
            seed = (seed ^ np.uint64(byte)) * np.uint64(0x100000001B3)
        z = seed + np.arange(1, count + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z = z ^ (z >> np.uint64(31))
    return (z >> np.uint64(11)).astype(np.float64) * 2.0**-53 * 2 - 1


def synthetic(name, shape):
    u = uniform(name, int(np.prod(shape)))
    if len(shape) >= 2:
        u = u * np.sqrt(3 / np.prod(shape[1:]))
    elif name.endswith("running_var") or name.endswith(".weight"):
        u = 1 + 0.1 * u
    else:
        u = 0.1 * u
    return torch.from_numpy(u.reshape(shape).astype(np.float32))


def main():
    model = EfficientNet.from_name("efficientnet-lite0").eval()
    state = model.state_dict()
    for name, tensor in state.items():
        if not name.endswith("num_batches_tracked"):
            state[name] = synthetic(name, tuple(tensor.shape))
    model.load_state_dict(state)
    model = model.double()

    image = torch.from_numpy((uniform("input.image", 3 * SIZE * SIZE) + 1) / 2).reshape(1, 3, SIZE, SIZE)
    image = image.float().double()
    maps = {}
    with torch.no_grad():
        x = model._swish(model._bn0(model._conv_stem((image - 0.498) / 0.502)))
        for index, block in enumerate(model._blocks):
            x = block(x)
            for name, last in STAGES.items():
                if index == last:
                    maps[name] = x.float().numpy()
    save_file(maps, Path(__file__).with_name("efficientnet_lite0.safetensors"))
    print({name: (value.shape, float(np.abs(value).max())) for name, value in maps.items()})


if __name__ == "__main__":
    main()
