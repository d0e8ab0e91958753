"""Writes tests/data/nn/efficientnet_lite0.safetensors: feature maps of the Python package for synthetic weights.

    pip install torch numpy safetensors efficientnet-lite-pytorch==0.1.0
    python scripts/golden/efficientnet_lite0.py
"""

from pathlib import Path

import numpy as np
import torch
from efficientnet_lite_pytorch import EfficientNet
from safetensors.numpy import save_file
from synthetic import fill, uniform

OUT = Path(__file__).resolve().parents[2] / "tests" / "data" / "nn"
SIZE = 64
STAGES = {"stride8": 4, "stride16": 10, "stride32": 15}


def main():
    model = fill(EfficientNet.from_name("efficientnet-lite0")).double()

    image = torch.from_numpy((uniform("input.image", (1, 3, SIZE, SIZE)) + 1) / 2)
    image = image.float().double()
    maps = {}
    with torch.no_grad():
        x = model._swish(model._bn0(model._conv_stem((image - 0.498) / 0.502)))
        for index, block in enumerate(model._blocks):
            x = block(x)
            for name, last in STAGES.items():
                if index == last:
                    maps[name] = x.float().numpy()
    save_file(maps, OUT / "efficientnet_lite0.safetensors")
    print({name: (value.shape, float(np.abs(value).max())) for name, value in maps.items()})


if __name__ == "__main__":
    main()
