"""Tests of the Python package, with and without Gymnasium."""

import copy
import inspect
import os
import pickle
import subprocess
import sys
import tempfile
import threading
import types
import unittest

import numpy as np

import slalom

ROOT = os.path.join(os.path.dirname(__file__), "..", "..", "..")
COURSES = "static-train-5"
GUARDED = os.path.join(ROOT, "configs", "guarded.toml")


def drive(environments, seed, steps, actions_seed=0):
    """Returns what random actions meet: every observation and result."""
    random = np.random.default_rng(actions_seed)
    observations, _ = environments.reset(seed=seed)
    seen = [observations]
    for _ in range(steps):
        actions = random.uniform(-1, 1, (environments.num_envs, 2)).astype(np.float32)
        actions[:, 0] = np.abs(actions[:, 0])
        seen.append(environments.step(actions))
    return seen


def flat(seen):
    """Returns all arrays in what `drive` returns."""
    if isinstance(seen, dict):
        return [array for key in sorted(seen) for array in flat(seen[key])]
    if isinstance(seen, (list, tuple)):
        return [array for item in seen for array in flat(item)]
    return [np.asarray(seen)]


def same(a, b):
    a, b = flat(a), flat(b)
    return len(a) == len(b) and all(np.array_equal(x, y) for x, y in zip(a, b))


class SignaturesTest(unittest.TestCase):
    def test_every_public_argument_and_result_has_a_type(self):
        functions = [slalom.make, slalom.make_vec, slalom.evaluate, slalom.read, slalom.report]
        for kind in slalom.VectorEnvironment, slalom.Environment, slalom.Policy, slalom.Evaluation, slalom.Actor:
            for name, member in vars(kind).items():
                function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
                if inspect.isfunction(function) and not name.startswith("_"):
                    functions.append(function)
        self.assertGreater(len(functions), 20)
        for function in functions:
            signature = inspect.signature(function)
            arguments = [argument for name, argument in signature.parameters.items() if name not in ("self", "cls")]
            for annotation in (signature.return_annotation, *(argument.annotation for argument in arguments)):
                self.assertIsNot(annotation, inspect.Signature.empty, function.__qualname__)


