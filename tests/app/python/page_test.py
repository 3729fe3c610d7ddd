"""Runs the Python of the pages, block after block; what needs a package that is not installed is left out."""

import importlib.util
import os
import re
import subprocess
import tempfile
import unittest

import numpy as np

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..", ".."))
BLOCK = re.compile(r"```python\n(.*?)```", re.S)


class PageTest(unittest.TestCase):
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
                    exec(compile(code.replace("out/policy.onnx", model), page, "exec"), names)
        return names

    def test_the_package(self):
        self.assertIn("first", self.run_page("docs/python.md"))

    def test_a_robot(self):
        names = self.run_page("docs/robot.md")
        self.assertEqual(names["speeds"].shape, (2,))
        if "session" in names:
            np.testing.assert_allclose(names["drive"](np.full(720, 5.0), (3.0, 0.0), first=True), names["speeds"], atol=1e-4)


if __name__ == "__main__":
    unittest.main(verbosity=1)
