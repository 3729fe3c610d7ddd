#!/usr/bin/env python3
"""Rows of a Markdown table out of what Google Benchmark writes as JSON: medians, and counters in the last column."""

import json
import sys

# What each benchmark has; all else is a counter.
FIELDS = {"name", "run_name", "run_type", "family_index", "per_family_instance_index", "repetitions", "repetition_index", "threads",
          "aggregate_name", "aggregate_unit", "iterations", "real_time", "cpu_time", "time_unit", "label"}

for run in json.load(sys.stdin)["benchmarks"]:
    if run.get("aggregate_name") != "median":
        continue
    name = run["run_name"].replace("/real_time", "")
    rate = f"{run['items_per_second']:.4g}" if "items_per_second" in run else ""
    counters = ", ".join(f"{key} {run[key]:.4g}" for key in run if key not in FIELDS | {"items_per_second", "bytes_per_second"})
    print(f"| {name} | {run['real_time']:.4g} {run['time_unit']} | {run['cpu_time']:.4g} {run['time_unit']} | {rate} | {counters} |")
