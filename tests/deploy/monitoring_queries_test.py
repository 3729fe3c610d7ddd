#!/usr/bin/env python3
"""Runs every panel's query and every rule's expression against a real Prometheus; each must give data.

monitoring_queries_test.py STAND_IN: a program that shows every metric on ports that it prints."""

import subprocess
import sys

import monitoring

SECONDS = 60.0  # Until everything has data; takes about 5.


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


def main(stand_in):
    roles = subprocess.Popen([stand_in], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        targets = {}
        for _ in range(4):
            role, port = roles.stdout.readline().split()
            targets[role] = [f"127.0.0.1:{port}"]
        wanted = queries()
        assert len(wanted) > 100, len(wanted)
        with monitoring.Prometheus(targets) as prometheus:
            missing = prometheus.without_data(wanted, SECONDS)
            # It finds what it is there to find.
            assert not prometheus.has_data("slalom_nothing_total")
            assert prometheus.has_data("slalom_build_info")
    finally:
        roles.stdin.close()
        roles.wait()
    for name, query in missing.items():
        print(f"no data: {name}\n  {query}")
    print(f"{len(wanted) - len(missing)} of {len(wanted)} queries gave data")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
