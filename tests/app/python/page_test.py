"""Runs the Python of the pages, block after block; what needs a package that is not installed is left out."""

import importlib.util
import json
import os
import re
import subprocess
import tempfile
import unittest

import numpy as np

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..", ".."))
BLOCK = re.compile(r"```python\n(.*?)```", re.S)


class PageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """The run has scores, as that of a reader."""
        policy = os.environ["SLALOM_POLICY"]
        subprocess.run([os.environ["SLALOM_PROGRAM"], "evaluate", "--policy", policy, "--courses", "static-train-5", "--episodes", "1",
                        "--output", os.path.dirname(policy), "--force"], check=True, stdout=subprocess.DEVNULL)

    def run_page(self, page):
        """The names that its code leaves."""
        with open(os.path.join(ROOT, page), encoding="utf8") as file:
            blocks = BLOCK.findall(file.read())
        names = {}
        with tempfile.TemporaryDirectory() as directory:
            model = os.path.join(directory, "policy.onnx")
            export = [os.environ["SLALOM_PROGRAM"], "export", "--policy", os.environ["SLALOM_POLICY"], "--onnx", model]
            subprocess.run(export, check=True)
            os.chdir(ROOT)
            for code in blocks:
                needed = re.findall(r"^import (gymnasium|onnxruntime)", code, re.M)
                if all(importlib.util.find_spec(package) for package in needed):
                    code = code.replace("runs/quickstart/policy.safetensors", os.environ["SLALOM_POLICY"])
                    code = code.replace("runs/quickstart", os.path.dirname(os.environ["SLALOM_POLICY"]))
                    exec(compile(code.replace("out/policy.onnx", model), page, "exec"), names)
        return names

    def test_the_package(self):
        self.assertIn("first", self.run_page("docs/python.md"))

    def check_plain_python(self, names):
        """It answers the page's two observations as `slalom act` does."""
        scan = [3.0] * 360 + [None] * 360
        lines = "".join(json.dumps({"ranges": scan, "goal": [3.0, y]}) + "\n" for y in (0.0, 2.0))
        done = subprocess.run([os.environ["SLALOM_PROGRAM"], "act", "--policy", os.environ["SLALOM_POLICY"]],
                              input=lines, capture_output=True, text=True, check=True)
        last_action = names["standstill"]
        for line, y in zip(done.stdout.splitlines(), (0.0, 2.0), strict=True):
            expected = json.loads(line)
            found, last_action = names["answer"](names["layers"], scan, (3.0, y), last_action)
            np.testing.assert_allclose(found, [expected["linear"], expected["angular"]], atol=1e-4)

    def test_a_robot(self):
        names = self.run_page("docs/robot.md")
        self.assertEqual(names["speeds"].shape, (2,))
        self.check_plain_python(names)
        if "session" in names:
            np.testing.assert_allclose(names["drive"](np.full(720, 5.0), (3.0, 0.0), first=True), names["speeds"], atol=1e-4)


if __name__ == "__main__":
    unittest.main(verbosity=1)
