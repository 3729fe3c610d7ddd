"""Scores of whatever drives, by the protocols of `slalom evaluate`."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np

from . import _slalom
from .environment import NameOrPath, _settings, _toml
from .policy import Policy


class Evaluation:
    """The scores of an agent on a set of courses. Printed, it is the table of `slalom evaluate`."""

    def __init__(self, core):
        self._core = core
        self.report = json.loads(core.json())

    def __str__(self):
        return self._core.text()

    @property
    def success_rate(self) -> float:
        """The share of the episodes that reached the goal. `report` has the interval and more."""
        return self.report["success_rate"]

    def episodes(self) -> list[dict[str, Any]]:
        """Returns a dictionary for each episode; docs/evaluation.md has the columns. A pandas
        DataFrame of them is `pandas.DataFrame(evaluation.episodes())`."""
        return _rows(self._core.episode_csv())

    def courses(self) -> list[dict[str, Any]]:
        """Returns a dictionary for each course, likewise."""
        return _rows(self._core.course_csv())

    def write(self, directory: str | os.PathLike) -> None:
        """Writes the files that `slalom evaluate --output` writes, so that `slalom report` and
        `slalom compare` read them. Raises `slalom.Error` if there is such an evaluation already."""
        if os.path.exists(os.path.join(directory, "evaluation.json")):
            raise _slalom.Error(f"{directory}: has an evaluation already")
        os.makedirs(directory, exist_ok=True)
        self._core.write(os.fspath(directory))


def _number(text):
    for kind in int, float:
        try:
            return kind(text)
        except ValueError:
            pass
    return text


def _rows(text):
    return [{key: _number(value) for key, value in row.items()}
            for row in csv.DictReader(io.StringIO(text))]


def evaluate(agent: Policy | Callable[[Any, np.ndarray], np.ndarray],
             courses: NameOrPath = "static-test", *, name: str = "", episodes: int = 10, seed: int = 1,
             protocol: str = "paper", observation: Literal["frame", "vector"] = "frame",
             threads: int = 1, profile: NameOrPath | Sequence[NameOrPath] = (), collection: NameOrPath = "",
             generator_seed: int = 1, physics: str = "slalom",
             evaluation: dict[str, Any] | None = None,
             **sections: dict[str, Any]) -> Evaluation:
    """Drives `episodes` episodes on each course and returns an `Evaluation`.

    agent: a `Policy`, or any function of (observations, first) that returns actions, as
    `Policy.act` has them. It is called with a batch and must choose each action without regard to
    the others. With observation="vector" its observations are [B, N + S] float32.
    name: what reports call it.
    seed: the same seed gives every agent the same episodes, those of `slalom evaluate --seed`.
    protocol: "paper", "dwa-runs" or "barn-challenge" (docs/evaluation.md).
    evaluation: other keys of [evaluation], for example {"time_limit": 40.0}.
    The rest is as in `make_vec`. A policy drives the task that it was trained for, under the
    profile and the keys given here.
    """
    rules = {"protocol": protocol, "episodes_per_course": episodes, "seed": seed,
             **(evaluation or {})}
    rules = [(f"evaluation.{key}", _toml(value)) for key, value in rules.items()]
    profiles = [profile] if isinstance(profile, (str, os.PathLike)) else profile
    profiles = [os.fspath(p) for p in profiles]
    trained = _settings(agent.task) if isinstance(agent, Policy) else []
    if isinstance(agent, Policy):
        driver = agent._core
        name = name or agent.path
    else:
        name = name or getattr(agent, "__name__", type(agent).__name__)
        if observation == "vector":
            import slalom
            observe = slalom.make(courses, profile=profile, collection=collection,
                                  generator_seed=generator_seed, **sections)._core.observe

            def driver(ranges, state, first):
                return agent(observe(ranges, state), first)
        else:
            def driver(ranges, state, first):
                return agent({"ranges": ranges, "state": state}, first)
    return Evaluation(_slalom.evaluate(driver, name, os.fspath(courses), trained, profiles,
                                       _settings(sections), rules, os.fspath(collection),
                                       generator_seed, threads, physics))
