#!/usr/bin/env python3
"""Runs every panel's query and every rule's expression against a real Prometheus; each must give data.

monitoring_queries_test.py STAND_IN: of a program that shows every metric on ports that it prints.
monitoring_queries_test.py --run SLALOM: of a real service: replay server, learner, two actors, evaluator.
monitoring_queries_test.py --sweep SLALOM: the dashboard of sweeps and its rules, of a real sweep."""

import contextlib
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import urllib.request

import monitoring

sys.path.append(str(monitoring.ROOT / "tests/drills"))
import service

SECONDS = 120.0  # Until everything has data; takes about 5 of the stand-in, 20 of a real run.


def queries(of_sweep):
    """Those of the dashboard of sweeps and of its rules, or all others."""
    all_queries = {}
    for board, panel in monitoring.panels():
        if (board == "sweep") != of_sweep:
            continue
        for target in panel["targets"]:
            name = f"{board}: {panel['title']} {target['refId']} (panel {panel['id']})"
            all_queries[name] = monitoring.as_grafana_sends(target["expr"])
    for kind, name, expression in monitoring.rules("recording-rules.yml") + monitoring.rules("alert-rules.yml"):
        if name.startswith("sweep:") != of_sweep:
            continue
        all_queries[f"{kind} {name}"] = monitoring.without_threshold(expression) if kind == "alert" else expression
        if kind == "record":
            all_queries[f"recorded {name}"] = name
    return all_queries


@contextlib.contextmanager
def stand_in(program):
    """Where it shows metrics: {role: [HOST:PORT]}."""
    roles = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        lines = [roles.stdout.readline().split() for _ in range(4)]
        yield {role: [f"127.0.0.1:{port}"] for role, port in lines}
    finally:
        roles.stdin.close()
        roles.wait()


@contextlib.contextmanager
def real_run(program):
    """The same of a service."""
    # By the method that shows most: SAC with a constraint and a model. Goals are near, so that there are times to the goal at once.
    more = """[evaluation]
episodes_per_course = 1
goal_tolerance = 9.5
[learner]
algorithm = "sac"
[constraint]
kind = "lagrangian"
[model]
kind = "probabilistic"
encoder_layers = []
head_layers = [32]
"""
    with service.Service(program, test="generated:3:2", more_config=more) as run:
        roles = {"replay": ["replay"], "learner": ["learner"], "actor": ["a1", "a2"], "evaluator": ["e1"]}
        targets = {}
        for role, names in roles.items():
            for name in names:
                process = run.add(role, name).start()
                shown = service.wait_for(f"{name}'s metrics", lambda: re.search(
                    r"metrics at http://([^/]+)/", process.log_text()), SECONDS)
                targets.setdefault(role, []).append(shown.group(1))
        yield targets


PRESET = """[run]
max_steps = 4000
learning_starts = 500
updates_per_step = 0.01
[actor]
num_environments = 8
warmup_steps = 100
[replay]
capacity = 4000
[network]
encoder_layers = []
head_layers = [8]
sectors = 36
[learner]
batch_size = 16
"""
PLAN = """[sweep]
name = "tiny"
preset = "tiny.toml"
seeds = [1, 2]
[[group]]
name = "td3"
label = "TD3"
[[group]]
name = "dwa"
planner = "dwa"
scores = ["test"]
[[axis]]
name = "training courses"
keys = ["courses.train"]
values = ["generated:3:2", "generated:3:10"]
labels = ["2", "10"]
[[score]]
name = "test"
courses = "generated:4:2"
episodes = 2
[[score]]
name = "training"
courses = "training"
episodes = 1
"""