class VectorEnvironmentTest(unittest.TestCase):
    def test_has_the_documented_shapes(self):
        environments = slalom.make_vec(COURSES, num_envs=3)
        observations, infos = environments.reset(seed=1)
        self.assertEqual(observations["ranges"].shape, (3, 720))
        self.assertEqual(observations["ranges"].dtype, np.uint16)
        self.assertEqual(observations["state"].shape, (3, 4))
        self.assertTrue(environments.observation_space.contains(observations))
        self.assertEqual(infos["course"].shape, (3,))
        _, rewards, terminations, truncations, _ = environments.step(np.zeros((3, 2)))
        self.assertEqual((rewards.dtype, rewards.shape), (np.float64, (3,)))
        for flags in terminations, truncations:
            self.assertEqual((flags.dtype, flags.shape), (bool, (3,)))

    def test_is_a_function_of_its_seed(self):
        runs = [drive(slalom.make_vec(COURSES, num_envs=8), seed, 200) for seed in (3, 3, 4)]
        self.assertTrue(same(runs[0], runs[1]))
        self.assertFalse(same(runs[0], runs[2]))

    def test_fields_may_be_drawn_for_each_episode(self):
        fixed = drive(slalom.make_vec(COURSES, num_envs=4, robot={"command_delay": 0.1}), 3, 50)
        drawn = slalom.make_vec(COURSES, num_envs=4, randomize={"robot.command_delay": [0.1, 0.1]})
        self.assertIn("robot.command_delay = [0.1, 0.1]", drawn.config)
        self.assertTrue(same(drive(drawn, 3, 50), fixed))
        wide = {"robot": {"command_delay": [0, 0.3], "friction": ["cone", "gazebo"]}}
        runs = [drive(slalom.make_vec(COURSES, num_envs=4, threads=threads, randomize=wide), 3, 50)
                for threads in (1, 2)]
        self.assertTrue(same(runs[0], runs[1]))
        self.assertFalse(same(runs[0], fixed))
        never = slalom.make_vec(COURSES, num_envs=4, robot={"command_delay": 0.1}, randomize_share=0,
                                randomize={"robot.command_delay": [0, 0.3]})
        self.assertTrue(same(drive(never, 3, 50), fixed))
        both = slalom.make_vec(COURSES, num_envs=1, randomize=wide, robot={"friction": "pyramid"})
        self.assertIn("robot.friction = ['cone', 'gazebo']", both.config)
        with self.assertRaisesRegex(slalom.Error, "it is the shape of an observation"):
            slalom.make(COURSES, randomize={"lidar.num_beams": [360, 720]})

    def test_threads_and_neighbours_change_nothing(self):
        alone = slalom.make_vec(COURSES, num_envs=1)
        many = slalom.make_vec(COURSES, num_envs=16, threads=2)
        alone.reset(seed=105)
        many.reset(seed=100)  # Environment 5 has the seed 105.
        random = np.random.default_rng(0)
        for _ in range(150):
            actions = random.uniform(-0.3, 1, (16, 2)).astype(np.float32)
            one, all_ = alone.step(actions[5:6]), many.step(actions)
            np.testing.assert_array_equal(one[0]["ranges"][0], all_[0]["ranges"][5])
            for i in 1, 2, 3:
                self.assertEqual(one[i][0], all_[i][5])

    def test_no_transition_is_lost_in_the_same_step(self):
        """The same drives without autoreset give the last frames and the next first ones."""
        environments = slalom.make_vec(COURSES, num_envs=8)
        manual = slalom.make_vec(COURSES, num_envs=8, autoreset_mode="Disabled")
        environments.reset(seed=1)
        manual.reset(seed=1)
        random = np.random.default_rng(0)
        num_ended = 0
        for _ in range(200):
            actions = random.uniform(-0.2, 1, (8, 2)).astype(np.float32)
            observations, rewards, terminations, truncations, infos = environments.step(actions)
            last, *results = manual.step(actions)[:4]
            for found, expected in zip((rewards, terminations, truncations), results):
                np.testing.assert_array_equal(found, expected)
            ended = terminations | truncations
            if not ended.any():
                self.assertEqual(infos, {})
                np.testing.assert_array_equal(observations["ranges"], last["ranges"])
                continue
            num_ended += ended.sum()
            np.testing.assert_array_equal(infos["_final_obs"], ended)
            for key in "ranges", "state":
                np.testing.assert_array_equal(infos["final_obs"][key][ended], last[key][ended])
            first, _ = manual.reset(options={"reset_mask": ended})
            np.testing.assert_array_equal(observations["ranges"], first["ranges"])
        self.assertGreater(num_ended, 20)

    def test_in_the_next_step_an_ended_environment_takes_no_action(self):
        environments = slalom.make_vec(COURSES, num_envs=4, autoreset_mode="NextStep")
        same_step = slalom.make_vec(COURSES, num_envs=4)
        environments.reset(seed=1)
        first_of = {i: [] for i in range(4)}
        same_step.reset(seed=1)
        ahead = np.array([[1.0, 0.0]] * 4, np.float32)
        pending = np.zeros(4, bool)
        for _ in range(100):
            observations, rewards, terminations, truncations, infos = environments.step(ahead)
            self.assertTrue((rewards[pending] == 0).all())
            self.assertFalse((terminations | truncations)[pending].any())
            for i in np.flatnonzero(pending):
                first_of[i].append(observations["ranges"][i].copy())
            self.assertNotIn("final_obs", infos)
            pending = terminations | truncations
        expected = {i: [] for i in range(4)}
        for _ in range(100):
            observations, _, terminations, truncations, _ = same_step.step(ahead)
            for i in np.flatnonzero(terminations | truncations):
                expected[i].append(observations["ranges"][i].copy())
        for i in range(4):
            self.assertGreater(len(first_of[i]), 1)
            for found, wanted in zip(first_of[i], expected[i]):
                np.testing.assert_array_equal(found, wanted)

    def test_disabled_refuses_to_step_what_has_ended(self):
        environments = slalom.make_vec(COURSES, num_envs=1, autoreset_mode="Disabled")
        with self.assertRaisesRegex(slalom.Error, "environment 0: has no running episode"):
            environments.step(np.zeros((1, 2)))
        environments.reset(seed=1)
        with self.assertRaisesRegex(slalom.Error, "reset it first"):
            for _ in range(500):
                environments.step(np.array([[1.0, 0.0]]))

    def test_tells_how_episodes_ended(self):
        environments = slalom.make_vec(COURSES, num_envs=4, episode={"max_steps": 7})
        environments.reset(seed=1, options={"course": environments.course_names[2]})
        total = np.zeros(4)
        for step in range(7):
            _, rewards, terminations, truncations, infos = environments.step(np.zeros((4, 2)))
            total += rewards
        self.assertTrue(truncations.all() and not terminations.any())
        final = infos["final_info"]
        self.assertEqual(list(final["outcome"]), ["timeout"] * 4)
        self.assertEqual(list(final["length"]), [7] * 4)
        self.assertEqual(list(final["course"]), [2] * 4)
        np.testing.assert_array_equal(final["return"], total)

    def test_tells_of_every_episode_how_it_ended(self):
        for mode in "SameStep", "NextStep", "Disabled":
            environments = slalom.make_vec(COURSES, num_envs=3, autoreset_mode=mode, episode={"max_steps": 25})
            _, infos = environments.reset(seed=1)
            courses, totals, lengths = infos["course"], np.zeros(3), np.zeros(3, int)
            waits, num_ended = np.zeros(3, bool), 0
            random = np.random.default_rng(0)
            for _ in range(150):
                _, rewards, terminations, truncations, infos = environments.step(random.uniform(-0.2, 1, (3, 2)))
                totals += rewards
                lengths += ~waits
                ended = terminations | truncations
                for i in np.flatnonzero(ended):
                    final = {key: values[i] for key, values in infos["final_info"].items()}
                    self.assertEqual((final["return"], final["length"], final["course"]), (totals[i], lengths[i], courses[i]))
                    self.assertEqual(final["outcome"] == "timeout", truncations[i])
                num_ended += ended.sum()
                totals[ended], lengths[ended] = 0, 0
                if mode == "Disabled" and ended.any():
                    environments.reset(options={"reset_mask": ended})
                waits = ended & (mode == "NextStep")
                courses = environments.courses
            self.assertGreater(num_ended, 12)

    def test_after_a_reset_it_is_as_a_new_one(self):
        for mode in "SameStep", "NextStep":
            environments = slalom.make_vec(COURSES, num_envs=3, autoreset_mode=mode)
            # Without infos, whose rows of episodes that go on mean nothing.
            (first, *steps), (again, *as_before) = drive(environments, 5, 90), drive(environments, 5, 90)
            self.assertTrue(same(first, again))
            self.assertTrue(same([step[:4] for step in steps], [step[:4] for step in as_before]))

    def test_without_a_seed_every_environment_has_its_own(self):
        environments = slalom.make_vec(COURSES, num_envs=3)
        environments.reset(seed=[None, None, 3], options={"reset_mask": np.array([True, False, True])})
        with self.assertRaisesRegex(slalom.Error, "environment 1: has no running episode"):
            environments.step(np.zeros((3, 2)))
        for frames, _ in environments.reset(), slalom.make_vec(COURSES, num_envs=3).reset(seed=[None, None, 3]):
            self.assertEqual(len({ranges.tobytes() for ranges in frames["ranges"]}), 3)

    def test_before_the_first_reset_no_mode_steps(self):
        for mode in "SameStep", "NextStep", "Disabled":
            with self.assertRaisesRegex(slalom.Error, "environment 0: has no running episode; reset it first"):
                slalom.make_vec(COURSES, num_envs=2, autoreset_mode=mode).step(np.zeros((2, 2)))

    def test_views_are_overwritten_and_copies_are_not(self):
        for copy in True, False:
            environments = slalom.make_vec(COURSES, num_envs=2, copy=copy)
            before, _ = environments.reset(seed=1)
            kept = before["ranges"].copy()
            environments.step(np.ones((2, 2)))
            self.assertEqual(np.array_equal(before["ranges"], kept), copy)
            self.assertEqual(before["ranges"].flags.writeable, copy)

    def test_observations_are_given_by_dlpack(self):
        environments = slalom.make_vec(COURSES, num_envs=2)
        observations, _ = environments.reset(seed=1)
        for array in observations.values():
            shared = np.from_dlpack(array)
            self.assertTrue(np.shares_memory(shared, array))
            np.testing.assert_array_equal(shared, array)

    def test_views_outlive_the_environment(self):
        environments = slalom.make_vec(COURSES, num_envs=2, copy=False)
        observations, _ = environments.reset(seed=1)
        kept = observations["ranges"].copy()
        del environments
        np.testing.assert_array_equal(observations["ranges"], kept)

    def test_vector_observations_are_the_papers(self):
        frames = slalom.make_vec(COURSES, num_envs=2)
        vectors = slalom.make_vec(COURSES, num_envs=2, observation="vector")
        frame, _ = frames.reset(seed=1)
        vector, _ = vectors.reset(seed=1)
        self.assertEqual(vector.shape, (2, 724))
        # docs/original-system.md, section 1.3: 0 to 5 m become -1 to 1, a goal g becomes g/5 - 1.
        expected = np.concatenate(
            [frame["ranges"] / 100.0 * 2 / 5 - 1, frame["state"][:, :2] / 5 - 1,
             frame["state"][:, 2:]], axis=1)
        np.testing.assert_allclose(vector, expected, atol=1e-6)

    def test_other_threads_run_while_it_steps(self):
        environments = slalom.make_vec(COURSES, num_envs=256)
        environments.reset(seed=1)
        counted, done = [0], threading.Event()

        def count():
            while not done.is_set():
                counted[0] += 1

        thread = threading.Thread(target=count)
        thread.start()
        for _ in range(20):
            environments.step(np.zeros((256, 2), np.float32))
        done.set()
        thread.join()
        self.assertGreater(counted[0], 0)

    def test_every_section_of_the_task_is_a_keyword(self):
        environments = slalom.make_vec(
            COURSES, num_envs=1, robot={"friction": "gazebo"}, lidar={"num_beams": 360, "noise_std": 0},
            episode={"collision_ends": False}, reward={"collision": 8.0})
        self.assertIn('friction = "gazebo"', environments.config)
        self.assertIn("collision = 8.0", environments.config)
        self.assertEqual(environments.reset(seed=1)[0]["ranges"].shape, (1, 360))

    def test_lays_a_profile_under_keywords(self):
        profile = os.path.join(ROOT, "configs", "real-robot.toml")
        environments = slalom.make_vec(COURSES, num_envs=1, profile=profile)
        self.assertNotEqual(environments.config, slalom.make_vec(COURSES, num_envs=1).config)

    def test_passes_over_the_guard_of_a_profile(self):
        guarded = slalom.make_vec(COURSES, num_envs=1, profile=GUARDED)
        self.assertEqual(guarded.config, slalom.make_vec(COURSES, num_envs=1).config)


