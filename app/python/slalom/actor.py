"""An environment of one's own, driven for a learner of Slalom's service."""

from __future__ import annotations

import math
import os
import signal
import threading
from collections.abc import Callable
from typing import Any, Optional

import numpy as np

from . import _slalom
from ._copies import NotCopied
from .environment import _toml


def _finite(value, name):
    number = float(value)
    if not math.isfinite(number):
        raise _slalom.Error(f"the environment's {name} is {number}, expected a finite number")
    return number


def _require_bounds(space, core):
    """Raises unless actions of this space are what the config says. None: it is not told."""
    if space is None:
        return
    dtype = getattr(space, "dtype", None)
    if dtype is None or not np.issubdtype(dtype, np.floating) or not hasattr(space, "low"):
        raise _slalom.Error(f"the environment's action_space is {space}, expected a Box of floats")
    for name in "low", "high":
        bound, given = np.array(getattr(core, f"action_{name}")), np.ravel(getattr(space, name))
        if bound.shape != given.shape or not np.allclose(given, bound):
            raise _slalom.Error(f"task.action_{name} is {bound.tolist()}, expected the "
                                f"environment's {given.tolist()}")


class _Driven:
    """An environment as the C++ of an actor calls it."""

    def __init__(self, environment, core):
        self._environment = environment
        low, high = np.array(core.action_low), np.array(core.action_high)
        space = getattr(environment, "action_space", None)
        _require_bounds(space, core)
        self._middle, self._half = (high + low) / 2, (high - low) / 2
        self._shape = getattr(space, "shape", low.shape)
        self._dtype = getattr(space, "dtype", np.float32)
        self._size = core.observation_size

    def _flat(self, observation):
        try:
            numbers = np.ravel(np.asarray(observation, np.float32))
        except (TypeError, ValueError):
            raise _slalom.Error(f"the environment's observation is a {type(observation).__name__}, "
                                f"expected an array of {self._size} numbers") from None
        if numbers.shape != (self._size,):
            raise _slalom.Error(
                f"task.observation_size is {self._size}, expected the environment's {numbers.size}")
        return numbers

    def reset(self, seed):
        return self._flat(self._environment.reset(seed=seed)[0])

    def step(self, action):
        command = (self._middle + self._half * np.clip(action, -1.0, 1.0)).astype(self._dtype)
        observation, reward, terminated, truncated, info = self._environment.step(
            command.reshape(self._shape))
        return (self._flat(observation), _finite(reward, "reward"),
                _finite(info.get("cost", 0.0), "cost"), bool(terminated), bool(truncated))


class Actor(NotCopied):
    """An actor of a service (`slalom replay`, `slalom learner`) that drives your own environments.

    It is the actor of `slalom actor` with all its promises: every step is accepted by the replay
    server once, kept for the next start, or counted as lost (docs/service.md).
    """

    _instead = "make another one, with a name of its own"

    def __init__(self, environment: Callable[[], Any], config: str | os.PathLike, *,
                 name: Optional[str] = None, **sections: dict[str, Any]):
        """Makes `actor.num_environments` environments by calling `environment`, each a
        `gymnasium.Env` (or of its methods `reset(seed=)` and `step(action)`) whose observations are
        arrays of `task.observation_size` numbers and whose actions are floats between
        `task.action_low` and `task.action_high`. If its `info` has a "cost", that is the cost of
        the step: a constraint holds its sum over an episode.

        config: the TOML file of the run, the same for all its processes. name: `service.name`, the
        same after a restart. sections: keys that override the file's, such as
        actor={"num_environments": 4}. Raises `slalom.Error` if the config is for courses or does
        not fit the environments.
        """
        overrides = [f"{section}.{key}={_toml(value)}"
                     for section, values in sections.items() for key, value in values.items()]
        self._core = _slalom.Actor(os.fspath(config), overrides, name)
        self._environments = [_Driven(environment(), self._core)
                              for _ in range(self._core.num_envs)]

    @property
    def name(self) -> str:
        """The name of this actor among those of the run."""
        return self._core.name

    def run(self) -> dict[str, int]:
        """Drives until `stop`, SIGINT, SIGTERM or SIGHUP, and returns how many steps were made,
        accepted by the replay server, kept for the next start, and lost, counted over all runs of
        this name. It may be called again, which begins new episodes.

        SIGINT raises KeyboardInterrupt once the steps are safe. The other signals are taken only
        if this is the main thread. Raises what an environment raises, when its steps are safe, and
        `slalom.Error` if a server refuses this actor for good.
        """
        handlers = {}
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGTERM, signal.SIGHUP):
                handlers[number] = signal.signal(number, lambda *_: self.stop())
        try:
            return self._core.run(self._environments)
        finally:
            self._core.forget_stop()
            for number, handler in handlers.items():
                signal.signal(number, handler)

    def stop(self) -> None:
        """Lets `run` end within seconds, or the next one if none is under way. May be called from
        any thread."""
        self._core.stop()
