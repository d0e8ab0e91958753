"""The stand-ins for trained weights of nn/synthetic_weights.h, for the scripts beside this file."""

import numpy as np
import torch

NO_WEIGHTS = ("num_batches_tracked", "confidence_thresholds")


def uniform(name, shape):
    """The numbers u in [-1, 1) of nn/synthetic_weights.h."""
    seed = np.uint64(0xCBF29CE484222325)
    with np.errstate(over="ignore"):
        for byte in name.encode():
            seed = (seed ^ np.uint64(byte)) * np.uint64(0x100000001B3)
        z = seed + np.arange(1, int(np.prod(shape)) + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z = z ^ (z >> np.uint64(31))
    return ((z >> np.uint64(11)).astype(np.float64) * 2.0**-53 * 2 - 1).reshape(shape)


def synthetic(name, shape):
    u = uniform(name, shape)
    if len(shape) >= 2:
        u = u * np.sqrt(3 / np.prod(shape[1:]))
    elif name.endswith("running_var") or name.endswith(".weight"):
        u = 1 + 0.1 * u
    else:
        u = 0.1 * u
    return torch.from_numpy(u.astype(np.float32))


def fill(module):
    """Puts the module into evaluation mode, too."""
    state = module.state_dict()
    for name, tensor in state.items():
        if not name.endswith(NO_WEIGHTS):
            state[name] = synthetic(name, tuple(tensor.shape))
    module.load_state_dict(state)
    return module.eval()