class RenderTest(unittest.TestCase):
    def test_shows_what_the_robot_sees(self):
        environment = slalom.make(COURSES, render_mode="rgb_array")
        environment.reset(seed=1)
        picture = environment.render()
        self.assertEqual((picture.shape, picture.dtype), ((400, 400, 3), np.uint8))
        colours = {tuple(colour) for colour in picture.reshape(-1, 3)}
        self.assertEqual(len(colours), 5, "unseen, free, readings, robot, goal")
        self.assertIsNone(slalom.make(COURSES).render())
        with self.assertRaisesRegex(slalom.Error, "render_mode is 'human', expected 'rgb_array' or None"):
            slalom.make(COURSES, render_mode="human")

    def test_ahead_is_up_and_left_is_left(self):
        from slalom._rendering import _FREE, _GOAL, _HIT, Painter
        painter = Painter(slalom.make(COURSES).config, 500)
        ranges = np.full(720, 500, np.uint16)
        ranges[430:] = 150  # A wall to the left, from ahead of the robot on.
        picture = painter.paint(ranges, np.float32([3, 3, 0, 0]))
        where = lambda x, y: tuple(picture[int(200 - x * 400 / 11), int(200 - y * 400 / 11)])
        self.assertEqual(where(3, 3), tuple(_GOAL))
        self.assertEqual(where(3, -1), tuple(_FREE))
        self.assertEqual(where(0.12, 1.5), tuple(_HIT))
        self.assertEqual(where(0.12, -1.5), tuple(_FREE))

    def test_a_vector_has_a_picture_of_each(self):
        environments = slalom.make_vec(COURSES, num_envs=3, render_mode="rgb_array")
        environments.reset(seed=1)
        pictures = environments.render()
        self.assertEqual(len(pictures), 3)
        self.assertFalse(np.array_equal(pictures[0], pictures[1]))
        environments.reset(seed=2)
        environments.render()
        environments.reset(seed=1)
        self.assertTrue(same(environments.render(), pictures))


