"""An environment of one's own trains over the service: actors in Python, replay server and learner as programs."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import numpy as np

import slalom

try:
    import gymnasium
except ImportError:
    gymnasium = None

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..", ".."))

CONFIG = """
[run]
name = "own"
updates_per_step = 0.5
learning_starts = 1000
max_steps = {max_steps}
max_seconds = 0.0

[task]
observation_size = {observation_size}
action_low = [-{action}]
action_high = [{action}]

[actor]
num_environments = 4
noise_min = 0.1
noise_max = 0.4
warmup_steps = 1000

[network]
encoder_layers = []
head_layers = [64, 64]

[learner]
actor_learning_rate = 1e-3
critic_learning_rate = 1e-3
gamma = {gamma}
n_step = 1
reward_scale = {reward_scale}

[service]
replay = "tcp://127.0.0.1:{replay}"
learner = "tcp://127.0.0.1:{learner}"
state = "{state}"

[replay_server]
window_bytes = 65536

[learner_service]
exit_when_finished = true
{more}
"""


class Pendulum:
    """Gymnasium's Pendulum-v1, for where Gymnasium is not installed."""

    def reset(self, *, seed=None, options=None):
        random = np.random.default_rng(seed)
        self.angle, self.speed, self.steps = random.uniform(-np.pi, np.pi), random.uniform(-1, 1), 0
        return self._observation(), {}

    def step(self, action):
        angle = (self.angle + np.pi) % (2 * np.pi) - np.pi
        cost = angle**2 + 0.1 * self.speed**2 + 0.001 * float(action[0])**2
        self.speed = np.clip(self.speed + (15 * np.sin(self.angle) + 3 * float(action[0])) * 0.05, -8, 8)
        self.angle += self.speed * 0.05
        self.steps += 1
        return self._observation(), -cost, False, self.steps == 200, {}

    def _observation(self):
        return np.array([np.cos(self.angle), np.sin(self.angle), self.speed], np.float32)


class Watched(Pendulum):
    """Counts the steps of all of them, and costs 1 in each."""

    num_steps = 0
    reached = threading.Event()  # As many steps as `wanted`.
    wanted = 0

    @classmethod
    def await_steps(cls, number):
        cls.wanted = cls.num_steps + number
        cls.reached.clear()
        if not cls.reached.wait(60):
            raise AssertionError("no steps are made")

    def step(self, action):
        result = super().step(action)
        Watched.num_steps += 1
        if Watched.num_steps >= Watched.wanted:
            self.reached.set()
        return *result[:4], {"cost": 1.0}


class Discrete:
    """A space without bounds, as Gymnasium's."""

    shape, dtype = (), np.dtype(np.int64)

    def __repr__(self):
        return "Discrete(3)"


