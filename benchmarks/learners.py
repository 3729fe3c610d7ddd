"""Other people's learners on Slalom's courses: how much processor time and how many steps they need to drive.

    learners.py sb3-td3|sb3-sac|td3 DIRECTORY [--cpu-minutes M] [--seed S] [--environments N]

sb3-td3 and sb3-sac are Stable-Baselines3's with its own settings, td3 is td3.py beside this file. Each sees what the network of
configs/fast.toml does, the nearest range of 72 sectors and the state, and trains on one core, on static-train-250. Every minute it
drives the validation courses; that time does not count, and neither does that of other programs: the clock is the processor time of
this process. DIRECTORY gets the score on static-test, as `slalom report` reads it, and curve.csv.
"""

import argparse
import os
import time

os.environ["OMP_NUM_THREADS"] = "1"

import gymnasium  # noqa: E402
import numpy as np  # noqa: E402
import torch  # noqa: E402

import slalom  # noqa: E402

LEVELS = 65, 90, 95
SECONDS = 60  # Between evaluations.
SECTORS = 72


def features(observation):
    """[B, 76] float32, as docs/networks.md has them."""
    ranges, state = observation["ranges"], observation["state"]
    nearest_m = ranges.reshape(len(ranges), SECTORS, -1).min(2).astype(np.float32) / 100
    return np.concatenate([0.6 / (nearest_m + 0.2) - 0.8, state / np.float32([5, 5, 1, 1]) - np.float32([1, 0, 0, 0])], 1)


class Featured:
    """Vector environments whose observations are `features`."""

    def __init__(self, environments):
        self.environments = environments
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (SECTORS + 4,), np.float32)

    def __getattr__(self, name):
        return getattr(self.environments, name)

    def reset(self, **arguments):
        observations, infos = self.environments.reset(**arguments)
        return features(observations), infos

    def step(self, actions):
        observations, *results, infos = self.environments.step(actions)
        if "final_obs" in infos:
            infos["final_obs"] = features(infos["final_obs"])
        return features(observations), *results, infos


def sb3(algorithm, environments, seed):
    """Returns a function that trains until another is true, and one that acts."""
    import stable_baselines3
    from slalom.stable_baselines3 import StableBaselinesEnvironment
    from stable_baselines3.common.callbacks import BaseCallback

    class Until(BaseCallback):
        def _on_step(self):
            return not self.is_over()

    until = Until()
    model = getattr(stable_baselines3, algorithm)("MlpPolicy", StableBaselinesEnvironment(environments), seed=seed,
                                                  device="cpu", learning_starts=10_000)

    def train(is_over):
        until.is_over = is_over
        model.learn(2**40, callback=until, reset_num_timesteps=False)
        return model.num_timesteps

    return train, lambda observations, first: model.predict(observations, deterministic=True)[0]


def ours(environments, seed):
    from td3 import TD3
    learner = TD3(environments, seed)

    def train(is_over):
        while not is_over():
            learner.step()
        return learner.num_steps

    return train, lambda observations, first: learner.act(observations)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("learner", choices=["sb3-td3", "sb3-sac", "td3"])
    parser.add_argument("directory")
    parser.add_argument("--cpu-minutes", type=float, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--environments", type=int, default=16)
    options = parser.parse_args()
    torch.set_num_threads(1)
    environments = Featured(slalom.make_vec("static-train-250", num_envs=options.environments))
    train, act = (ours(environments, options.seed) if options.learner == "td3" else
                  sb3(options.learner[4:].upper(), environments, options.seed))
    os.makedirs(options.directory)

    def drive(observation, first):
        return act(features(observation), first)

    reached = {}
    with open(os.path.join(options.directory, "curve.csv"), "w", encoding="utf8") as curve:
        print("cpu_seconds,steps,success_rate", file=curve, flush=True)
        spent = 0.0
        while spent < 60 * options.cpu_minutes:
            begin = time.process_time()
            steps = train(lambda: time.process_time() - begin >= SECONDS)
            spent += time.process_time() - begin
            success = slalom.evaluate(drive, "static-validation", episodes=2).success_rate
            print(f"{spent:.0f},{steps},{success}", file=curve, flush=True)
            print(f"{spent / 60:5.1f} minutes, {steps:,} steps: {100 * success:.1f} %", flush=True)
            for level in LEVELS:
                if 100 * success >= level:
                    reached.setdefault(level, f"{level} % after {spent / 60:.0f} min and {steps:,} steps")
    print("; ".join(reached.values()) or f"below {LEVELS[0]} %")
    scores = slalom.evaluate(drive, "static-test", name=options.learner)
    scores.write(options.directory)
    print(scores)


if __name__ == "__main__":
    main()
