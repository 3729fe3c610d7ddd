"""The simulator for Stable-Baselines3, which has a vector interface of its own."""

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from ._copies import NotCopied
from ._slalom import Error


class StableBaselinesEnvironment(NotCopied, VecEnv):
    """Makes a VecEnv of what `slalom.make_vec(..., observation="vector")` returns, with autoreset in
    the same step, as Stable-Baselines3 wants it:

        environments = slalom.make_vec("static-train-50", num_envs=16, observation="vector")
        model = stable_baselines3.TD3("MlpPolicy", StableBaselinesEnvironment(environments))

    `set_options` takes "course" and "episode_seed", for all environments or for each; `seed` and
    they count for the next `reset`, as in Stable-Baselines3.
    """

    _instead = "make another one, of other environments"

    def __init__(self, environments):
        if not environments.resets_in_the_same_step:
            raise Error('expected environments with autoreset_mode="SameStep"')
        if isinstance(environments.single_observation_space, dict) or hasattr(
                environments.single_observation_space, "spaces"):
            raise Error('expected environments with observation="vector": the networks of '
                        "Stable-Baselines3 take no ranges in uint16")
        self.environments = environments
        self._actions = None
        super().__init__(environments.num_envs, environments.single_observation_space,
                         environments.single_action_space)
        self.metadata = {**self.metadata, "render_fps": environments.metadata["render_fps"]}

    def reset(self):
        if len(self._options) != self.num_envs:
            raise Error(f"options: found {len(self._options)}, expected {self.num_envs}")
        known = ("course", "episode_seed")
        for options in self._options:
            for key in options:
                if key not in known:
                    raise Error(f"options: found {key!r}, expected {' or '.join(known)}")
        observations, infos = self.environments.reset(
            seed=None if all(seed is None for seed in self._seeds) else self._seeds,
            options={key: [options.get(key) for options in self._options] for key in known})
        self.reset_infos = [{"course": int(course)} for course in infos["course"]]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions):
        self._actions = actions

    def step_wait(self):
        observations, rewards, terminations, truncations, infos = self.environments.step(
            self._actions)
        ended = terminations | truncations
        of_each = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(ended):
            final = infos["final_info"]
            of_each[i] = {
                "terminal_observation": infos["final_obs"][i],
                "TimeLimit.truncated": bool(truncations[i]),
                "is_success": bool(final["outcome"][i] == "success"),
                "episode": {"r": float(final["return"][i]), "l": int(final["length"][i])},
            }
            self.reset_infos[i] = {"course": int(self.environments.courses[i])}
        return observations, rewards.astype(np.float32), ended, of_each

    def close(self):
        """Does nothing: memory is released with the environments."""

    def get_images(self):
        """Returns what each robot sees, if the environments have render_mode="rgb_array"."""
        return self.environments.render() or [None] * self.num_envs

    def get_attr(self, attr_name, indices=None):
        """Returns an attribute of the environments, which have it together."""
        return [getattr(self.environments, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name, value, indices=None):
        raise NotImplementedError(f"{attr_name} cannot be set: make other environments")

    def env_method(self, method_name, *args, indices=None, **kwargs):
        raise NotImplementedError(f"{method_name} cannot be called: environments that are stepped "
                                  f"together have no methods of their own")

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False] * len(list(self._get_indices(indices)))
