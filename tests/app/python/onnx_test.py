"""Policies as ONNX models: ONNX Runtime commands what the package, and so the C++ actor, does."""

import json
import os
import shutil
import subprocess
import tempfile
import unittest

import numpy as np
import onnxruntime

import slalom

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..", ".."))
B = 5  # Environments.

# Networks of every kind, small and odd.
NETWORKS = {
    "mlp": ["encoder_layers=[12, 9]", "sectors=0"],
    "mlp without encoder": ["encoder_layers=[]", "sectors=40", "history=3"],
    "plain features": ["range_transform=linear", "goal_transform=linear", "sectors=72"],
    "bounded goal": ["goal_transform=bounded", "sectors=72"],
    "speeds and commands": ["sectors=60", "environment.observation.speeds=true", "environment.observation.commands=3"],
    "mounting": ["sectors=60", "history=2", "environment.observation.mounting=true", "environment.action.linear_min=-0.2"],
    "time cnn": ["encoder=cnn", "encoder_layers=[11, 7]", "history=4", "sectors=60"],
    "time cnn of one frame": ["encoder=cnn", "encoder_layers=[11, 7]", "sectors=60"],
    "beam cnn": ["encoder=cnn", "cnn_axis=beams", "encoder_layers=[5, 4, 7]", "history=3", "sectors=90"],
    "beam cnn of one frame": ["encoder=cnn", "cnn_axis=beams", "encoder_layers=[5, 7]"],
    "gru": ["encoder=gru", "encoder_layers=[10, 6]", "history=4", "sectors=60"],
    "gru of one frame": ["encoder=gru", "encoder_layers=[10]", "sectors=60"],
    "transformer": ["encoder=transformer", "encoder_layers=[12, 12]", "attention_heads=3", "history=4", "sectors=60"],
    "transformer of one frame": ["encoder=transformer", "encoder_layers=[8]", "attention_heads=2", "sectors=60"],
}


def run(*arguments):
    return subprocess.run([os.environ["SLALOM_PROGRAM"], *arguments], cwd=ROOT, capture_output=True, text=True)


class OnnxTest(unittest.TestCase):
    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.directory = directory.name

    def train(self, name, *settings):
        """A policy whose parameters have moved from where they began, biases with them."""
        sets = ["run.max_seconds=0", "run.max_steps=12000", "learner.actor_learning_rate=0.01", *settings]
        done = run("train", "configs/quickstart.toml", "--no-evaluation", "--force", "--output", self.directory, "--name", name,
                   *(word for setting in sets for word in ("--set", setting)))
        self.assertEqual(done.returncode, 0, done.stderr)
        return os.path.join(self.directory, name, "policy.safetensors")

    def export(self, policy):
        model = policy.replace("safetensors", "onnx")
        done = run("export", "--policy", policy, "--onnx", model)
        self.assertEqual(done.returncode, 0, done.stderr)
        return onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])

    def check(self, path):
        """Drives a while, with episodes that begin at any time."""
        policy = slalom.Policy.load(path)
        session = self.export(path)
        shapes = {port.name: port.shape for port in session.get_inputs()}
        random = np.random.default_rng(3)
        first = np.ones(B, bool)
        frames = None
        actions = []
        for _ in range(12):
            ranges = random.integers(0, 600, (B, policy.num_beams)).astype(np.uint16)
            state = random.uniform(-1, 1, (B, policy.state_size)).astype(np.float32)
            state[:, :2] *= 8
            expected = policy.act({"ranges": ranges, "state": state}, first)
            given = {"ranges": ranges, "state": state}
            if policy.history > 1:
                if frames is None:
                    frames = np.full([B, *shapes["frames"][1:]], np.nan, np.float32)
                given |= {"frames": frames, "first": first}
            found = dict(zip([port.name for port in session.get_outputs()], session.run(None, given)))
            np.testing.assert_allclose(found["action"], expected, rtol=0, atol=1e-5)
            np.testing.assert_allclose(found["command"], policy.speeds(expected), rtol=0, atol=1e-5 * 3.14)
            frames = found.get("frames_after")
            actions.append(expected)
            first = random.random(B) < 0.2
        self.assertGreater(np.std(actions), 1e-3, "actions that do not differ tell nothing")
        self.drive_episodes(path, session)
        return session, policy

    def drive_episodes(self, path, session):
        """A robot that knows goal, speeds and mounting of simulated episodes, and its own last actions, drives them alike."""
        agent, robot = slalom.Policy.load(path), slalom.Policy.load(path)
        standstill = np.float32(json.loads(session.get_modelmeta().custom_metadata_map["standstill"]))
        np.testing.assert_array_equal(standstill, agent.standstill)
        commands = agent.task["observation"]["commands"]
        environments = slalom.make_vec("static-train-5", num_envs=1, autoreset_mode="Disabled", **agent.task)
        frames = np.zeros([1, *next((port.shape[1:] for port in session.get_inputs() if port.name == "frames"), [])], np.float32)
        for episode in range(2):
            observations, _ = environments.reset(seed=episode)
            last, first, ended = [standstill] * commands, [True], False
            for _ in range(10):
                if ended:
                    break
                expected = agent.act(observations, first)
                state = observations["state"].copy()
                state[0, 2:4] = last[0]
                for back in range(1, commands):
                    state[0, 2 * (back - commands):][:2] = last[back]
                np.testing.assert_array_equal(robot.act({"ranges": observations["ranges"], "state": state}, first), expected)
                given = {"ranges": observations["ranges"], "state": state}
                if agent.history > 1:
                    given |= {"frames": frames, "first": np.array(first)}
                found = dict(zip([port.name for port in session.get_outputs()], session.run(None, given)))
                np.testing.assert_allclose(found["action"], expected, rtol=0, atol=1e-5)
                frames = found.get("frames_after")
                last, first = [expected[0], *last[:-1]], [False]
                observations, _, terminations, truncations, _ = environments.step(expected)
                ended = terminations[0] or truncations[0]

    def test_every_network(self):
        for name, network in NETWORKS.items():
            with self.subTest(name):
                self.check(self.train("tiny", *(setting if "." in setting.split("=")[0] else f"network.{setting}" for setting in network), "network.head_layers=[9]"))

    def test_the_mode_of_a_gaussian(self):
        path = self.train("sac", "learner.algorithm=sac", "network.encoder_layers=[12]", "network.head_layers=[9]")
        self.assertEqual(slalom.Policy.load(path).weights()["head.1.weight"].shape[0], 4)
        self.check(path)

    def test_a_trained_policy_and_what_its_model_tells(self):
        session, policy = self.check(self.copy_of_trained())
        told = session.get_modelmeta().custom_metadata_map
        self.assertEqual({key: told[key] for key in policy.metadata}, policy.metadata)
        self.assertIn('"linear_max":2.0', told["slalom_policy"])

    def copy_of_trained(self):
        return shutil.copy(os.environ["SLALOM_POLICY"], os.path.join(self.directory, "policy.safetensors"))


if __name__ == "__main__":
    unittest.main(verbosity=1)
