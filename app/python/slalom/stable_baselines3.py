"""The simulator for Stable-Baselines3, which has a vector interface of its own."""

import numpy as np
from stable_baselines3.common.vec_env import VecEnv


class StableBaselinesEnvironment(VecEnv):
    """Makes a VecEnv of what `slalom.make_vec(..., observation="vector")` returns, with autoreset in
    the same step, as Stable-Baselines3 wants it:

        environments = slalom.make_vec("static-train-50", num_envs=16, observation="vector")
        model = stable_baselines3.TD3("MlpPolicy", StableBaselinesEnvironment(environments))
    """

    def __init__(self, environments):
        if not environments.resets_in_the_same_step:
            raise ValueError('expected environments with autoreset_mode="SameStep"')
        self.environments = environments
        super().__init__(environments.num_envs, environments.single_observation_space,
                         environments.single_action_space)

    def reset(self):
        seeds = None if None in self._seeds else [int(seed) for seed in self._seeds]
        observations, _ = self.environments.reset(seed=seeds)
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
            final, last = infos["final_info"], infos["final_obs"]
            of_each[i] = {
                "terminal_observation": ({key: rows[i] for key, rows in last.items()}
                                         if isinstance(last, dict) else last[i]),
                "TimeLimit.truncated": bool(truncations[i]),
                "is_success": bool(final["outcome"][i] == "success"),
                "episode": {"r": float(final["return"][i]), "l": int(final["length"][i])},
            }
        return observations, rewards.astype(np.float32), ended, of_each

    def close(self):
        """Does nothing: memory is released with the environments."""

    def get_attr(self, attr_name, indices=None):
        return [getattr(self.environments, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name, value, indices=None):
        raise NotImplementedError("the settings of an environment cannot be changed")

    def env_method(self, method_name, *args, indices=None, **kwargs):
        raise NotImplementedError("a single environment has no methods of its own")

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False] * len(list(self._get_indices(indices)))
