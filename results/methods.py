#!/usr/bin/env python3
"""The figures of results/methods.md: trains every method and network with every seed and scores it.

results/methods.py COLLECTION [--output DIR] [--seeds 1 2 3] [--rows NAME...] [--seconds S] [--at-once N] [--set KEY=VALUE...]
                   [--validation] [--planning]

COLLECTION: the original courses, as `./slalom courses import DIR --output COLLECTION` wrote them; "" for the built-in ones.
What is there already is not made again, so a run that was interrupted goes on; `--table` only prints what is there."""

import argparse
import concurrent.futures
import csv
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "build/release/cli/slalom"

# Scenario: courses to train on, to score on, and others of the same kind; the first two again for choosing settings.
SCENARIOS = {
    "static": ("static-train-50", "static-test", "generated:2026:300", "static-train-210", "static-validation"),
    "wall": ("dynamic-wall-train", "dynamic-wall-test", "generated-wall:2026:100", "dynamic-wall-train", "generated-wall:2027:50"),
    "box": ("dynamic-box-train", "dynamic-box-test", "generated-box:2026:100", "dynamic-box-train", "generated-box:2027:50"),
}

# Among walls standing still must cost more than being hit, or nothing ever tries to get through.
WALL = ["environment.reward.collision=1", "environment.reward.slack=0.02", "learner.gamma=0.995"]

# Row: preset, scenario and what it differs by.
ROWS = {name: (f"configs/fast/{preset}.toml", "static", changes) for name, preset, changes in [
    ("td3", "td3-mlp", []),
    ("ddpg", "ddpg-mlp", []),
    ("sac", "sac-mlp", []),
    ("lagrangian", "lagrangian-mlp", []),
    ("dyna-deterministic", "dyna-deterministic-mlp", []),
    ("dyna-probabilistic", "dyna-probabilistic-mlp", []),
    ("mbpo", "mbpo-mlp", []),
    ("mpc-deterministic", "mpc-deterministic-mlp", []),
    ("mpc-probabilistic", "mpc-probabilistic-mlp", []),
    ("td3-with-model", "mpc-probabilistic-mlp", ["mpc.enabled=false", "run.updates_per_step=0.015625"]),
    ("td3-without-mirror", "td3-mlp", ["learner.mirror=false"]),
    ("td3-prioritized", "td3-mlp", ["learner.prioritized=true"]),
    # The published code's faults, one at a time (docs/original-system.md, sections 3.4 and 5.3).
    ("td3-without-noise", "td3-mlp", ["actor.noise_min=0", "actor.noise_max=0"]),
    ("td3-extra-discount", "td3-mlp", ["learner.extra_discount_steps=1"]),
    ("td3-time-limit-terminates", "td3-mlp", ["actor.time_limit_terminates=true"]),
    ("dyna-as-published", "dyna-deterministic-mlp", ["imagination.as_published=true", "imagination.rollout_steps=4", "model.success=\"learned\""]),
    ("lagrangian-as-published", "lagrangian-mlp", ["constraint.kind=\"fixed\"", "constraint.multiplier=2"]),
]}
for scenario in SCENARIOS:
    for network in ["mlp"] + [f"{kind}-h{h}" for h in (4, 8) for kind in ("mlp", "cnn", "gru", "transformer")]:
        ROWS[f"{scenario}-{network}"] = (f"configs/fast/td3-{network}.toml", scenario, WALL if scenario == "wall" else [])
# A multiplier that rises while every policy still collides has nothing to teach yet.
ROWS["box-lagrangian"] = ("configs/fast/lagrangian-mlp.toml", "box",
                          ["constraint.limit=0.05", "constraint.learning_starts=20000", "constraint.multiplier_max=20"])
del ROWS["static-mlp"]  # Which is td3.
for path in sorted((ROOT / "configs/paper/as-published").glob("*.toml")):
    ROWS[f"as-published-{path.stem}"] = (path.relative_to(ROOT), "static", [])

# How a policy with a model is scored again, with and without planning; lifelike: a drive that neither was trained for.
PLANNING = ["mpc.enabled=true", "mpc.samples=64"]
LIFELIKE = ["environment.robot.linear_acceleration=4", "environment.robot.angular_acceleration=10",
            "environment.robot.command_delay=0.04", "environment.lidar.noise_std=0.02"]  # As configs/lifelike.toml.
DRIVES = {"policy": [], "planning": PLANNING, "lifelike": LIFELIKE, "lifelike-planning": LIFELIKE + PLANNING}


def set_options(settings):
    """As the command line takes them."""
    return [word for setting in settings for word in ("--set", setting)]


def run(command, log):
    with open(log, "w") as out:
        subprocess.run([str(c) for c in command], check=True, stdout=out, stderr=subprocess.STDOUT)


def make(row, seed, options):
    """Trains and scores one run, unless it is there."""
    preset, scenario, changes = ROWS[row]
    train, test, fresh, validation_train, validation = SCENARIOS[scenario]
    if options.validation:
        train, test = validation_train, validation
    name = f"{row}-seed{seed}"
    directory = options.output / name
    if (directory / "fresh/evaluation.json").exists():
        return
    settings = [f"courses.train={train}", f"courses.test={test}", f"courses.collection={options.collection}",
                f"run.max_seconds={options.seconds}", "run.snapshot_steps=[100000]"] + changes + options.set
    command = [PROGRAM, "train", ROOT / preset, "--name", name, "--seed", seed, "--output", options.output,
               *set_options(settings)]
    log = options.output / f"{name}.log"
    try:
        run(command, log)
        run([PROGRAM, "evaluate", "--policy", directory / "policy.safetensors", "--courses", fresh, "--output", directory / "fresh"],
            str(log) + ".fresh")
        shutil.rmtree(directory / "checkpoints")  # Nearly a gigabyte of replay.
    except subprocess.CalledProcessError as error:
        print(f"{name}: {error}; see {log}", file=sys.stderr)


