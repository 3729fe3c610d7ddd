"""A training by a service on a Ray cluster of two nodes, both on this machine: a worker is killed, and in the end both sides
agree on every step."""

import faulthandler
import os
import pathlib
import re
import signal
import sys
import tempfile
import time
import unittest

import slalom

try:
    import ray
    from ray.cluster_utils import Cluster
except ImportError:
    print("SKIPPED: there is no ray")
    sys.exit(0)

import slalom.ray

PROGRAM = os.environ.get("SLALOM_PROGRAM", "")
ROOT = pathlib.Path(__file__).resolve().parents[3]
SETTINGS = ["run.updates_per_step=0.005", "run.learning_starts=2000", "run.checkpoint_seconds=1"]
ACCOUNT = r"stopped: (\d+) steps made, (\d+) accepted, (\d+) kept for the next start, (\d+) lost"


def processes(name):
    """{process: its parent} of the programs that are called so."""
    found = {}
    for each in pathlib.Path("/proc").iterdir():
        try:
            if each.name.isdigit() and f"\0--name\0{name}\0" in (each / "cmdline").read_text():
                found[int(each.name)] = int((each / "stat").read_text().rsplit(")", 1)[1].split()[1])
        except OSError:
            pass  # It has ended.
    return found


def wait_for(what, condition, limit_s=120):
    end = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"{what}: not within {limit_s} s")
        time.sleep(0.1)


@unittest.skipUnless(PROGRAM, "SLALOM_PROGRAM names no program")
class RayTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 3, "include_dashboard": False})
        cls.cluster.add_node(num_cpus=2)
        ray.init(address=cls.cluster.address, log_to_driver=False)

    @classmethod
    def tearDownClass(cls):
        ray.shutdown()
        cls.cluster.shutdown()

    def launch(self, state, *settings):
        training = slalom.ray.launch(ROOT / "configs/cluster.toml", actors=2, state=state, program=PROGRAM,
                                     settings=[*SETTINGS, *settings])
        self.addCleanup(training.stop)
        return training

    def test_a_killed_worker_comes_back_and_every_step_is_accounted_for(self):
        with tempfile.TemporaryDirectory() as scratch:
            state = pathlib.Path(scratch) / "state"
            training = self.launch(state, "run.max_steps=100000000")
            wait_for("the last actor", lambda: processes("actor-1"))
            wait_for("updates", lambda: list(state.glob("learner/checkpoints/step-[1-9]*")))
            (process, worker), = processes("actor-1").items()
            os.kill(worker, signal.SIGKILL)
            wait_for("the end of its process", lambda: process not in processes("actor-1"))
            wait_for("another one", lambda: processes("actor-1"))
            (process, worker), = processes("replay").items()
            os.kill(process, signal.SIGKILL)
            wait_for("another replay server", lambda: set(processes("replay")) - {process})
            training.stop()
            self.assertEqual(processes("actor-0") | processes("learner"), {})

            policy = self.launch(state, "run.max_steps=300000").wait()
            self.assertTrue(policy.exists())
            self.assertIn("resum", (state / "logs/learner.log").read_text())
            accepted = 0
            for name in "actor-0", "actor-1":
                made, has, kept, lost = map(int, re.findall(ACCOUNT, (state / f"logs/{name}.log").read_text())[-1])
                self.assertEqual(made, has + kept + lost, name)
                accepted += has
            server = re.findall(r"stopped with (\d+) steps accepted", (state / "logs/replay.log").read_text())[-1]
            self.assertEqual(int(server), accepted)

    def test_names_what_is_wrong(self):
        with tempfile.TemporaryDirectory() as scratch:
            with self.assertRaisesRegex(slalom.Error, "replay ended before it listened; .*logs/replay.log says why"):
                self.launch(scratch, "run.no_such_key=1")
            with self.assertRaisesRegex(slalom.Error, "nowhere/slalom: there is no such program"):
                slalom.ray.launch("x.toml", actors=1, state=scratch, program="nowhere/slalom")
            with self.assertRaisesRegex(slalom.Error, "actors is 0"):
                slalom.ray.launch("x.toml", actors=0, state=scratch, program=PROGRAM)


if __name__ == "__main__":
    faulthandler.dump_traceback_later(240, exit=True)  # Where something never comes.
    unittest.main()
