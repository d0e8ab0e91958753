"""Writes loftr_*.safetensors: what loftr_test.cc needs of the LoFTR cases in a folder of golden vectors.

    pip install numpy safetensors
    python scripts/golden/loftr.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save_file

OUT = Path(__file__).resolve().parents[2] / "tests" / "data" / "matching"
MATCHES = ("i_ids", "j_ids", "mconf", "expec_f", "mkpts0_f", "mkpts1_f")
CASES = {"loftr_b": MATCHES, "loftr_c": (*MATCHES, "conf_matrix")}


def main(folder):
    for case, expected in CASES.items():
        stored = load_file(Path(folder) / "golden" / f"{case}.safetensors")
        kept = {name: stored[name] for name in expected}
        for name in ("image0", "image1"):
            kept[name] = stored[name].astype(np.float32)
        save_file(kept, OUT / f"{case}.safetensors")


if __name__ == "__main__":
    main(sys.argv[1])
