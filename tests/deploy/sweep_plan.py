"""The small sweep of the engines' tests: four cells, and what they must come to wherever they are run."""

import json
import pathlib

from engine import Failure, run

PRESET = """\
[run]
name = "small"
max_steps = {steps}
learning_starts = {learning_starts}
updates_per_step = {updates_per_step}
log_interval = 1.0
[courses]
train = "generated:3:2"
[actor]
num_environments = 8
warmup_steps = 100
[replay]
capacity = 4000
[network]
encoder_layers = []
head_layers = [16]
sectors = 36
[learner]
batch_size = 16
"""
PLAN = """\
[sweep]
preset = "small.toml"
seeds = [1, 2]
checkpoint_steps = 20000
[[axis]]
keys = ["learner.gamma"]
values = [0.95, 0.99]
[[score]]
name = "test"
courses = "generated:4:2"
episodes = 2
"""
CELLS = 4
LEARNING_STARTS = 500
UPDATES_PER_STEP = 0.02


def write_plan(folder, steps):
    """Writes plan.toml and its preset. Returns the plan's path."""
    folder = pathlib.Path(folder)
    (folder / "small.toml").write_text(PRESET.format(steps=steps, learning_starts=LEARNING_STARTS, updates_per_step=UPDATES_PER_STEP))
    (folder / "plan.toml").write_text(PLAN)
    return folder / "plan.toml"


def run_here(program, plan, store, environment):
    run(program, "sweep", "run", plan, "--output", store, env=environment)


def results(store):
    """{cell/file: content} of what a sweep is run for: the weights of policies, and every episode of the scores."""
    store = pathlib.Path(store)
    found = {str(path.relative_to(store)): weights(path) for path in store.glob("cells/*/run/policy.safetensors")}
    found.update((str(path.relative_to(store)), path.read_bytes()) for path in store.glob("cells/*/scores/*/evaluation-episodes.csv"))
    return found


def weights(policy):
    """A safetensors file without its metadata, which hold how long the training took."""
    header, tensors = read_policy(policy)
    del header["__metadata__"]
    return header, tensors


def read_policy(policy):
    """Header and tensors of a safetensors file."""
    content = policy.read_bytes()
    size = int.from_bytes(content[:8], "little")
    return json.loads(content[8:8 + size]), content[8 + size:]


def require_equal(store, expected, what):
    """Throws `Failure` unless a store holds these results, bit for bit."""
    found = results(store)
    if len(expected) != 2 * CELLS:
        raise Failure(f"the sweep on this machine left {sorted(expected)}, expected a policy and a score of {CELLS} cells")
    missing = sorted(expected.keys() ^ found.keys())
    if missing:
        raise Failure(f"{what}: only one of both sweeps has {', '.join(missing)}")
    other = sorted(name for name in expected if found[name] != expected[name])
    if other:
        raise Failure(f"{what}: not the same bits as on this machine: {', '.join(other)}")