class BadInputTest(unittest.TestCase):
    def check(self, message, *args, **kwargs):
        with self.assertRaisesRegex(slalom.Error, message) as caught:
            slalom.make_vec(*args, **kwargs)
        self.assertIsInstance(caught.exception, ValueError)

    def test_names_what_is_wrong(self):
        self.check("static-trane-50.*did you mean 'static-train-50'", "static-trane-50")
        self.check("environment.robot.fricton", COURSES, robot={"fricton": "gazebo"})
        self.check("friction.*cone, pyramid.*gazebo|friction.*cone", COURSES, robot={"friction": "ice"})
        self.check("num_beams.*2.*4096", COURSES, lidar={"num_beams": 1})
        self.check("robt", COURSES, robt={"friction": "gazebo"})
        self.check("robot: expected a dictionary", COURSES, robot=3)
        self.check("environment.randomize_share", COURSES, randomize_share=2)
        self.check("environment.randomize_share", COURSES, randomize_share={"robot": 0.5})
        self.check("num_envs is 0", COURSES, num_envs=0)
        self.check("autoreset_mode is 'Never'", COURSES, autoreset_mode="Never")
        self.check("observation is 'pixels'", COURSES, observation="pixels")
        self.check("physics", COURSES, physics="newton")
        self.check("no-such.toml", COURSES, profile="no-such.toml")

    def test_of_step_and_reset(self):
        environments = slalom.make_vec(COURSES, num_envs=2)
        environments.reset(seed=1)
        for actions, message in ((np.zeros((3, 2)), r"actions: its shape is \(3, 2\), expected \(2, 2\)"),
                                 (np.zeros(2), r"\(2,\), expected \(2, 2\)"),
                                 (np.array([[0, 0], [np.nan, 0]]), "environment 1: action is")):
            with self.assertRaisesRegex(slalom.Error, message):
                environments.step(actions)
        for options, message in (({"corse": 1}, "corse"), ({"course": 7}, "course 7: .*0 to 4"),
                                 ({"course": "x"}, "'x'"), ({"course": [1]}, "1 elements"),
                                 ({"reset_mask": [1, 0]}, "reset_mask")):
            with self.assertRaisesRegex(slalom.Error, message):
                environments.reset(options=options)
        with self.assertRaisesRegex(slalom.Error, "found 1 numbers, expected 2"):
            environments.reset(seed=[1])

    def test_of_seeds_and_numbers_is_the_same_at_every_door(self):
        one, many = slalom.make(COURSES), slalom.make_vec(COURSES, num_envs=2)
        for value, error in (-1, ValueError), (2**64, ValueError), (2**70, ValueError), (1.5, TypeError), ("1", TypeError):
            for seed in value, [3, value]:
                with self.assertRaisesRegex(error, f"seed is '?{value}"):
                    many.reset(seed=seed)
                with self.assertRaisesRegex(error, f"episode_seed is '?{value}"):
                    many.reset(options={"episode_seed": seed})
            with self.assertRaisesRegex(error, f"seed is '?{value}"):
                one.reset(seed=value)
            with self.assertRaisesRegex(error, f"episode_seed is '?{value}"):
                one.reset(options={"episode_seed": value})
            for make in slalom.make, slalom.make_vec:
                with self.assertRaisesRegex(error, f"generator_seed is '?{value}"):
                    make(COURSES, generator_seed=value)
            with self.assertRaisesRegex(error, f"generator_seed is '?{value}"):
                slalom.evaluate("dwa", COURSES, generator_seed=value)
        with self.assertRaisesRegex(slalom.Error, "the last environment's seed is 18446744073709551616"):
            many.reset(seed=2**64 - 1)
        one.reset(seed=2**64 - 1)
        for environments in one, many:
            for course, error in (1.7, TypeError), (-1, slalom.Error), ([1.7, 2], TypeError):
                with self.assertRaisesRegex(error, r"course (is )?\[?-?1"):
                    environments.reset(options={"course": course})

    def test_of_threads(self):
        for threads in -1, 0, 257:
            self.check(f"threads is {threads}, expected a number from 1 to 256", COURSES, threads=threads)
            for agent in "dwa", lambda seen, first: np.zeros((len(first), 2)):
                with self.assertRaisesRegex(slalom.Error, f"threads is {threads}, expected"):
                    slalom.evaluate(agent, COURSES, threads=threads)

    def test_of_rules_that_the_protocol_decides(self):
        for key, value, rule in ("max_steps", 5, "time_limit"), ("collision_ends", False, "protocol"):
            with self.assertRaisesRegex(slalom.Error, rf"environment\.episode\.{key}: .* use evaluation\.{rule}$"):
                slalom.evaluate("dwa", COURSES, episode={key: value})

    def test_of_agents(self):
        with self.assertRaisesRegex(TypeError, "agent is 5, expected a Policy, a planner's name or a function"):
            slalom.evaluate(5, COURSES)


