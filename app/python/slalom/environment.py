"""The simulator behind Gymnasium's interfaces."""

from __future__ import annotations

import json
import operator
import os
from collections.abc import Sequence
from typing import Any, Literal, Optional, Union

import numpy as np

from . import _slalom
from ._copies import NotCopied
from ._gymnasium import AUTORESET_MODES, Box, Dict, Env, VectorEnv, batched
from ._rendering import Painter

_OUTCOMES = np.array(["running", "success", "collision", "timeout"])
_KEYS_OUTSIDE_SECTIONS = ("randomize_share",)  # Of [environment] itself.


def _toml(value):
    """Returns a Python value as TOML."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    return json.dumps(str(value))


def _settings(sections):
    """Returns (key, TOML) for each of {"robot": {"friction": "gazebo"}, "randomize_share": 0.5, ...}."""
    settings = []
    for section, values in sections.items():
        if section in _KEYS_OUTSIDE_SECTIONS:
            settings.append((f"environment.{section}", _toml(values)))
            continue
        if not isinstance(values, dict):
            raise _slalom.Error(
                f"{section}: expected a dictionary of keys of [environment.{section}], such as "
                f"robot={{'friction': 'gazebo'}}; docs/config.md lists them")
        settings += _flat(f"environment.{section}", values)
    return settings


def _flat(prefix, values):
    """Returns (key, TOML) for each value of a dictionary and of those in it."""
    settings = []
    for key, value in values.items():
        name = f"{prefix}.{key}"
        settings += _flat(name, value) if isinstance(value, dict) else [(name, _toml(value))]
    return settings


def _seed(value, name):
    """Returns a seed as an int. Raises if it is none that the simulator takes."""
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{name} is {value!r}, expected a whole number") from None
    if not 0 <= number < 2**64:
        raise _slalom.Error(f"{name} is {number}, expected a number from 0 to 2**64 - 1")
    return number


def _core(courses, num_envs, profile, sections, collection, generator_seed, threads, autoreset,
          physics):
    profiles = [profile] if isinstance(profile, (str, os.PathLike)) else profile
    return _slalom.VectorEnvironment(
        courses=os.fspath(courses), num_envs=num_envs, profiles=[os.fspath(p) for p in profiles],
        settings=_settings(sections), collection=os.fspath(collection),
        generator_seed=_seed(generator_seed, "generator_seed"), threads=threads, autoreset=autoreset, physics=physics)


def _layout(observation, sections):
    """Returns the form of observations and the sections of the task, of which one may be given as the form."""
    if isinstance(observation, dict):
        return "frame", {**sections, "observation": observation}
    return observation, sections


def _spaces(core, observation):
    """Returns the spaces of one environment: of observations and of actions."""
    n = core.num_beams
    bound = np.array(core.state_bounds, np.float32)
    if observation == "vector":
        seen = Box(-np.inf, np.inf, (n + bound.size,), np.float32)
    elif observation == "frame":
        seen = Dict({
            "ranges": Box(0, int(np.ceil(core.range_clip_cm)), (n,), np.uint16),
            "state": Box(-bound, bound, dtype=np.float32)
        })
    else:
        raise _slalom.Error(f"observation is {observation!r}, expected 'frame' or 'vector'")
    return seen, Box(-1.0, 1.0, (2,), np.float32)


def _course_number(core, course):
    """Returns the number of a course, which may be given by its name; None of None."""
    if course is None:
        return None
    names = core.course_names
    if isinstance(course, str):
        if course not in names:
            raise _slalom.Error(f"course: found {course!r}, expected one of {names}")
        return names.index(course)
    try:
        number = operator.index(course)
    except TypeError:
        raise TypeError(f"course is {course!r}, expected a name or a number") from None
    if not 0 <= number < len(names):
        raise _slalom.Error(f"course {number}: expected a number from 0 to {len(names) - 1}")
    return number


def _episode_seed(seed):
    return None if seed is None else _seed(seed, "episode_seed")


def _system_seeds(size):
    return [int(seed) for seed in np.random.SeedSequence().generate_state(size, np.uint64)]


def _options(options, known):
    options = dict(options or {})
    for key in options:
        if key not in known:
            raise _slalom.Error(f"options: found {key!r}, expected {' or '.join(known)}")
    return options


class _Described(NotCopied):
    """What both kinds of environments tell of themselves."""

    _painter = None
    _instead = "make another one, with the same seed if it shall drive the same episodes"

    def _set_render_mode(self, mode):
        if mode not in (None, "rgb_array"):
            raise _slalom.Error(f"render_mode is {mode!r}, expected 'rgb_array' or None")
        self.render_mode = mode

    def _picture(self, i):
        if self._painter is None:
            self._painter = Painter(self.config, self._core.range_clip_cm)
        frames = self._views["observations"]
        return self._painter.paint(frames["ranges"][i], frames["state"][i])

    @property
    def course_names(self) -> list[str]:
        """The names of the courses, in the order of their numbers."""
        return self._core.course_names

    @property
    def config(self) -> str:
        """The task as TOML: every key of [environment] with the value that is used."""
        return self._core.task


Seeds = Union[int, Sequence[Optional[int]], None]
Observations = Union[dict[str, np.ndarray], np.ndarray]
NameOrPath = Union[str, os.PathLike]


class VectorEnvironment(_Described, VectorEnv):
    """Environments that are stepped together, with Gymnasium's vector interface.

    `make_vec` makes one. An object may be used by one thread at a time; while it steps, Python's
    other threads run.

    Observations are those of `single_observation_space`, stacked:

    - "frame": {"ranges": [B, N] uint16, the LiDAR's beams from right to left in centimetres,
      clipped; "state": [B, S] float32, the goal in the robot's frame (x forward, y left) in metres
      and the last action};
    - "vector": [B, N + S] float32, the same as the paper's networks see it, around [-1, 1].

    Actions are [B, 2] float32 in [-1, 1], speed and turn rate; beyond that they are clipped.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 5, "autoreset_mode": None}
    render_mode = None
    spec = None
    closed = False

    def __init__(self, core, observation, autoreset_mode, copy, render_mode=None):
        self._core = core
        self._set_render_mode(render_mode)
        self._copy = copy
        self._vector = observation == "vector"
        self.num_envs = len(core.views()["rewards"])
        self.metadata = {**self.metadata,
                         "autoreset_mode": AUTORESET_MODES.get(_MODES[autoreset_mode],
                                                               autoreset_mode)}
        self.single_observation_space, self.single_action_space = _spaces(core, observation)
        self.observation_space = batched(self.single_observation_space, self.num_envs)
        self.action_space = batched(self.single_action_space, self.num_envs)
        self._seeded = np.zeros(self.num_envs, bool)
        self._same_step = autoreset_mode == "SameStep"
        views = core.views()
        self._frames = views["observations"]
        self._final_frames = views["final_observations"]
        self._results = [views[name] for name in ("rewards", "terminations", "truncations")]
        self._views = views

    @property
    def courses(self) -> np.ndarray:
        """The numbers of the courses that are driven now, [B]."""
        return self._views["courses"].copy()

    @property
    def resets_in_the_same_step(self) -> bool:
        """Whether autoreset is "SameStep"."""
        return self._same_step

    def poses(self) -> np.ndarray:
        """Returns the robots' true poses in their courses' frames: [B, 3], x and y in metres and
        the heading in radians. For records, not for agents."""
        return np.array([self._core.pose(i) for i in range(self.num_envs)])

    def reset(self, *, seed: Seeds = None, options: dict[str, Any] | None = None
              ) -> tuple[Observations, dict[str, Any]]:
        """Begins an episode in every environment and returns (observations, infos).

        seed: environment i draws its episodes from a stream of seed + i, or of seed[i] of a list,
        whole numbers from 0 to 2**64 - 1. The same seed, courses and actions give the same
        episodes, bit for bit. Without a seed, or where it is None, the streams go on; they begin
        with one of the system's.

        options: "course", the number or name of the course that is driven next, or one for each
        environment; "episode_seed", the seed of that episode, likewise, for `slalom evaluate`'s
        episodes; "reset_mask", [B] bool: only these environments are reset.
        """
        options = _options(options, ("course", "episode_seed", "reset_mask"))
        size = self.num_envs
        mask = np.asarray(options.get("reset_mask", np.ones(size, bool)))
        if mask.shape != (size,) or mask.dtype != bool:
            raise _slalom.Error(f"options: reset_mask is {mask.dtype} {mask.shape}, expected bool "
                                f"({size},)")
        streams = self._streams(seed)
        courses = [_course_number(self._core, course)
                   for course in self._for_each(options.get("course"), "course")]
        seeds = [_episode_seed(value)
                 for value in self._for_each(options.get("episode_seed"), "episode_seed")]
        for i in np.flatnonzero(mask).tolist():
            if streams[i] is not None:
                self._core.seed(i, streams[i])
                self._seeded[i] = True
            self._core.reset(i, courses[i], seeds[i])
        return self._observations(self._frames, self._copy), {
            "course": self.courses, "_course": mask.copy()}

    def step(self, actions: np.ndarray
             ) -> tuple[Observations, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Runs one control step of every environment.

        Returns (observations, rewards, terminations, truncations, infos). An episode that succeeds
        or collides is terminated, one whose time is up is truncated.

        With autoreset "SameStep", `infos["final_obs"]` has the last observations of the episodes
        that ended, and with any mode `infos["final_info"]` what became of them: outcome ("success",
        "collision" or "timeout"), course, length in steps and return. `infos["_final_info"]` says
        in which environments; other rows mean nothing. Without an ended episode infos is empty.
        """
        any_ended = self._core.step(actions)
        rewards, terminations, truncations = (view.copy() for view in self._results)
        infos = self._infos() if any_ended else {}
        return (self._observations(self._frames, self._copy), rewards, terminations, truncations,
                infos)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Returns a picture of each environment, as `Environment.render` does."""
        if self.render_mode is None:
            return None
        return tuple(self._picture(i) for i in range(self.num_envs))

    def _streams(self, seed):
        """Returns the seed of each environment's stream; None where it goes on."""
        size = self.num_envs
        if seed is None:
            seeds = [None] * size
        elif np.ndim(seed) > 0:
            if len(seed) != size:
                raise _slalom.Error(f"seed: found {len(seed)} numbers, expected {size}")
            seeds = [None if each is None else _seed(each, "seed") for each in seed]
        else:
            first = _seed(seed, "seed")
            _seed(first + size - 1, "the last environment's seed")
            seeds = range(first, first + size)
        if self._seeded.all():
            return seeds
        return [own if each is None and not seeded else each
                for each, seeded, own in zip(seeds, self._seeded, _system_seeds(size))]

    def _for_each(self, value, key):
        if np.ndim(value) == 0:
            return [value] * self.num_envs
        if len(value) != self.num_envs:
            raise _slalom.Error(f"options: {key} has {len(value)} elements, expected one or "
                                f"{self.num_envs}")
        return list(value)

    def _observations(self, frames, copy):
        if self._vector:
            return self._core.observe(frames["ranges"], frames["state"])
        if not copy:
            return frames
        return {"ranges": frames["ranges"].copy(), "state": frames["state"].copy()}

    def _infos(self):
        views = self._views
        ended = views["ended"].copy()
        final = {
            "outcome": _OUTCOMES[views["outcomes"]],
            "course": views["final_courses"].copy(),
            "length": views["final_lengths"].copy(),
            "return": views["final_returns"].copy(),
        }
        final.update({"_" + key: ended for key in tuple(final)})
        infos = {"final_info": final, "_final_info": ended}
        if self._same_step:
            infos["final_obs"] = self._observations(self._final_frames, self._copy)
            infos["_final_obs"] = ended
        return infos


class Environment(_Described, Env):
    """One environment, with Gymnasium's interface. `make` makes one."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 5}
    render_mode = None

    def __init__(self, core, observation, render_mode=None):
        self._core = core
        self._set_render_mode(render_mode)
        self._vector = observation == "vector"
        self.observation_space, self.action_space = _spaces(core, observation)
        self._seeded = False
        self._views = core.views()

    def pose(self) -> tuple[float, float, float]:
        """Returns the robot's true pose in the course's frame: x and y in metres, the heading in
        radians. For records, not for agents."""
        return self._core.pose(0)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None
              ) -> tuple[Observations, dict[str, Any]]:
        """Begins an episode and returns (observation, info). As `VectorEnvironment.reset`."""
        options = _options(options, ("course", "episode_seed"))
        course = _course_number(self._core, options.get("course"))
        episode_seed = _episode_seed(options.get("episode_seed"))
        if seed is not None:
            seed = _seed(seed, "seed")
        super_reset = getattr(super(), "reset", None)
        if super_reset is not None:
            super_reset(seed=seed)
        if seed is None and not self._seeded:
            seed = _system_seeds(1)[0]
        if seed is not None:
            self._core.seed(0, seed)
        self._seeded = True
        self._core.reset(0, course, episode_seed)
        return self._observation(), {"course": int(self._views["courses"][0])}

    def step(self, action: np.ndarray
             ) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Runs one control step; as `VectorEnvironment.step`, but nothing is reset."""
        ended = self._core.step(np.asarray(action, np.float32).reshape(1, -1))
        views = self._views
        info = {"outcome": str(_OUTCOMES[views["outcomes"][0]])} if ended else {}
        return (self._observation(), float(views["rewards"][0]), bool(views["terminations"][0]),
                bool(views["truncations"][0]), info)

    def render(self) -> np.ndarray | None:
        """Returns what the robot sees, [400, 400, 3] uint8, if render_mode is "rgb_array": itself in
        the middle, facing up, the LiDAR's readings in black, what they show to be free in white,
        and the goal in green, at the border if it is farther than 5.5 m."""
        return None if self.render_mode is None else self._picture(0)

    def _observation(self):
        frames = self._views["observations"]
        if self._vector:
            return self._core.observe(frames["ranges"], frames["state"])[0]
        return {"ranges": frames["ranges"][0].copy(), "state": frames["state"][0].copy()}


_MODES = {"SameStep": "SAME_STEP", "NextStep": "NEXT_STEP", "Disabled": "DISABLED"}


def _mode_name(mode):
    """Returns "SameStep" of "SameStep", "SAME_STEP" or Gymnasium's AutoresetMode.SAME_STEP."""
    text = getattr(mode, "name", None) or str(mode)
    for name, gymnasium_name in _MODES.items():
        if text in (name, gymnasium_name):
            return name
    return text


def make_vec(courses: NameOrPath = "static-train-50", num_envs: int = 64, *,
             observation: Literal["frame", "vector"] | dict[str, Any] = "frame", autoreset_mode: Any = "SameStep",
             copy: bool = True, threads: int = 1, profile: NameOrPath | Sequence[NameOrPath] = (),
             collection: NameOrPath = "", generator_seed: int = 1, physics: str = "slalom",
             render_mode: Literal["rgb_array"] | None = None,
             **sections: dict[str, Any] | float) -> VectorEnvironment:
    """Makes `num_envs` environments on a set of courses.

    courses: a set's name, "generated:SEED:COUNT", or a file (docs/courses.md).
    observation: "frame" for the LiDAR's readings and the robot's state as they are stored, or
    "vector" for the paper's numbers. A dictionary has the keys of [environment.observation], for
    frames.
    autoreset_mode: "SameStep", "NextStep" or "Disabled", or Gymnasium's AutoresetMode.
    copy: whether observations and `final_obs` are copies. If not, they are read-only views of the
    simulator's memory, which the next `step` or `reset` overwrites ("frame" only).
    threads: threads that step. They change the speed, not the episodes.
    profile: TOML files whose [environment] is laid over the defaults, such as
    "configs/real-robot.toml". Their [guard] is passed over: there is no agent to guard.
    collection, generator_seed: as in docs/courses.md.
    physics: "slalom", "ode" or "mujoco".
    render_mode: "rgb_array" for pictures of what the robots see (`render`).
    sections: the keys of [environment] (docs/config.md), for example robot={"friction": "gazebo"},
    lidar={"noise_std": 0.02}, episode={"max_steps": 200}. What is drawn for each episode is
    randomize={"robot.command_delay": [0.0, 0.12]}, in the share randomize_share=0.6 of them.

    Raises `slalom.Error`, a ValueError, which says what was found and expected.
    """
    mode = _mode_name(autoreset_mode)
    observation, sections = _layout(observation, sections)
    core = _core(courses, num_envs, profile, sections, collection, generator_seed, threads, mode,
                 physics)
    return VectorEnvironment(core, observation, mode, copy, render_mode)


def make(courses: NameOrPath = "static-train-50", *,
         observation: Literal["frame", "vector"] | dict[str, Any] = "frame",
         profile: NameOrPath | Sequence[NameOrPath] = (), collection: NameOrPath = "",
         generator_seed: int = 1, physics: str = "slalom",
         render_mode: Literal["rgb_array"] | None = None,
         **sections: dict[str, Any] | float) -> Environment:
    """Makes one environment. The arguments are those of `make_vec`."""
    observation, sections = _layout(observation, sections)
    core = _core(courses, 1, profile, sections, collection, generator_seed, 1, "Disabled", physics)
    return Environment(core, observation, render_mode)
