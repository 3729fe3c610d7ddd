"""The package beside the real Gymnasium: its own checkers, its registry and its classes."""

import subprocess
import sys
import unittest
import warnings

import gymnasium
import numpy as np
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import slalom

COURSES = "static-train-5"


class GymnasiumTest(unittest.TestCase):
    def test_check_env_finds_nothing(self):
        for observation in "frame", "vector":
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                # Not errors: infinite bounds of a goal that may be anywhere.
                warnings.filterwarnings("ignore", message=".*infinity.*")
                check_env(slalom.make(COURSES, observation=observation), skip_render_check=True)

    def test_classes_are_gymnasiums(self):
        self.assertIsInstance(slalom.make(COURSES), gymnasium.Env)
        environments = slalom.make_vec(COURSES, num_envs=2)
        self.assertIsInstance(environments, gymnasium.vector.VectorEnv)
        self.assertIs(environments.metadata["autoreset_mode"], AutoresetMode.SAME_STEP)
        self.assertIsInstance(environments.observation_space, gymnasium.spaces.Dict)
        self.assertEqual(environments.single_action_space, gymnasium.spaces.Box(-1, 1, (2,)))

    def test_is_registered(self):
        environment = gymnasium.make("slalom/Static-v0", courses=COURSES)
        environment.reset(seed=1)
        environments = gymnasium.make_vec("slalom/Static-v0", num_envs=3, courses=COURSES)
        self.assertEqual(environments.num_envs, 3)
        observations, _ = environments.reset(seed=1)
        self.assertTrue(environments.observation_space.contains(observations))

    def test_follows_gymnasiums_own_vector_environment(self):
        """SyncVectorEnv makes of single environments what the vector environment does itself."""
        for mode in AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP:
            ours = slalom.make_vec(COURSES, num_envs=3, autoreset_mode=mode)
            theirs = SyncVectorEnv([lambda: slalom.make(COURSES)] * 3, autoreset_mode=mode)
            self.assertEqual(ours.observation_space, theirs.observation_space)
            self.assertEqual(ours.action_space, theirs.action_space)
            found, _ = ours.reset(seed=5)
            expected, _ = theirs.reset(seed=5)
            random = np.random.default_rng(1)
            num_ended = 0
            for _ in range(150):
                for key in "ranges", "state":
                    np.testing.assert_array_equal(found[key], expected[key])
                actions = random.uniform(-0.2, 1, (3, 2)).astype(np.float32)
                found, *results, infos = ours.step(actions)
                expected, *wanted, their_infos = theirs.step(actions)
                for a, b in zip(results, wanted):
                    np.testing.assert_array_equal(a, b)
                ended = results[1] | results[2]
                num_ended += ended.sum()
                if mode == AutoresetMode.SAME_STEP and ended.any():
                    np.testing.assert_array_equal(infos["_final_obs"], their_infos["_final_obs"])
                    np.testing.assert_array_equal(infos["_final_info"], their_infos["_final_info"])
                    for i in np.flatnonzero(ended):
                        theirs_of_i = their_infos["final_obs"]
                        last = (theirs_of_i[i]["ranges"] if isinstance(theirs_of_i, np.ndarray)
                                else theirs_of_i["ranges"][i])
                        np.testing.assert_array_equal(infos["final_obs"]["ranges"][i], last)
                        self.assertEqual(infos["final_info"]["outcome"][i],
                                         their_infos["final_info"]["outcome"][i])
            self.assertGreater(num_ended, 5)

    def test_pictures_are_recorded(self):
        environment = gymnasium.make("slalom/Static-v0", courses=COURSES, render_mode="rgb_array")
        recorded = gymnasium.wrappers.RenderCollection(environment)
        recorded.reset(seed=1)
        recorded.step(np.zeros(2, np.float32))
        self.assertEqual([picture.shape for picture in recorded.render()], [(400, 400, 3)] * 2)

    def test_statistics_are_right_in_every_episode(self):
        for mode in "SameStep", "NextStep":
            environments = gymnasium.wrappers.vector.RecordEpisodeStatistics(
                slalom.make_vec(COURSES, num_envs=3, autoreset_mode=mode, episode={"max_steps": 20}))
            environments.reset(seed=3)
            random, num_ended = np.random.default_rng(0), 0
            for _ in range(150):
                *_, infos = environments.step(random.uniform(-0.2, 1, (3, 2)).astype(np.float32))
                for i in np.flatnonzero(infos.get("_final_info", ())):
                    num_ended += 1
                    final = {key: infos["final_info"][key][i] for key in ("length", "return")}
                    self.assertEqual(infos["episode"]["l"][i], final["length"], mode)
                    self.assertAlmostEqual(infos["episode"]["r"][i], final["return"], places=4)
            self.assertGreater(num_ended, 12)

    def test_wrappers_of_observations_take_the_autoreset_of_the_manual(self):
        wrappers = gymnasium.wrappers.vector
        flat = wrappers.FlattenObservation(slalom.make_vec(COURSES, num_envs=2, autoreset_mode="NextStep"))
        self.assertEqual(flat.reset(seed=1)[0].shape, (2, 724))
        with self.assertRaisesRegex(Exception, "NEXT_STEP"):
            wrappers.FlattenObservation(slalom.make_vec(COURSES, num_envs=2))
        wrappers.ClipReward(wrappers.NormalizeReward(slalom.make_vec(COURSES, num_envs=2)), -1, 1).reset(seed=1)

    def test_earlier_versions_are_warned_of_and_their_wrappers_refuse(self):
        program = """
import warnings, gymnasium
gymnasium.__version__ = "1.2.3"
with warnings.catch_warnings(record=True) as caught:
    import slalom
print(*[warning.message for warning in caught])
environments = slalom.make_vec("static-train-5", num_envs=1)
environments.reset(seed=1)
try:
    gymnasium.wrappers.vector.RecordEpisodeStatistics(environments)
except (AssertionError, TypeError):
    print("refused")
"""
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        self.assertRegex(done.stdout, "found Gymnasium 1.2.3, expected 1.4 or later")
        self.assertRegex(done.stdout, "refused")


if __name__ == "__main__":
    unittest.main(verbosity=1)
