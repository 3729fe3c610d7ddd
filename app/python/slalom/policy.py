"""Trained policies."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _slalom, _tomllib
from ._copies import NotCopied


class Policy(NotCopied):
    """A policy that `slalom train` has written, driving as it does in C++, bit for bit.

    It remembers the last frames of each environment where its network has a history. An object may
    be used by one thread at a time.
    """

    _instead = "load its file once more"

    def __init__(self, path: str | os.PathLike):
        """Loads a policy file. Raises `slalom.Error` if it is damaged, or if the policy was trained
        to plan with its model, which this package cannot."""
        self.path = path = os.fspath(path)
        self._core = _slalom.Policy(path)
        self._config = _tomllib.loads(self._core.metadata.get("config", ""))
        if self._config.get("mpc", {}).get("enabled"):
            raise _slalom.Error(
                f"{path}: this policy plans with a transition model (mpc.enabled), which the Python "
                f"package cannot do; drive it with `slalom evaluate`")

    @classmethod
    def load(cls, path: str | os.PathLike) -> Policy:
        """The same as `Policy(path)`."""
        return cls(path)

    def act(self, observation: dict[str, np.ndarray], first: ArrayLike) -> np.ndarray:
        """Returns the actions, [B, 2] float32 in [-1, 1].

        observation: {"ranges": [B, N] uint16, "state": [B, S] float32}, as `make_vec` gives them. A
        policy of your own environment (`Actor`) takes its observations as [B, S] float32 instead,
        and gives [B, A]; `bounds` says what -1 and 1 stand for.
        first: [B] bool, True where the observation is the first of an episode. With autoreset in
        the same step that is `terminations | truncations` of the step that returned it. A batch of
        another size than the one before begins anew in every row.
        """
        if self._core.num_beams == 0:
            state = np.asarray(observation, np.float32)
            return self._core.act(np.empty((len(state), 0), np.uint16), state,
                                  np.asarray(first, bool))
        return self._core.act(observation["ranges"], observation["state"], np.asarray(first, bool))

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """What actions of -1 and of 1 command in your own environment: its action_low and
        action_high, [A] each."""
        task = self._config.get("task", {})
        return (np.array(task.get("action_low", [-1.0, -1.0])),
                np.array(task.get("action_high", [1.0, 1.0])))

    def speeds(self, actions: np.ndarray) -> np.ndarray:
        """Returns what actions command: [B, 2], speed in m/s and turn rate in rad/s."""
        return self._core.speeds(actions)

    @property
    def standstill(self) -> np.ndarray:
        """The action that commands standing still, [2]: the last action in the first observation of
        an episode, as in training, and each action before it."""
        return np.array(self._core.standstill, np.float32)

    def weights(self) -> dict[str, np.ndarray]:
        """Returns the network's parameters by name, as read-only arrays that share its memory.
        docs/networks.md says what they are."""
        return self._core.weights()

    @property
    def metadata(self) -> dict[str, str]:
        """What the trainer wrote beside the weights: config (TOML), commit, seed, steps, ..."""
        return self._core.metadata

    @property
    def task(self) -> dict[str, dict[str, Any]]:
        """The task of its training, section by section, as `make_vec(courses, **policy.task)` takes
        it. Empty if the file does not tell."""
        return self._config.get("environment", {})

    @property
    def state_size(self) -> int:
        """Numbers of a frame besides the scan."""
        return self._core.state_size

    @property
    def num_beams(self) -> int:
        """Beams per scan that it was trained for."""
        return self._core.num_beams

    @property
    def history(self) -> int:
        """Frames that its network sees at once."""
        return self._core.history
