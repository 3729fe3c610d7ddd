"""What is taken of Gymnasium where it is installed, and stands in for it where it is not."""

import re
import warnings

import numpy as np


class _StandIn:
    """Stands in for gymnasium.Env and gymnasium.vector.VectorEnv."""

    def close(self):
        """Does nothing: memory is released with the object."""

    @property
    def unwrapped(self):
        return self


VectorEnv = _StandIn
AUTORESET_MODES = {}

try:
    from gymnasium import Env, __version__
    from gymnasium.envs.registration import register, registry
    from gymnasium.spaces import Box, Dict

    if tuple(map(int, re.findall(r"\d+", __version__)[:2])) >= (1, 4):
        from gymnasium.vector import AutoresetMode, VectorEnv
        AUTORESET_MODES = {mode.name: mode for mode in AutoresetMode}
    else:
        warnings.warn(
            f"found Gymnasium {__version__}, expected 1.4 or later (pip install 'gymnasium>=1.4'): "
            f"the wrappers of gymnasium.vector will not take slalom's environments, as this "
            f"version's RecordEpisodeStatistics would count their episodes wrongly")

    for id, fixed in {"slalom/Static-v0": "static-train-50", "slalom/Boxes-v0": "dynamic-box-train",
                      "slalom/Walls-v0": "dynamic-wall-train"}.items():
        if id not in registry:
            register(id, entry_point="slalom:make", vector_entry_point="slalom:make_vec",
                     kwargs={"courses": fixed})
except ImportError:
    Env = _StandIn

    class Box:
        """Stands in for gymnasium.spaces.Box: arrays between two bounds."""

        def __init__(self, low, high, shape=None, dtype=np.float32, seed=None):
            self.dtype = np.dtype(dtype)
            shape = np.broadcast(low, high).shape if shape is None else tuple(shape)
            self.low, self.high = (np.array(np.broadcast_to(bound, shape), self.dtype)
                                   for bound in (low, high))
            self.shape = shape
            self._random = np.random.default_rng(seed)

        def seed(self, seed=None):
            """Makes the draws of `sample` a function of the seed."""
            self._random = np.random.default_rng(seed)

        def sample(self):
            """Draws an array, uniformly between the bounds, which must be finite."""
            if not (np.isfinite(self.low).all() and np.isfinite(self.high).all()):
                raise ValueError("this space has no bounds to sample between")
            return self._random.uniform(self.low, self.high).astype(self.dtype)

        def contains(self, x):
            """Returns whether x is an array of this shape and type between the bounds."""
            return (isinstance(x, np.ndarray) and x.shape == self.shape and x.dtype == self.dtype
                    and bool((x >= self.low).all() and (x <= self.high).all()))

        def __repr__(self):
            return f"Box({self.shape}, {self.dtype})"

    class Dict(dict):
        """Stands in for gymnasium.spaces.Dict: one array of each space."""

        def contains(self, x):
            """Returns whether x has an array of each space and nothing else."""
            return x.keys() == self.keys() and all(self[key].contains(x[key]) for key in self)


def batched(space, size):
    """Returns the space of `size` arrays of `space`, stacked."""
    if isinstance(space, Dict):
        return Dict({key: batched(space[key], size) for key in space})
    low, high = (np.broadcast_to(bound, (size, *space.shape)) for bound in (space.low, space.high))
    return Box(low, high, dtype=space.dtype)
