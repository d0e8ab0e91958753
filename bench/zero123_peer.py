"""Times a guided step of Zero123 against diffusers on PyTorch, with the same synthetic weights, alternating in one run.

    pip install torch diffusers safetensors
    cmake --preset release -DANTIPODE_BENCHMARKS=ON && cmake --build --preset release --target zero123_benchmark
    python bench/zero123_peer.py [--threads 2] [--repeats 3]
"""
import argparse
import subprocess
import tempfile
import time
from pathlib import Path

import torch
from diffusers import UNet2DConditionModel
from safetensors.torch import load_file

VIEWS, SIDE = 8, 32
SHAPE = dict(sample_size=SIDE, in_channels=8, out_channels=4, cross_attention_dim=768, attention_head_dim=8,
             block_out_channels=(320, 640, 1280, 1280))


class Program:
    def __init__(self, path, threads, folder):
        self.process = subprocess.Popen([path, str(threads), folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline().strip() == "ready"

    def step(self, kind):
        print(kind, file=self.process.stdin, flush=True)
        return [float(word) for word in self.process.stdout.readline().split()]


def load_peer(folder):
    with torch.device("meta"):
        network = UNet2DConditionModel(**SHAPE)
    network.load_state_dict(load_file(Path(folder) / "diffusion_pytorch_model.safetensors"), assign=True)
    return network.eval()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/release/bin/zero123_benchmark")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    with tempfile.TemporaryDirectory() as folder, torch.inference_mode():
        program = Program(options.program, options.threads, folder)
        peer = load_peer(folder)
        x, tokens = torch.randn(2 * VIEWS, 8, SIDE, SIDE), torch.randn(2 * VIEWS, 1, 768)
        fastest = {}
        for repeat in range(options.repeats + 1):
            spent = {kind: program.step(kind)[0] for kind in ("general", "constant", "shallow")}
            begin = time.perf_counter()
            peer(x, 500, tokens)
            spent["diffusers"] = 1000 * (time.perf_counter() - begin)
            print({kind: round(milliseconds) for kind, milliseconds in spent.items()}, flush=True)
            if repeat > 0:  # the first warms up
                fastest = {kind: min(spent[kind], fastest.get(kind, spent[kind])) for kind in spent}
    for kind in ("general", "constant", "shallow"):
        print(f"{kind}: {fastest[kind]:.0f} ms, {fastest['diffusers'] / fastest[kind]:.2f} times as fast as diffusers")


if __name__ == "__main__":
    main()
