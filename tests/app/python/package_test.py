"""Tests of the Python package, with and without Gymnasium."""

import inspect
import os
import subprocess
import sys
import threading
import unittest

import numpy as np

import slalom

ROOT = os.path.join(os.path.dirname(__file__), "..", "..", "..")
COURSES = "static-train-5"


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
        import tempfile
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
        import tempfile
        with tempfile.NamedTemporaryFile() as file:
            with open(self.path, "rb") as whole:
                file.write(whole.read()[:-100])
            file.flush()
            with self.assertRaisesRegex(slalom.Error, file.name):
                slalom.Policy.load(file.name)

    def test_is_scored_as_the_program_scores_it(self):
        import json
        import tempfile
        with tempfile.TemporaryDirectory() as folder:
            output = os.path.join(folder, "out")
            subprocess.run([os.environ["SLALOM_PROGRAM"], "evaluate", "--policy", self.path,
                            "--courses", COURSES, "--episodes", "4", "--output", output],
                           check=True, capture_output=True)
            with open(os.path.join(output, "evaluation.json"), encoding="utf8") as file:
                expected = json.load(file)
            as_policy = slalom.evaluate(self.policy, COURSES, episodes=4)
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


class ReadTest(unittest.TestCase):
    def rows(self, directory, table):
        found = slalom.read(directory, table)
        return found if isinstance(found, list) else found.to_dict("records")

    def test_reads_back_what_was_written(self):
        import tempfile
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
        import tempfile
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

    def test_passes_errors_on(self):
        def broken(observation, first):
            raise KeyError("mine")

        with self.assertRaisesRegex(KeyError, "mine"):
            slalom.evaluate(broken, COURSES, episodes=1)
        with self.assertRaisesRegex(slalom.Error, "actions: its shape"):
            slalom.evaluate(lambda seen, first: np.zeros(3), COURSES, episodes=1)
        with self.assertRaisesRegex(slalom.Error, "protocol"):
            slalom.evaluate(broken, COURSES, protocol="mine")


if __name__ == "__main__":
    unittest.main(verbosity=1)