def make_pendulum():
    return gymnasium.make("Pendulum-v1") if gymnasium else Pendulum()


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class ServiceCase(unittest.TestCase):
    """Tests with a service of their own."""

    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.state = directory.name
        self.processes = []
        self.addCleanup(self.stop)

    def config(self, max_steps=20000, observation_size=3, action=2.0, gamma=0.98, reward_scale=0.1, more=""):
        """The file of a config, by default for the pendulum."""
        path = os.path.join(self.state, "own.toml")
        with open(path, "w", encoding="utf8") as file:
            file.write(CONFIG.format(replay=free_port(), learner=free_port(), state=self.state, max_steps=max_steps,
                                     observation_size=observation_size, action=action, gamma=gamma, reward_scale=reward_scale,
                                     more=more))
        return path

    def start(self, role, config):
        with open(os.path.join(self.state, role + ".log"), "w", encoding="utf8") as log:
            process = subprocess.Popen([os.environ["SLALOM_PROGRAM"], role, "--config", config], stdout=log, stderr=log)
        self.processes.append(process)
        return process

    def stop(self):
        for process in self.processes:
            process.terminate()
        for process in self.processes:
            process.wait()

    def drive(self, actor):
        """Runs an actor in a thread, which ends with the test. Returns the thread and what it returns."""
        steps = {}
        thread = threading.Thread(target=lambda: steps.update(actor.run()))
        thread.start()
        self.addCleanup(thread.join)
        self.addCleanup(actor.stop)
        return thread, steps

    def log(self, role):
        with open(os.path.join(self.state, role + ".log"), encoding="utf8") as file:
            return file.read()

    def train(self, make, config, seconds):
        """Trains with one actor until the learner ends. Returns the policy and the returns of ten episodes that it drives."""
        self.start("replay", config)
        learner = self.start("learner", config)
        actor = slalom.Actor(make, config, name="python")
        thread, steps = self.drive(actor)
        self.assertEqual(learner.wait(seconds), 0, self.log("learner"))
        actor.stop()
        thread.join()
        self.assertGreater(steps["made"], 15000)
        self.assertEqual(steps["made"], steps["accepted"] + steps["kept"] + steps["lost"])
        self.assertEqual(steps["lost"], 0)
        policy = slalom.Policy.load(os.path.join(self.state, "learner", "policy.safetensors"))
        _, high = policy.bounds
        returns = []
        for seed in range(10):
            environment = make()
            observation, _ = environment.reset(seed=1000 + seed)
            first, total, ended = True, 0.0, False
            while not ended:
                action = policy.act(observation[None], [first])[0]
                observation, reward, terminated, truncated, _ = environment.step(high * action)
                total, first, ended = total + float(reward), False, terminated or truncated
            returns.append(total)
        return policy, returns


