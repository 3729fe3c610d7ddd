"""Runs the Python of docs/python.md, block after block; blocks with Gymnasium where it is installed."""

import importlib.util
import os
import re
import unittest

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..", ".."))
BLOCK = re.compile(r"```python\n(.*?)```", re.S)


class PageTest(unittest.TestCase):
    def test_its_code_runs(self):
        with open(os.path.join(ROOT, "docs", "python.md"), encoding="utf8") as file:
            blocks = BLOCK.findall(file.read())
        self.assertGreater(len(blocks), 4)
        names = {}
        os.chdir(ROOT)
        for code in blocks:
            if "import gymnasium" in code and not importlib.util.find_spec("gymnasium"):
                continue
            code = code.replace("runs/quickstart/policy.safetensors", os.environ["SLALOM_POLICY"])
            exec(compile(code, "docs/python.md", "exec"), names)
        self.assertEqual(names["speeds"].shape, (2,))


if __name__ == "__main__":
    unittest.main(verbosity=1)
