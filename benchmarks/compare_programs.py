#!/usr/bin/env python3
"""compare_programs.py BEFORE AFTER [--rounds N] [--seconds S] [golden|train|service ...]: one program beside another.

What a change of the structure must keep, measured for both in turn on this machine:

    golden   the weights of deterministic trainings, bit for bit
    train    `slalom train`: steps, updates and bytes written a second, and the training time until 90 % of the last episodes succeed
    service  the same of a replay server, a learner and an actor as processes; bytes are those of all three

Rates are those between a third of the time and the end. Nothing passes or fails here. It prints a Markdown table of medians.
"""

import argparse
import csv
import hashlib
import os
import statistics
import struct
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))

# Preset and steps: the plain learner, recurrent frames with a constraint's critics beside them, a model with imagined data.
GOLDEN = {
    "fast/td3-mlp": 60_000,
    "fast/td3-gru-h4": 20_000,
    "fast/td3-transformer-h4": 12_000,
    "fast/lagrangian-mlp": 40_000,
    "fast/sac-mlp": 40_000,
    "fast/mbpo-mlp": 20_000,
}


def settings(**pairs):
    return [part for key, value in pairs.items() for part in ("--set", f"{key.replace('__', '.')}={value}")]


def weights_digest(policy):
    """Of the tensors alone: the metadata name the commit and the time."""
    with open(policy, "rb") as file:
        header = struct.unpack("<Q", file.read(8))[0]
        file.seek(8 + header)
        return hashlib.sha256(file.read()).hexdigest()[:16]


def golden(programs, _):
    rows = []
    for preset, steps in GOLDEN.items():
        digests = []
        for program in programs:
            with tempfile.TemporaryDirectory() as scratch:
                subprocess.run(
                    [program, "train", f"{ROOT}/configs/{preset}.toml", "--deterministic", "--no-evaluation", "--output", scratch, "--name", "run",
                     *settings(run__max_steps=steps, run__max_seconds=0, run__checkpoint_seconds=0, run__simulation_threads=1)],
                    check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                digests.append(weights_digest(f"{scratch}/run/policy.safetensors"))
        rows.append((f"weights of {preset} after {steps:,} steps", *digests, "same" if digests[0] == digests[1] else "DIFFERENT"))
    return rows


def written_bytes(processes):
    total = 0
    for process in processes:
        with open(f"/proc/{process.pid}/io", encoding="ascii") as file:
            total += int(dict(line.split(": ") for line in file)["write_bytes"])
    return total


def rates(directory, seconds):
    """Steps/s, updates/s and training time to 90 %, of metrics.csv."""
    with open(f"{directory}/metrics.csv", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if not row["training_s"].startswith("#")]
    rows = [{key: float(value) if value not in ("", "nan") else float("nan") for key, value in row.items()} for row in rows]
    late = [row for row in rows if row["training_s"] > seconds / 3]
    span = late[-1]["training_s"] - late[0]["training_s"]
    steps = (late[-1]["steps"] - late[0]["steps"]) / span
    updates = (late[-1]["updates"] - late[0]["updates"]) / span
    good = [row["training_s"] for row in rows if row["success_rate"] >= 0.9]
    return steps, updates, good[0] if good else float("inf")


def measure(processes, learner, directory, seconds):
    """Waits for the learner, and looks at what all have written while it ran."""
    bytes_written = 0
    while learner.poll() is None:
        try:
            bytes_written = written_bytes(processes)
        except (OSError, KeyError):
            pass
        time.sleep(0.2)
    if learner.returncode not in (0, 4):
        sys.exit(f"a training ended with {learner.returncode}, see {directory}")
    return (*rates(directory, seconds), bytes_written / seconds)


def start(program, arguments, log):
    with open(log, "w", encoding="utf-8") as file:
        return subprocess.Popen([program, *arguments], stdout=file, stderr=subprocess.STDOUT)


def train(program, seconds, seed):
    with tempfile.TemporaryDirectory() as scratch:
        process = start(program, ["train", f"{ROOT}/configs/fast.toml", "--no-evaluation", "--output", scratch, "--name", "run",
                                  *settings(run__max_seconds=seconds, run__log_interval=1, run__seed=seed)], f"{scratch}/log")
        return measure([process], process, f"{scratch}/run", seconds)


def service(program, seconds, seed):
    with tempfile.TemporaryDirectory() as scratch:
        common = settings(run__max_seconds=seconds, run__log_interval=1, run__seed=seed, service__state=f'"{scratch}"',
                          learner_service__exit_when_finished="true")
        roles = {role: start(program, [role, "--config", f"{ROOT}/configs/fast.toml", *common], f"{scratch}/{role}.log")
                 for role in ("replay", "learner", "actor")}
        result = measure(list(roles.values()), roles["learner"], f"{scratch}/learner", seconds)
        for role in ("actor", "replay"):
            roles[role].terminate()
            roles[role].wait()
        return result


def speed(name, run):
    def rows(programs, options):
        found = [[], []]
        for round_ in range(options.rounds):
            for place in (0, 1) if round_ % 2 == 0 else (1, 0):
                found[place].append(run(programs[place], options.seconds, round_ + 1))
        medians = [[statistics.median(values) for values in zip(*runs)] for runs in found]
        labels = ("steps/s", "updates/s", "training time until 90 % of episodes succeed [s]", "MB written a second")
        scales = (1, 1, 1, 1e-6)
        return [(f"{name}: {label}", f"{before * scale:.4g}", f"{after * scale:.4g}", f"{after / before:.2f} x")
                for label, scale, before, after in zip(labels, scales, *medians)]
    return rows


def main():
    parts = {"golden": golden, "train": speed("train", train), "service": speed("service", service)}
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("parts", nargs="*", metavar="|".join(parts))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=30.0)
    options = parser.parse_intermixed_args()
    if wrong := [part for part in options.parts if part not in parts]:
        parser.error(f"there is no part {wrong[0]!r}, expected {', '.join(parts)}")
    print("| what | before | after | after : before |\n|---|---|---|---|")
    for part in options.parts or parts:
        for row in parts[part]((options.before, options.after), options):
            print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