def score_drives(row, seed, options):
    """Scores a trained run with and without planning, unless that is there."""
    name = f"{row}-seed{seed}"
    courses = SCENARIOS[ROWS[row][1]][4 if options.validation else 1]
    for drive, settings in DRIVES.items():
        output = options.output / name / "drives" / drive
        if (output / "evaluation.json").exists():
            continue
        command = [PROGRAM, "evaluate", "--policy", options.output / name / "policy.safetensors", "--courses", courses,
                   "--collection", options.collection, "--output", output, *set_options(settings)]
        try:
            run(command, options.output / f"{name}.log.{drive}")
        except subprocess.CalledProcessError as error:
            print(f"{name}, {drive}: {error}", file=sys.stderr)


def drives_table(options):
    print("| row | seeds | " + " | ".join(f"{drive}: success [%] | collision [%]" for drive in DRIVES) + " |")
    print("|---" * (2 * len(DRIVES) + 2) + "|")
    for row in options.rows:
        cells = []
        for drive in DRIVES:
            paths = [options.output / f"{row}-seed{seed}/drives/{drive}/evaluation.json" for seed in options.seeds]
            found = [json.loads(path.read_text()) for path in paths if path.exists()]
            cells += [spread([100 * one[key] for one in found]) for key in ("success_rate", "collision_rate")]
        print(f"| {row} | {len(options.seeds)} | " + " | ".join(cells) + " |")


def result(directory):
    """The figures of a run, or None."""
    try:
        own = json.loads((directory / "evaluation.json").read_text())
        fresh = json.loads((directory / "fresh/evaluation.json").read_text())
        rows = list(csv.DictReader((directory / "metrics.csv").open()))
        curve = list(csv.DictReader((directory / "curve.csv").open())) if (directory / "curve.csv").exists() else []
    except FileNotFoundError:
        return None
    at_100k = [100 * float(c["success_rate"]) for c in curve[:-1][:1]]  # The last is the finished policy.
    late = [float(r["collision_rate"]) for r in rows[-max(1, len(rows) // 10):] if r["collision_rate"]]
    return {"success": 100 * own["success_rate"], "collision": 100 * own["collision_rate"], "timeout": 100 * own["timeout_rate"],
            "survival": own["survival_time_s"], "traversal": own["traversal_time_s"], "fresh": 100 * fresh["success_rate"],
            "fresh_collision": 100 * fresh["collision_rate"], "steps": float(rows[-1]["steps"]), "updates": float(rows[-1]["updates"]),
            "seconds": float(rows[-1]["training_s"]), "at_100k": at_100k[0] if at_100k else math.nan,
            "train_collision": 100 * sum(late) / len(late) if late else math.nan}


def spread(values):
    """Mean and, of more than one, the standard deviation over seeds."""
    values = [v for v in values if v is not None and not math.isnan(v)]
    if not values:
        return "-"
    mean = sum(values) / len(values)
    if len(values) == 1:
        return f"{mean:.1f}"
    return f"{mean:.1f} +- {math.sqrt(sum((v - mean) ** 2 for v in values) / (len(values) - 1)):.1f}"


def table(options):
    columns = {"success": "success [%]", "collision": "collision [%]", "traversal": "traversal [s]", "survival": "survival [s]",
               "fresh": "fresh courses [%]", "fresh_collision": "their collisions [%]", "at_100k": "at 100k steps [%]",
               "train_collision": "collisions in training [%]", "steps": "steps", "updates": "updates", "seconds": "trained [s]"}
    print("| row | seeds | " + " | ".join(columns.values()) + " |")
    print("|---" * (len(columns) + 2) + "|")
    for row in options.rows:
        results = [r for r in (result(options.output / f"{row}-seed{seed}") for seed in options.seeds) if r]
        if not results:
            continue
        cells = [spread([r[key] for r in results]) if key not in ("steps", "updates", "seconds")
                 else f"{sum(r[key] for r in results) / len(results):,.0f}" for key in columns]
        print(f"| {row} | {len(results)} | " + " | ".join(cells) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("collection")
    parser.add_argument("--output", type=pathlib.Path, default=pathlib.Path("runs/methods"))
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--rows", nargs="+", default=list(ROWS), choices=list(ROWS))
    parser.add_argument("--seconds", type=float, default=180.0)
    parser.add_argument("--at-once", type=int, default=max(1, (os.cpu_count() or 2) // 2))
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", help="settings of every run besides the rows' own")
    parser.add_argument("--validation", action="store_true", help="choose settings: train and score without the test courses")
    parser.add_argument("--planning", action="store_true", help="score the trained rows again, with and without planning")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    if options.collection:
        options.collection = str(pathlib.Path(options.collection).resolve())
    options.output.mkdir(parents=True, exist_ok=True)
    if not options.table:
        work = score_drives if options.planning else make
        with concurrent.futures.ThreadPoolExecutor(options.at_once) as pool:
            list(pool.map(lambda job: work(*job, options), [(row, seed) for seed in options.seeds for row in options.rows]))
    (drives_table if options.planning else table)(options)


if __name__ == "__main__":
    main()