class CopiesTest(unittest.TestCase):
    def test_are_refused(self):
        objects = [slalom.make(COURSES), slalom.make_vec(COURSES, num_envs=1),
                   slalom.evaluate("dwa", COURSES, episodes=1, evaluation={"time_limit": 0.2})]
        if os.environ.get("SLALOM_POLICY"):
            objects.append(slalom.Policy(os.environ["SLALOM_POLICY"]))
        for each in objects:
            for make_copy in copy.copy, copy.deepcopy, pickle.dumps:
                with self.assertRaisesRegex(TypeError, f"{type(each).__name__} objects can be neither copied nor pickled: "):
                    make_copy(each)


class EnvironmentTest(unittest.TestCase):
    def test_drives_as_the_first_of_a_vector(self):
        one, many = slalom.make(COURSES), slalom.make_vec(COURSES, num_envs=2)
        observation, info = one.reset(seed=7)
        observations, infos = many.reset(seed=7)
        self.assertEqual(info["course"], infos["course"][0])
        for _ in range(300):
            np.testing.assert_array_equal(observation["ranges"], observations["ranges"][0])
            observation, reward, terminated, truncated, info = one.step(np.array([0.5, 0.1]))
            observations, rewards, terminations, truncations, infos = many.step([[0.5, 0.1]] * 2)
            self.assertEqual((reward, terminated, truncated),
                             (rewards[0], terminations[0], truncations[0]))
            if terminated or truncated:
                self.assertEqual(info["outcome"], infos["final_info"]["outcome"][0])
                observation, info = one.reset()


class PolicyTest(unittest.TestCase):
    """Needs SLALOM_POLICY, a policy file, and SLALOM_PROGRAM."""

    def setUp(self):
        self.path = os.environ.get("SLALOM_POLICY")
        if not self.path:
            self.skipTest("SLALOM_POLICY names no policy")
        self.policy = slalom.Policy.load(self.path)

    def test_drives_as_the_program_does(self):
        """The episodes of `slalom evaluate`, driven from here, end alike."""
        import csv
        with tempfile.TemporaryDirectory() as folder:
            output = os.path.join(folder, "out")
            subprocess.run([os.environ["SLALOM_PROGRAM"], "evaluate", "--policy", self.path,
                            "--courses", COURSES, "--episodes", "4", "--output", output],
                           check=True, capture_output=True)
            with open(os.path.join(output, "evaluation-episodes.csv"), encoding="utf8") as file:
                episodes = list(csv.DictReader(file))
        environments = slalom.make_vec(
            COURSES, num_envs=len(episodes), autoreset_mode="Disabled",
            episode={"start_position_jitter": 0.05, "start_yaw_jitter": 0.05})
        observations, _ = environments.reset(seed=0, options={
            "course": [e["course"] for e in episodes],
            "episode_seed": [int(e["seed"]) for e in episodes]})
        first = np.ones(len(episodes), bool)
        outcomes, steps = [None] * len(episodes), np.zeros(len(episodes), int)
        while None in outcomes:
            actions = self.policy.act(observations, first)
            observations, _, terminations, truncations, infos = environments.step(actions)
            first = terminations | truncations
            for i in np.flatnonzero(first):
                if outcomes[i] is None:
                    outcomes[i] = infos["final_info"]["outcome"][i]
                    steps[i] = infos["final_info"]["length"][i]
            if first.any():
                observations, _ = environments.reset(options={"reset_mask": first})
        self.assertEqual(outcomes, [e["outcome"] for e in episodes])
        self.assertEqual(list(steps), [int(e["steps"]) for e in episodes])

    def test_where_an_episode_begins_it_has_forgotten_the_last(self):
        environments = slalom.make_vec(COURSES, num_envs=3, autoreset_mode="Disabled")
        drives = []
        for policy in self.policy, self.policy, slalom.Policy.load(self.path):
            observations, _ = environments.reset(seed=1)
            first, actions = np.ones(3, bool), []
            for _ in range(15):
                actions.append(policy.act(observations, first))
                observations, _, terminations, truncations, _ = environments.step(actions[-1])
                first = np.zeros(3, bool)
                if (terminations | truncations).any():
                    break
            drives.append(actions)
        self.assertGreater(len(drives[0]), 5)
        self.assertTrue(same(drives[0], drives[1]) and same(drives[0], drives[2]))

    def test_weights_are_those_of_the_network(self):
        weights = self.policy.weights()
        self.assertTrue(all(np.isfinite(array).all() for array in weights.values()))
        with self.assertRaises(ValueError):
            next(iter(weights.values()))[...] = 0

    def test_refuses_what_is_no_observation_of_it(self):
        with self.assertRaisesRegex(slalom.Error, r"ranges: its shape is \(2, 10\), expected \(2, 720\)"):
            self.policy.act({"ranges": np.zeros((2, 10), np.uint16), "state": np.zeros((2, 4))},
                            [True, True])
        with self.assertRaisesRegex(slalom.Error, "ranges: their type is float64, expected uint16"):
            self.policy.act({"ranges": np.zeros((2, 720)), "state": np.zeros((2, 4))}, [True, True])

    def test_refuses_a_damaged_file(self):
        with tempfile.NamedTemporaryFile() as file:
            with open(self.path, "rb") as whole:
                file.write(whole.read()[:-100])
            file.flush()
            with self.assertRaisesRegex(slalom.Error, file.name):
                slalom.Policy.load(file.name)

    def test_is_scored_as_the_program_scores_it(self):
        import json
        with tempfile.TemporaryDirectory() as folder:
            output = os.path.join(folder, "out")
            subprocess.run([os.environ["SLALOM_PROGRAM"], "evaluate", "--policy", self.path,
                            "--courses", COURSES, "--episodes", "4", "--output", output],
                           check=True, capture_output=True)
            with open(os.path.join(output, "evaluation.json"), encoding="utf8") as file:
                expected = json.load(file)
            as_policy = slalom.evaluate(self.policy, COURSES, episodes=4)
            for key in "training_overlap", "config", "course_set":
                self.assertEqual(as_policy.report["provenance"][key], expected["provenance"][key])
            self.assertEqual(as_policy.report["provenance"]["training_overlap"]["of"], 5)
            as_function = slalom.evaluate(lambda seen, first: self.policy.act(seen, first), COURSES,
                                          episodes=4)
            for found in as_policy, as_function:
                for key in expected:
                    if key not in ("agent", "run", "provenance"):
                        self.assertEqual(found.report[key], expected[key], key)
            as_function.write(os.path.join(folder, "mine"))
            report = subprocess.run([os.environ["SLALOM_PROGRAM"], "report", output,
                                     os.path.join(folder, "mine"), "--output",
                                     os.path.join(folder, "report")], capture_output=True, text=True)
            self.assertEqual(report.returncode, 0, report.stderr)
            with self.assertRaisesRegex(slalom.Error, "holds an evaluation already"):
                as_function.write(output)

    def test_is_guarded_as_the_program_guards_it(self):
        import json
        done = subprocess.run([os.environ["SLALOM_PROGRAM"], "evaluate", "--policy", self.path, "--courses", COURSES,
                               "--episodes", "2", "--profile", GUARDED, "--set", "guard.margin=0.2", "--json"],
                              check=True, capture_output=True, text=True)
        expected = json.loads(done.stdout)
        found = slalom.evaluate(self.policy, COURSES, episodes=2, profile=GUARDED, guard={"margin": 0.2}).report
        self.assertEqual(found["provenance"]["config"], expected["provenance"]["config"])
        self.assertEqual(found["courses"], expected["courses"])
        self.assertGreater(sum(sum(course["interventions_per_episode"]) for course in found["courses"]), 0)


