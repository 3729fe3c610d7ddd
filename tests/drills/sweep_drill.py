#!/usr/bin/env python3
"""sweep_drill.py PROGRAM [KILLS [SEED]]: kill -9 of a sweep's workers and of their children at random moments.

Two workers share the cells. Passes if in the end every policy and every episode is, bit for bit, that of a sweep that nobody
disturbed, and nothing but results is left behind.
"""

import json
import pathlib
import random
import subprocess
import sys
import tempfile
import time

MAX_STEPS, STARTS, UPDATES_PER_STEP = 40000, 500, 0.03125

PRESET = f"""
[run]
name = "tiny"
max_steps = {MAX_STEPS}
updates_per_step = {UPDATES_PER_STEP}
learning_starts = {STARTS}
snapshot_steps = [20000]
log_interval = 0.1
[courses]
train = "static-train-5"
[actor]
num_environments = 8
[replay]
capacity = 10000
[network]
encoder_layers = []
head_layers = [64, 64]
sectors = 72
[learner]
batch_size = 64
"""

PLAN = """
[sweep]
preset = "tiny.toml"
seeds = [1, 2]
checkpoint_steps = 4000
[[axis]]
keys = ["learner.gamma"]
values = [0.9, 0.99]
[[score]]
name = "test"
courses = "generated:3:20"
episodes = 2
snapshots = true
"""


def check(condition, fault):
    if not condition:
        print(f"FAILED: {fault}")
        sys.exit(1)


class Worker:
    def __init__(self, program, directory, store):
        self.log = directory / "log.txt"
        self.process = subprocess.Popen(
            [program, "sweep", "run", "plan.toml", "--output", store, "--at-once", "1"],
            cwd=directory, stdout=subprocess.DEVNULL, stderr=self.log.open("a"))

    def children(self):
        found = subprocess.run(["ps", "--ppid", str(self.process.pid), "-o", "pid="], check=False, stdout=subprocess.PIPE, text=True)
        return [int(pid) for pid in found.stdout.split()]

    def kill(self):
        self.process.kill()
        self.process.wait()


def tensors(path):
    """A policy without what it says of the time that it took."""
    content = path.read_bytes()
    size = int.from_bytes(content[:8], "little")
    header = json.loads(content[8:8 + size])
    kept = {key: value for key, value in header.pop("__metadata__").items() if key not in ("training_s", "checksum_xxh3", "config")}
    return header, kept, content[8 + size:]


def results(store):
    """What a sweep came to, by file."""
    found = {}
    for path in sorted(store.glob("cells/*/run/**/*.safetensors")):
        found[path.relative_to(store)] = tensors(path)
    for path in sorted(store.glob("cells/*/scores/*/evaluation-episodes.csv")):
        found[path.relative_to(store)] = path.read_bytes()
    return found


def main(program, kills="10", seed="1"):
    draw = random.Random(int(seed))
    with tempfile.TemporaryDirectory(prefix="slalom-sweep-drill-") as name:
        directory = pathlib.Path(name)
        (directory / "tiny.toml").write_text(PRESET)
        (directory / "plan.toml").write_text(PLAN)
        began = time.monotonic()
        check(Worker(program, directory, "whole").process.wait() == 0, (directory / "log.txt").read_text())
        whole_s = time.monotonic() - began
        expected = results(directory / "whole")
        check(len(expected) == 4 * 4, f"4 cells with two policies and two evaluations each, found {sorted(map(str, expected))}")
        workers = [Worker(program, directory, "killed") for _ in range(2)]
        num_kills = 0
        while num_kills < int(kills):
            # About as often as the rest of the sweep takes, so that the kills fall on all of it.
            time.sleep(draw.uniform(0.0, 1.2 * whole_s / int(kills)))
            place = draw.randrange(2)
            children = workers[place].children()
            if workers[place].process.poll() is not None:
                workers[place] = Worker(program, directory, "killed")
                num_kills += 1  # It had come to the end of the sweep before this kill.
                continue
            if children and draw.random() < 0.3:
                subprocess.run(["kill", "-9", str(children[0])], check=False)
                print(f"kill {num_kills + 1}: a child of worker {place + 1}", flush=True)
            else:
                workers[place].kill()
                workers[place] = Worker(program, directory, "killed")
                print(f"kill {num_kills + 1}: worker {place + 1}", flush=True)
            num_kills += 1
        for worker in workers:
            check(worker.process.wait() == 0, worker.log.read_text())
        found = results(directory / "killed")
        check(found.keys() == expected.keys(), f"other files: {sorted(map(str, found.keys() ^ expected.keys()))}")
        for path, value in expected.items():
            check(found[path] == value, f"{path} differs")
        left = [str(p) for p in directory.glob("killed/cells/*/*") if p.name.startswith(("claim-", "beat-", "draft-", "failed"))]
        check(not left, f"left behind: {left}")
        print(f"{num_kills} kills: all {len(expected)} files are those of the undisturbed sweep ({whole_s:.0f} s)")


if __name__ == "__main__":
    main(*sys.argv[1:])
