"""Writes the small PyTorch checkpoints of the importer's tests beside this script.

Needs torch. Every tensor holds sin(1), sin(2), ... in row-major order unless its name says otherwise, so that
the tests know the values: `python make_checkpoints.py`.
"""

import argparse
import collections
import os
import pathlib

import torch

FOLDER = pathlib.Path(__file__).parent


def wave(*shape):
    count = int(torch.tensor(shape).prod()) if shape else 1
    return torch.sin(torch.arange(1, count + 1, dtype=torch.float64)).reshape(shape).float()


def whole(*shape):
    count = int(torch.tensor(shape).prod())
    return torch.arange(count).reshape(shape)


def state_dict():
    base = wave(4, 6)
    shared = wave(10)
    linear = torch.nn.Linear(3, 2)
    with torch.no_grad():
        linear.weight.copy_(wave(2, 3))
        linear.bias.copy_(wave(2))
    state = collections.OrderedDict(linear.state_dict(prefix="linear."))
    state["parameter"] = torch.nn.Parameter(wave(2, 2))
    state["double"] = wave(5).double()
    state["half"] = wave(5).half()
    state["bfloat16"] = wave(5).bfloat16()
    state["int64"] = whole(2, 3)
    state["int32"] = whole(2, 3).int()
    state["int16"] = whole(2, 3).short()
    state["int8"] = whole(2, 3).char()
    state["uint8"] = whole(2, 3).byte()
    state["bool"] = whole(2, 3) % 2 == 1
    state["scalar"] = wave()
    state["empty"] = torch.zeros(0, 3)
    state["base"] = base
    state["transposed"] = base.t()
    state["window"] = base[1:3, 2:5]
    state["every_second"] = base[:, ::2]
    state["expanded"] = wave(3, 1).expand(3, 4)
    state["shared_whole"] = shared
    state["shared_tail"] = shared[4:]
    return state


class Callback:
    """Stands for the classes of a training framework."""

    def __init__(self):
        self.best = wave(2)


def training_checkpoint():
    return {
        "epoch": 7,
        "global_step": 2**40,
        "hyper_parameters": argparse.Namespace(rate=0.1, name="x"),
        "callbacks": {Callback: {"best": 0.5}, "monitor": Callback()},
        "big": 2**80,
        "none": None,
        "sizes": wave(2, 3).size(),
        "dtype": torch.float16,
        "state_dict": {"encoder": collections.OrderedDict(weight=wave(2, 3)), "step": whole(1)},
        "optimizer": {"state": {0: {"average": wave(3)}}, "groups": [wave(2)]},
    }


class RunsCommand:
    def __reduce__(self):
        return os.system, ("touch /tmp/antipode-was-here",)


def main():
    legacy = dict(_use_new_zipfile_serialization=False)
    torch.save(state_dict(), FOLDER / "state.pt")
    torch.save(state_dict(), FOLDER / "state_protocol4.pt", pickle_protocol=4)
    torch.save(state_dict(), FOLDER / "state_legacy.pth", **legacy)
    torch.save(training_checkpoint(), FOLDER / "training.ckpt")
    torch.save(training_checkpoint(), FOLDER / "training_legacy.ckpt", **legacy)
    torch.save({"weight": wave(2), "harm": RunsCommand()}, FOLDER / "malicious.pt")
    torch.save({"weight": wave(2), "harm": RunsCommand()}, FOLDER / "malicious_legacy.pth", **legacy)
    torch.save([wave(2)], FOLDER / "list.pt")
    torch.save(torch.nn.Linear(2, 2), FOLDER / "module.pt")
    torch.save({"z": torch.zeros(2, dtype=torch.complex64)}, FOLDER / "complex.pt")
    torch.save({"s": torch.eye(2).to_sparse()}, FOLDER / "sparse.pt")


if __name__ == "__main__":
    main()