@contextlib.contextmanager
def real_sweep(program):
    """The same of a sweep, which `slalom sweep serve` shows from before its first file is there."""
    with tempfile.TemporaryDirectory(prefix="slalom-sweep-") as name:
        directory = pathlib.Path(name)
        (directory / "tiny.toml").write_text(PRESET)
        (directory / "plan.toml").write_text(PLAN)
        plan = [directory / "plan.toml", "--output", directory / "store"]
        serve = subprocess.Popen([program, "sweep", "serve", *plan, "--metrics", "127.0.0.1:0"], stdout=subprocess.PIPE,
                                 text=True)
        try:
            line = serve.stdout.readline()
            shown = re.search(r"metrics at http://([^/]+)/", line)
            assert shown, line
            with monitoring.Prometheus({"sweeper": [shown.group(1)]}) as prometheus:
                missing = prometheus.without_data({"cells": 'slalom_sweep_cells{state="waiting"} == 5'}, SECONDS)
                assert not missing, "the cells are not shown before they are begun"
                subprocess.run([program, "sweep", "run", *plan], check=True)
                yield directory / "store", shown.group(1), prometheus
        finally:
            serve.terminate()
            code = serve.wait()
        assert code == 0, f"slalom sweep serve ended with {code}"


def wrong_figures(store, prometheus):
    """Where the first panel and the collision rates are not those of the evaluations' files."""
    first = next(panel for board, panel in monitoring.panels() if board == "sweep")
    collisions = "slalom_sweep_collision_rate"
    missing = prometheus.without_data({"all cells are done": 'slalom_sweep_cells{state="done"} == 5'}, SECONDS)
    faults = list(missing)
    expected = {}
    for evaluation in store.glob("cells/*/scores/*/evaluation.json"):
        cell = json.loads((evaluation.parents[2] / "cell.json").read_text())
        result = json.loads(evaluation.read_text())
        courses = "test" if result["course_set"] == "generated:4:2" else "training"
        expected[cell["id"], courses] = result["collision_rate"]
    shown = {(labels["cell"], labels["courses"]): value for labels, value in prometheus.values(collisions)}
    if len(expected) != 9 or not any(expected.values()) or shown != expected:
        faults.append(f"{collisions} is {shown}, in the files {expected}")
    groups = {(labels.get("training_courses"), labels.get("courses"))
              for labels, _ in prometheus.values(monitoring.as_grafana_sends(first["targets"][0]["expr"]))}
    wanted = {(number, courses) for number in ("2", "10") for courses in ("test", "training", "training episodes")}
    if groups != wanted:
        faults.append(f"the first panel has {groups}, expected {wanted}")
    return faults


def check_sweep(program):
    wanted = queries(of_sweep=True)
    assert len(wanted) > 18, len(wanted)
    with real_sweep(program) as (store, address, prometheus):
        missing = prometheus.without_data(wanted, SECONDS)
        faults = not_shown({"sweep": [address]}) + wrong_figures(store, prometheus)
        assert not prometheus.has_data("slalom_sweep_nothing")
    return report(wanted, missing, faults)


def not_shown(targets):
    """What docs/metrics.md says that a role shows, and it does not."""
    faults = []
    for role, addresses in targets.items():
        page = urllib.request.urlopen(f"http://{addresses[0]}/metrics", timeout=30).read().decode()
        for name, roles in monitoring.metrics_and_roles():
            if (roles == "all" or role in roles.split(", ")) and f"# TYPE {name} " not in page:
                faults.append(f"{role} does not show {name}")
    return faults


def report(wanted, missing, faults):
    for fault in faults:
        print(fault)
    for name, query in missing.items():
        print(f"no data: {name}\n  {query}")
    print(f"{len(wanted) - len(missing)} of {len(wanted)} queries gave data")
    return 1 if missing or faults else 0


def main(shown):
    wanted = queries(of_sweep=False)
    assert len(wanted) > 100, len(wanted)
    with shown as targets, monitoring.Prometheus(targets) as prometheus:
        missing = prometheus.without_data(wanted, SECONDS)
        faults = not_shown(targets)  # By now there is a checkpoint, too.
        # It finds what it is there to find.
        assert not prometheus.has_data("slalom_nothing_total")
        assert prometheus.has_data("slalom_build_info")
    return report(wanted, missing, faults)


if __name__ == "__main__":
    if sys.argv[1] == "--sweep":
        sys.exit(check_sweep(sys.argv[2]))
    sys.exit(main(real_run(sys.argv[2]) if sys.argv[1] == "--run" else stand_in(sys.argv[1])))
