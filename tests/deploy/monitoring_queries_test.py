#!/usr/bin/env python3
"""Runs every panel's query and every rule's expression against a real Prometheus; each must give data.

monitoring_queries_test.py STAND_IN: of a program that shows every metric on ports that it prints.
monitoring_queries_test.py --run SLALOM: of a real service: replay server, learner, two actors, evaluator."""

import contextlib
import re
import subprocess
import sys
import urllib.request

import monitoring

sys.path.append(str(monitoring.ROOT / "tests/drills"))
import service

SECONDS = 120.0  # Until everything has data; takes about 5 of the stand-in, 20 of a real run.


def queries():
    all_queries = {}
    for board, panel in monitoring.panels():
        for target in panel["targets"]:
            name = f"{board}: {panel['title']} {target['refId']} (panel {panel['id']})"
            all_queries[name] = monitoring.as_grafana_sends(target["expr"])
    for kind, name, expression in monitoring.rules("recording-rules.yml") + monitoring.rules("alert-rules.yml"):
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
    # By the method that shows most: SAC with a constraint and a model.
    more = """[evaluation]
episodes_per_course = 1
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


def not_shown(targets):
    """What docs/metrics.md says that a role shows, and it does not."""
    faults = []
    for role, addresses in targets.items():
        page = urllib.request.urlopen(f"http://{addresses[0]}/metrics", timeout=30).read().decode()
        for name, roles in monitoring.metrics_and_roles():
            if (roles == "all" or role in roles.split(", ")) and f"# TYPE {name} " not in page:
                faults.append(f"{role} does not show {name}")
    return faults


def main(shown):
    wanted = queries()
    assert len(wanted) > 100, len(wanted)
    with shown as targets, monitoring.Prometheus(targets) as prometheus:
        missing = prometheus.without_data(wanted, SECONDS)
        faults = not_shown(targets)  # By now there is a checkpoint, too.
        # It finds what it is there to find.
        assert not prometheus.has_data("slalom_nothing_total")
        assert prometheus.has_data("slalom_build_info")
    for fault in faults:
        print(fault)
    for name, query in missing.items():
        print(f"no data: {name}\n  {query}")
    print(f"{len(wanted) - len(missing)} of {len(wanted)} queries gave data")
    return 1 if missing or faults else 0


if __name__ == "__main__":
    sys.exit(main(real_run(sys.argv[2]) if sys.argv[1] == "--run" else stand_in(sys.argv[1])))
