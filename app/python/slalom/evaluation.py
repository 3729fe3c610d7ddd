"""Scores of whatever drives, by the protocols of `slalom evaluate`."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np

from . import _slalom
from ._copies import NotCopied
from .environment import NameOrPath, _flat, _layout, _seed, _settings, _toml
from .policy import Policy
from .results import _rows


class Evaluation(NotCopied):
    """The scores of an agent on a set of courses. Printed, it is the table of `slalom evaluate`."""

    _instead = "write it, and read it by slalom.read or slalom.report"

    def __init__(self, core):
        self._core = core
        self.report = json.loads(core.json())
        self.directory: str | None = None  # Where it was written.

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

    def write(self, directory: str | os.PathLike, force: bool = False) -> None:
        """Writes the files that `slalom evaluate --output` writes, so that `slalom report`
        and `slalom.read` read them. Raises `slalom.Error` if there is an
        evaluation already, unless `force` is given, which replaces it."""
        if not force and os.path.exists(os.path.join(directory, "evaluation.json")):
            raise _slalom.Error(f"{directory}: holds an evaluation already; choose another "
                                f"directory, or replace it with force=True")
        os.makedirs(directory, exist_ok=True)
        self._core.write(os.fspath(directory))
        self.directory = os.fspath(directory)


def _guard(guard):
    """Returns (key, TOML) for each key of [guard] that is given; None if nothing shall be guarded."""
    if guard is None:
        return []
    if isinstance(guard, (bool, np.bool_)):
        return _flat("guard", {"shield": True, "waypoints": True}) if guard else None
    if not isinstance(guard, dict):
        raise TypeError(f"guard is {guard!r}, expected True, False or a dictionary of keys of [guard], such as "
                        f"{{'shield': True}}")
    return _flat("guard", guard)


def evaluate(agent: Policy | str | Callable[[Any, np.ndarray], np.ndarray],
             courses: NameOrPath = "static-test", *, name: str = "", episodes: int = 10, seed: int = 1,
             protocol: str = "paper", observation: Literal["frame", "vector"] | dict[str, Any] = "frame",
             threads: int = 1, profile: NameOrPath | Sequence[NameOrPath] = (), collection: NameOrPath = "",
             generator_seed: int = 1, physics: str = "slalom",
             evaluation: dict[str, Any] | None = None, guard: bool | dict[str, Any] | None = None,
             progress: Callable[[dict[str, int]], Any] | None = None, **sections: dict[str, Any] | float) -> Evaluation:
    """Drives `episodes` episodes on each course and returns an `Evaluation`.

    agent: a `Policy`, or any function of (observations, first) that returns actions, as
    `Policy.act` has them. It is called with a batch and must choose each action without regard to
    the others. Besides "ranges" and "state" its observations have "odometry", [B, 5] float64: x, y and yaw
    from where the episode began, forward speed and turn rate. With observation="vector" they are [B, N + S] float32. Or the name of a
    classical planner, "dwa", "teb", "eband" or "mppi", or "oracle", with the settings and the task
    of `slalom evaluate --agent` (20 commands a second, docs/planners.md).
    name: what reports call it.
    seed: the same seed gives every agent the same episodes, those of `slalom evaluate --seed`.
    protocol: "paper", "dwa-runs" or "barn-challenge" (docs/evaluation.md).
    evaluation: other keys of [evaluation], for example {"time_limit": 40.0}.
    guard: True puts the agent under a guard (docs/safety.md) with shield and waypoints, as the profile
    "configs/guarded.toml" does. A dictionary has the keys of [guard], for example
    {"shield": True, "margin": 0.06}. They are laid over the profile's; False is without a guard,
    whatever the profile says.
    progress: called after each control step with {"episodes": how many there are, "ended": ..., "successes": ...,
    "collisions": ...}; an exception that it raises ends the evaluation.
    The rest is as in `make_vec`. A policy drives the task that it was trained for, under the
    profile and the keys given here. If it was trained on some of the courses, a warning and every
    report of the scores say on how many.
    """
    observation, sections = _layout(observation, sections)
    rules = {"protocol": protocol, "episodes_per_course": episodes, "seed": seed,
             **(evaluation or {})}
    profiles = [profile] if isinstance(profile, (str, os.PathLike)) else profile
    if not name:
        name = (agent.path if isinstance(agent, Policy) else agent if isinstance(agent, str)
                else getattr(agent, "__name__", type(agent).__name__))
    request = _slalom.Request(
        name=name, courses=os.fspath(courses), profiles=[os.fspath(p) for p in profiles],
        settings=_settings(sections), guard=_guard(guard),
        rules=[(f"evaluation.{key}", _toml(value)) for key, value in rules.items()],
        collection=os.fspath(collection), generator_seed=_seed(generator_seed, "generator_seed"),
        threads=threads, physics=physics, progress=progress)
    if isinstance(agent, str):
        return Evaluation(_slalom.evaluate_planner(agent, request))
    if isinstance(agent, Policy):
        return Evaluation(_slalom.evaluate_policy(agent._core, request))
    if not callable(agent):
        raise TypeError(f"agent is {agent!r}, expected a Policy, a planner's name or a function")
    if observation == "vector":
        import slalom
        observe = slalom.make(courses, profile=profile, collection=collection,
                              generator_seed=generator_seed, **sections)._core.observe

        def driver(ranges, state, odometry, first):
            return agent(observe(ranges, state), first)
    else:
        def driver(ranges, state, odometry, first):
            return agent({"ranges": ranges, "state": state, "odometry": odometry}, first)
    return Evaluation(_slalom.evaluate_function(driver, request))


def report(evaluations: Sequence[Evaluation | NameOrPath], output: str | os.PathLike, *,
           force: bool = False) -> str:
    """Compares evaluations as `slalom report` does and returns its tables as Markdown.

    evaluations: `Evaluation`s that were written (`Evaluation.write`), or directories of evaluations
    or of runs, in the order of the report. output: the directory that gets report.html, which opens
    without a network, report.md and report.csv. Raises `slalom.Error` if there is a report already,
    unless `force` is given, or if the evaluations cannot be compared.
    """
    paths = []
    for evaluation in evaluations:
        if isinstance(evaluation, Evaluation):
            if evaluation.directory is None:
                raise _slalom.Error("an evaluation was not written, expected evaluation.write("
                                    "DIRECTORY) first: the report reads its files")
            evaluation = evaluation.directory
        paths.append(os.fspath(evaluation))
    if not paths:
        raise _slalom.Error("evaluations: found none, expected one or more")
    if not force and os.path.exists(os.path.join(output, "report.html")):
        raise _slalom.Error(f"{output}: holds a report already; choose another directory, or replace "
                            f"it with force=True")
    return _slalom.report(paths, os.fspath(output))