class ReadTest(unittest.TestCase):
    def rows(self, directory, table):
        found = slalom.read(directory, table)
        return found if isinstance(found, list) else found.to_dict("records")

    def test_reads_back_what_was_written(self):
        scores = slalom.evaluate(lambda seen, first: np.tile([0.5, 0.0], (len(first), 1)), COURSES, episodes=2)
        with tempfile.TemporaryDirectory() as folder:
            scores.write(folder)
            with self.assertRaisesRegex(slalom.Error, "force=True"):
                scores.write(folder)
            scores.write(folder, force=True)
            episodes = self.rows(folder, "episodes")
            self.assertEqual([row["outcome"] for row in episodes], [row["outcome"] for row in scores.episodes()])
            self.assertEqual(len(self.rows(folder, "courses")), 5)
            poses = self.rows(folder, "tracks")
            self.assertEqual(len({row["course"] for row in poses}), 5)
            first = [row for row in poses if row["course"] == poses[0]["course"]]
            self.assertEqual(first[0]["time_s"], 0)
            self.assertAlmostEqual(first[1]["time_s"], 0.2)
            self.assertLess(abs(first[1]["x"] - first[0]["x"]), 0.4)
            with self.assertRaisesRegex(slalom.Error, "metrics.csv: cannot be read"):
                slalom.read(folder, "metrics")
        with self.assertRaisesRegex(slalom.Error, "table is 'scores', expected one of 'episodes'"):
            slalom.read(folder, "scores")

    def test_names_are_text_whatever_they_look_like(self):
        names = ["001", "1", "1e3", "nan", "1_0"]
        course = "start 0 0 1.57\ngoal 0 8\nbounds -3 -1 3 9\ncircle 1.8 1.5 0.2\nend\n"
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "numbers.courses")
            with open(path, "w", encoding="utf8") as file:
                file.write("slalom-courses 1\nset numbers\n" + "".join(f"course {name}\n{course}" for name in names) +
                           "checksum none\n")
            scores = slalom.evaluate("dwa", path, episodes=1, evaluation={"time_limit": 0.2})
            scores.write(folder)
            self.assertEqual([row["course"] for row in scores.episodes()], names)
            self.assertEqual([row["course"] for row in scores.courses()], names)
            for table in "episodes", "courses":
                self.assertEqual([row["course"] for row in self.rows(folder, table)], names)
            self.assertEqual({row["course"] for row in self.rows(folder, "tracks")}, set(names))
            environments = slalom.make_vec(path, num_envs=5)
            _, infos = environments.reset(options={"course": [row["course"] for row in scores.episodes()]})
            self.assertEqual(list(infos["course"]), [0, 1, 2, 3, 4])

    def test_reads_the_curves_of_a_run(self):
        if not os.environ.get("SLALOM_POLICY"):
            self.skipTest("SLALOM_POLICY names no policy")
        rows = self.rows(os.path.dirname(os.environ["SLALOM_POLICY"]), "metrics")
        self.assertGreater(rows[-1]["steps"], 90_000)

    def test_gives_data_frames_where_pandas_is(self):
        try:
            import pandas
        except ImportError:
            self.skipTest("pandas is not installed")
        self.assertIsInstance(slalom.read(os.path.dirname(os.environ["SLALOM_POLICY"]), "metrics"), pandas.DataFrame)


