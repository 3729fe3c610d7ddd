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

    def config(self, max_steps=20000, observation_size=3, action=2.0, gamma=0.98, reward_scale=0.1):
        """The file of a config, by default for the pendulum."""
        path = os.path.join(self.state, "own.toml")
        with open(path, "w", encoding="utf8") as file:
            file.write(CONFIG.format(replay=free_port(), learner=free_port(), state=self.state, max_steps=max_steps,
                                     observation_size=observation_size, action=action, gamma=gamma, reward_scale=reward_scale))
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
        self.addCleanup(actor.stop)
        thread.start()
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
        actor = slalom.Actor(Pendulum, config, name="python")
        thread, steps = self.drive(actor)
        time.sleep(3)
        actor.stop()
        thread.join()
        self.assertGreater(steps["made"], 4 * 150)
        self.assertEqual(steps["made"], steps["accepted"] + steps["kept"] + steps["lost"])
        self.assertLessEqual(steps["lost"], 4 * 150)

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
            with self.assertRaisesRegex(slalom.Error, r"task\.action_high is \[1\.0\], expected .*\[2\.0\]"):
                slalom.Actor(make_pendulum, config, task={"action_high": [1.0]})

    def test_programs_for_courses_refuse_it(self):
        config = self.config()
        for command in (["train", config], ["actor", "--config", config], ["evaluator", "--config", config]):
            done = subprocess.run([os.environ["SLALOM_PROGRAM"], *command], cwd=self.state, capture_output=True, text=True)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("task.observation_size is 3, expected 0 for slalom " + command[0], done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=1)
