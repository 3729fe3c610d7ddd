"""Holds comparisons of committed results against rliable (Agarwal et al. 2021): interquartile means, probabilities of
improvement and intervals. `./slalom test --part python` runs it.

rliable_test.py PROGRAM SOURCE"""

import glob
import json
import os
import re
import subprocess
import sys
import tempfile
import unittest

import numpy as np
from rliable import library, metrics
from scipy import stats

PROGRAM, SOURCE = sys.argv[1], sys.argv[2]
SCORES = ("home", "fresh", "mujoco")


def run(*arguments):
    done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"{arguments}: {done.stderr}")


class Study:
    """The groups of a plan's report, and the success rates that they are made of."""

    def __init__(self, store, *options):
        plan = os.path.join(SOURCE, "configs/sweeps/robust.toml")
        run("sweep", "report", plan, "--output", store, *options)
        with open(glob.glob(os.path.join(store, "plans/*/report.html"))[0], encoding="utf8") as file:
            data = re.search(r'id="data">(.*?)</script>', file.read(), re.DOTALL).group(1)
        self.groups = {score["name"]: score["group"] for score in json.loads(data)["scores"]}

    @staticmethod
    def scores(agent):
        """[seed][course]"""
        rows = []
        for path in agent["files"]:
            with open(path, encoding="utf8") as file:
                courses = json.load(file)["courses"]
            rows.append([np.mean([outcome[0] == "s" for outcome in course["outcomes"]]) for course in courses])
        return np.array(rows)


class RliableTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        store = os.path.join(cls.scratch.name, "store")
        run("sweep", "import", os.path.join(SOURCE, "docs/results/robust.jsonl.xz"), "--output", store)
        cls.all_seeds = Study(store)
        cls.one_seed = Study(store, "--set", "sweep.seeds=[1]")

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def test_interquartile_means_and_probabilities_of_improvement_are_equal(self):
        for name in SCORES:
            group = self.all_seeds.groups[name]
            tables = [Study.scores(agent) for agent in group["agents"]]
            self.assertGreater(min(len(table) for table in tables), 1, "several seeds")
            for agent, table in zip(group["agents"], tables):
                figures = agent["figures"]
                self.assertAlmostEqual(figures["success_rate"]["estimate"][0], metrics.aggregate_mean(table), 9)
                self.assertAlmostEqual(figures["success_rate_iqm"]["estimate"][0], metrics.aggregate_iqm(table), 9)
            self.assertGreater(len(group["pairs"]), 0)
            for pair in group["pairs"]:
                expected = metrics.probability_of_improvement(tables[pair["first"]], tables[pair["second"]])
                self.assertAlmostEqual(pair["improvement"][0], expected, 9)

    def test_intervals_over_courses_are_stretched_percentiles(self):
        # With one seed, courses alone are drawn. They are rliable's runs of one task. What is left is the noise of 2000
        # resamples and the grain of success rates.
        np.random.seed(1)
        for name in SCORES:
            for agent in self.one_seed.groups[name]["agents"]:
                scores = Study.scores(agent).T
                n = len(scores)
                stretch = stats.t.ppf(0.975, n - 1) / stats.norm.ppf(0.975) * np.sqrt(n / (n - 1))
                for key, aggregate in (("success_rate", metrics.aggregate_mean), ("success_rate_iqm", metrics.aggregate_iqm)):
                    value, *ends = agent["figures"][key]["estimate"]
                    if ends[0] is None:
                        continue
                    bounds = library.get_interval_estimates(
                        {"agent": scores}, lambda table: np.array([aggregate(table)]), reps=20000)[1]["agent"][:, 0]
                    tolerance = 0.06 * (bounds[1] - bounds[0]) + 0.001
                    for end, bound in zip(ends, bounds):
                        expected = np.clip(value + stretch * (bound - value), 0.0, 1.0)
                        self.assertLess(abs(end - expected), tolerance, f"{name} {agent['label']} {key}")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