class EvaluateTest(unittest.TestCase):
    def test_scores_any_function(self):
        seen = []

        def straight(observation, first):
            seen.append(observation["ranges"].shape)
            return np.tile([0.5, 0.0], (len(first), 1))

        scores = slalom.evaluate(straight, COURSES, episodes=2, lidar={"num_beams": 90})
        self.assertEqual(scores.report["episodes"], 10)
        self.assertEqual(scores.report["agent"]["name"], "straight")
        self.assertEqual(len(scores.episodes()), 10)
        self.assertEqual(len(scores.courses()), 5)
        self.assertEqual(seen[0][1], 90)
        self.assertIn("5 courses x 2 episodes", str(scores))

    def test_gives_vectors_where_asked(self):
        def straight(observation, first):
            self.assertEqual(observation.shape, (len(first), 724))
            return np.zeros((len(first), 2))

        slalom.evaluate(straight, COURSES, episodes=1, observation="vector",
                        evaluation={"time_limit": 2.0})

    def test_scores_planners_and_reports_on_all(self):
        import csv
        rules = {"episodes": 1, "evaluation": {"time_limit": 10.0}}
        straight = slalom.evaluate(lambda seen, first: np.tile([0.5, 0.0], (len(first), 1)), COURSES, name="straight", **rules)
        dwa = slalom.evaluate("dwa", COURSES, threads=2, **rules)
        self.assertEqual(dwa.report["agent"], {"name": "dwa", "kind": "planner"})
        with tempfile.TemporaryDirectory() as folder:
            output = os.path.join(folder, "report")
            with self.assertRaisesRegex(slalom.Error, "was not written"):
                slalom.report([straight, dwa], output)
            straight.write(os.path.join(folder, "straight"))
            dwa.write(os.path.join(folder, "dwa"))
            tables = slalom.report([straight, os.path.join(folder, "dwa")], output)
            self.assertIn("| dwa |", tables)
            with open(os.path.join(output, "report.csv"), encoding="utf8") as file:
                self.assertEqual([row["agent"] for row in csv.DictReader(file)], ["straight", "dwa"])
            self.assertTrue(os.path.exists(os.path.join(output, "report.html")))
            with self.assertRaisesRegex(slalom.Error, "holds a report already"):
                slalom.report([straight], output)
            slalom.report([straight], output, force=True)
        self.assertEqual(slalom.evaluate("oracle", "generated:1:2", episodes=1).success_rate, 1.0)
        with self.assertRaisesRegex(slalom.Error, "rrt"):
            slalom.evaluate("rrt", COURSES)

    def test_a_planner_is_scored_as_the_program_scores_it(self):
        import json
        program = os.environ.get("SLALOM_PROGRAM")
        if not program:
            self.skipTest("SLALOM_PROGRAM names no program")
        done = subprocess.run([program, "evaluate", "--agent", "dwa", "--courses", COURSES, "--episodes", "1", "--json",
                               "--set", "evaluation.time_limit=10"], check=True, capture_output=True, text=True)
        expected = json.loads(done.stdout)
        found = slalom.evaluate("dwa", COURSES, episodes=1, threads=2, evaluation={"time_limit": 10.0})
        for key in expected:
            if key != "provenance":
                self.assertEqual(found.report[key], expected[key], key)

    def test_guards_any_agent(self):
        def straight(observation, first):
            return np.tile([1.0, 0.0], (len(first), 1))

        def score(**settings):
            return slalom.evaluate(straight, COURSES, episodes=2, evaluation={"time_limit": 10.0}, **settings)

        alone = score()
        self.assertGreater(alone.report["collision_rate"], 0.5)
        shielded = score(guard={"shield": True, "margin": 0.06})
        self.assertEqual(shielded.report["collision_rate"], 0.0)
        self.assertEqual(shielded.report["agent"]["name"], "straight, guarded")
        self.assertGreater(sum(episode["interventions"] for episode in shielded.episodes()), 0)
        guarded = score(guard=True)
        self.assertEqual(score(profile=GUARDED).report["courses"], guarded.report["courses"])
        self.assertEqual(score(profile=GUARDED, guard={"margin": 0.06, "waypoints": False}).report["courses"],
                         shielded.report["courses"])
        self.assertEqual(score(profile=GUARDED, guard=False).report["courses"], alone.report["courses"])
        with self.assertRaisesRegex(slalom.Error, "guard.margin is 0.1, expected its default 0.05"):
            score(guard={"margin": 0.1})
        with self.assertRaisesRegex(slalom.Error, "guard.shiel.*did you mean 'guard.shield'"):
            score(guard={"shiel": True})
        with self.assertRaisesRegex(TypeError, "guard is 5, expected True, False or a dictionary"):
            score(guard=5)

    def test_passes_errors_on(self):
        def broken(observation, first):
            raise KeyError("mine")

        with self.assertRaisesRegex(KeyError, "mine"):
            slalom.evaluate(broken, COURSES, episodes=1)
        with self.assertRaisesRegex(slalom.Error, "actions: its shape"):
            slalom.evaluate(lambda seen, first: np.zeros(3), COURSES, episodes=1)
        with self.assertRaisesRegex(slalom.Error, "protocol"):
            slalom.evaluate(broken, COURSES, protocol="mine")