class ServiceTest(ServiceCase):
    def test_a_pendulum_learns_to_stand(self):
        policy, returns = self.train(make_pendulum, self.config(), 120)
        self.assertEqual(policy.bounds, (np.array([-2.0]), np.array([2.0])))
        self.assertGreater(np.mean(returns), -300.0, "a pendulum that nobody drives has about -1,200")

    def test_what_an_environment_raises_loses_no_step(self):
        class Fails(Pendulum):
            def step(self, action):
                if self.steps == 150:
                    raise RuntimeError("the motor is hot")
                return super().step(action)

        config = self.config()
        self.start("replay", config)
        self.start("learner", config)
        with self.assertRaisesRegex(RuntimeError, "the motor is hot"):
            slalom.Actor(Fails, config, name="python").run()
        actor, before = slalom.Actor(Watched, config, name="python"), Watched.num_steps
        thread, steps = self.drive(actor)
        Watched.await_steps(1000)
        actor.stop()
        thread.join()
        self.assertEqual(steps["made"], 4 * 150 + Watched.num_steps - before)
        self.assertEqual(steps["made"], steps["accepted"] + steps["kept"])
        self.assertEqual(steps["lost"], 0)

    def test_runs_again_after_a_stop(self):
        config = self.config()
        self.start("replay", config)
        self.start("learner", config)
        actor, before = slalom.Actor(Watched, config, name="python"), Watched.num_steps
        for _ in range(2):
            thread, steps = self.drive(actor)
            Watched.await_steps(500)
            actor.stop()
            thread.join()
            self.assertEqual((steps["made"], steps["lost"]), (Watched.num_steps - before, 0))
        actor.stop()  # Of the next run, which has not begun.
        self.assertEqual(actor.run()["made"], Watched.num_steps - before)

    def test_a_constraint_holds_the_sum_of_costs(self):
        """200 steps that cost 1 each, of which 50 are allowed."""
        config = self.config(max_steps=10**6, more="[constraint]\nkind = 'lagrangian'\nlimit = 50.0\n")
        self.start("replay", config)
        self.start("learner", config)
        self.drive(slalom.Actor(Watched, config, name="constrained"))
        directory = os.path.join(self.state, "learner")
        for _ in range(600):
            rows = []
            if os.path.exists(os.path.join(directory, "metrics.csv")):
                rows = slalom.read(directory, "metrics")
                rows = rows if isinstance(rows, list) else rows.to_dict("records")
            if rows and (rows[-1]["constraint_multiplier"] or 0) > 0:
                self.assertEqual(rows[-1]["constraint_violation"], 150)
                return
            time.sleep(0.1)
        self.fail(f"the multiplier stays at 0: {rows[-1:]}\n" + self.log("learner"))

    def test_sigterm_ends_it_as_a_stop_does(self):
        config = self.config()
        self.start("replay", config)
        self.start("learner", config)
        program = ("import sys\nsys.path.insert(0, sys.argv[2])\nfrom service_test import Pendulum\nimport slalom\n"
                   "actor = slalom.Actor(Pendulum, sys.argv[1])\nprint('running', flush=True)\nprint(actor.run())\n")
        actor = subprocess.Popen([sys.executable, "-B", "-c", program, config, os.path.dirname(os.path.abspath(__file__))],
                                 stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.processes.append(actor)
        self.addCleanup(actor.stdout.close)
        self.assertEqual(actor.stdout.readline(), "running\n")
        time.sleep(1)
        actor.send_signal(signal.SIGTERM)
        self.assertIn("'accepted':", actor.stdout.read())
        self.assertEqual(actor.wait(), 0)

    def test_a_config_that_does_not_fit_is_refused_by_its_key(self):
        config = self.config()
        for settings, text in (({"task": {"observation_size": 4}}, r"task\.observation_size is 4, expected .* 3"),
                               ({"task": {"observation_size": 0, "action_low": [], "action_high": []}},
                                r"task\.observation_size is 0"),
                               ({"task": {"action_low": [3.0]}}, r"task\.action_low\[0\] is 3"),
                               ({"learner": {"mirror": True}}, r"learner\.mirror: expected false")):
            with self.subTest(settings):
                with self.assertRaisesRegex(slalom.Error, text):
                    actor = slalom.Actor(Pendulum, config, **settings)
                    actor._environments[0].reset(1)
        if gymnasium:
            spaces = gymnasium.spaces
            refused = (spaces.Discrete(3), spaces.MultiDiscrete([3, 3]), spaces.MultiBinary(2), spaces.Text(3),
                       spaces.Dict(a=spaces.Box(-2, 2)), spaces.Tuple([spaces.Box(-2, 2)]),
                       spaces.Box(-2, 2, (1,), np.int64))
        else:
            refused = (Discrete(),)
        for space in refused:
            with self.assertRaisesRegex(slalom.Error, r"action_space is .*, expected a Box of floats"):
                slalom.Actor(type("Other", (Pendulum,), {"action_space": space}), config)
        if gymnasium:
            with self.assertRaisesRegex(slalom.Error, r"task\.action_high is \[1\.0\], expected .*\[2\.0\]"):
                slalom.Actor(make_pendulum, config, task={"action_high": [1.0]})

    def test_what_no_learner_can_take_is_refused_with_its_name(self):
        results = {}

        class Odd(Pendulum):
            def step(self, action):
                observation, reward, terminated, truncated, info = super().step(action)
                return (results.get("observation", observation), results.get("reward", reward), terminated, truncated,
                        results.get("info", info))

        driven = slalom.Actor(Odd, self.config())._environments[0]
        driven.reset(1)
        for name, value, text in (("reward", np.nan, "reward is nan"), ("info", {"cost": np.inf}, "cost is inf"),
                                  ("observation", {"angle": 1.0}, "observation is a dict, expected an array of 3 numbers"),
                                  ("observation", np.zeros(4), r"task\.observation_size is 3, expected .* 4")):
            results.clear()
            driven.step(np.zeros(1, np.float32))
            results[name] = value
            with self.assertRaisesRegex(slalom.Error, text):
                driven.step(np.zeros(1, np.float32))

    def test_programs_for_courses_refuse_it(self):
        config = self.config()
        for command in (["train", config], ["actor", "--config", config], ["evaluator", "--config", config]):
            done = subprocess.run([os.environ["SLALOM_PROGRAM"], *command], cwd=self.state, capture_output=True, text=True)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("task.observation_size is 3, expected 0 for slalom " + command[0], done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=1)