class StubVecEnv:
    """What `slalom.stable_baselines3` uses of Stable-Baselines3 2.4.1, for where that is not installed."""

    def __init__(self, num_envs, observation_space, action_space):
        self.num_envs, self.observation_space, self.action_space = num_envs, observation_space, action_space
        self.reset_infos = [{} for _ in range(num_envs)]
        self._reset_seeds()
        self._reset_options()
        self.render_mode = self.get_attr("render_mode")[0]
        self.metadata = {}

    def _reset_seeds(self):
        self._seeds = [None] * self.num_envs

    def _reset_options(self):
        self._options = [{} for _ in range(self.num_envs)]

    def seed(self, seed):
        self._seeds = [seed + i for i in range(self.num_envs)]

    def set_options(self, options):
        self._options = copy.deepcopy([options] * self.num_envs if isinstance(options, dict) else options)

    def _get_indices(self, indices):
        return range(self.num_envs) if indices is None else [indices] if isinstance(indices, int) else indices

    def step(self, actions):
        self.step_async(actions)
        return self.step_wait()


class StableBaselinesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        try:
            import stable_baselines3
        except ImportError:
            for name in "stable_baselines3", "stable_baselines3.common", "stable_baselines3.common.vec_env":
                sys.modules[name] = types.ModuleType(name)
            sys.modules[name].VecEnv = StubVecEnv
        from slalom.stable_baselines3 import StableBaselinesEnvironment
        cls.adapter = StableBaselinesEnvironment

    def make(self, **settings):
        return self.adapter(slalom.make_vec(COURSES, num_envs=3, **{"observation": "vector", **settings}))

    def test_seeds_and_options_are_those_of_the_next_reset(self):
        adapted, plain = self.make(), slalom.make_vec(COURSES, num_envs=3, observation="vector")
        named = plain.course_names[2]
        for options, expected in (({}, {}), ({"course": 3}, {"course": 3}), ({}, {}),
                                  ([{"course": 1}, {}, {"course": named, "episode_seed": 7}],
                                   {"course": [1, None, named], "episode_seed": [None, None, 7]})):
            adapted.seed(5)
            adapted.set_options(options)
            observations, infos = plain.reset(seed=5, options=expected)
            np.testing.assert_array_equal(adapted.reset(), observations)
            self.assertEqual([info["course"] for info in adapted.reset_infos], list(infos["course"]))
        for options, text in (({"nonsense": 1}, "nonsense"), ([{}, {}], "found 2, expected 3"),
                              ({"reset_mask": [True] * 3}, "reset_mask"), ({"course": 9}, "course 9")):
            adapted.set_options(options)
            with self.assertRaisesRegex(slalom.Error, text):
                adapted.reset()

    def test_tells_of_every_episode(self):
        adapted = self.make(episode={"max_steps": 15})
        runs = []
        for _ in range(2):
            adapted.seed(1)
            seen, totals, lengths, num_ended = [adapted.reset()], np.zeros(3, np.float64), np.zeros(3, int), 0
            random = np.random.default_rng(0)
            for _ in range(80):
                observations, rewards, ended, infos = adapted.step(random.uniform(-0.2, 1, (3, 2)).astype(np.float32))
                seen.append((observations, rewards, ended))
                totals, lengths = totals + rewards, lengths + 1
                for i in np.flatnonzero(ended):
                    self.assertAlmostEqual(infos[i]["episode"]["r"], totals[i], places=4)
                    self.assertEqual(infos[i]["episode"]["l"], lengths[i])
                    self.assertEqual(infos[i]["terminal_observation"].shape, (724,))
                    self.assertEqual(adapted.reset_infos[i], {"course": adapted.environments.courses[i]})
                totals[ended], lengths[ended], num_ended = 0, 0, num_ended + ended.sum()
            self.assertGreater(num_ended, 12)
            runs.append(seen)
        self.assertTrue(same(*runs))

    def test_has_pictures(self):
        adapted = self.make(render_mode="rgb_array")
        adapted.reset()
        self.assertEqual([picture.shape for picture in adapted.get_images()], [(400, 400, 3)] * 3)
        self.assertEqual((adapted.render_mode, adapted.metadata["render_fps"]), ("rgb_array", 5))
        self.assertEqual(self.make().get_images(), [None] * 3)

    def test_refuses_by_name_what_it_cannot(self):
        with self.assertRaisesRegex(slalom.Error, 'observation="vector"'):
            self.make(observation="frame")
        with self.assertRaisesRegex(slalom.Error, 'autoreset_mode="SameStep"'):
            self.make(autoreset_mode="NextStep")
        adapted = self.make()
        with self.assertRaisesRegex(NotImplementedError, "friction cannot be set"):
            adapted.set_attr("friction", 1)
        with self.assertRaisesRegex(NotImplementedError, "fly cannot be called"):
            adapted.env_method("fly")
        with self.assertRaises(AttributeError):
            adapted.get_attr("wings")
        with self.assertRaisesRegex(TypeError, "neither copied nor pickled"):
            copy.copy(adapted)


if __name__ == "__main__":
    unittest.main(verbosity=1)
