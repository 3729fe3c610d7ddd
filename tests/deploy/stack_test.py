#!/usr/bin/env python3
"""The same service as a Swarm stack of one machine: deployed, scaled, a container killed, removed. Skipped like cluster_test.py."""

import os
import pathlib
import sys
import tempfile

from cluster import ROLES, Cluster
from engine import IMAGE, PROMETHEUS_IMAGE, ROOT, Failure, run, running_engine, say, skip, wait_for

STACK = "slalom_stack_test"

# Grafana's image comes from a registry, which a test does without.
WITHOUT_GRAFANA = 'version: "3.8"\nservices: {grafana: {deploy: {replicas: 0}}}\n'


def main():
    with running_engine() as engine, tempfile.TemporaryDirectory() as scratch:
        if engine("info", "--format", "{{.Swarm.LocalNodeState}}").strip() != "inactive":
            skip("this engine is part of a swarm already")
        engine.build_images(sys.argv[1])
        environment = dict(os.environ, SLALOM_IMAGE=IMAGE, SLALOM_PROMETHEUS_IMAGE=PROMETHEUS_IMAGE,
                           SLALOM_KEYS=str(pathlib.Path(scratch) / "keys"))
        run(ROOT / "deploy/new-keys", env=dict(environment, PATH=f"{os.path.dirname(engine.docker)}:{os.environ['PATH']}"))
        overlay = pathlib.Path(scratch) / "without-grafana.yml"
        overlay.write_text(WITHOUT_GRAFANA)

        label = f"com.docker.stack.namespace={STACK}"
        engine.remove_labelled(label)  # What a run that was killed has left.
        engine("swarm", "init", "--advertise-addr", "127.0.0.1")
        cluster = Cluster(engine, f"com.docker.swarm.service.name={STACK}_{{}}")
        try:
            run(engine.docker, "stack", "deploy", "--resolve-image", "never", "-c", ROOT / "deploy/compose.yml",
                "-c", ROOT / "deploy/stack.yml", "-c", overlay, STACK, env=environment)
            drill(cluster)
        except Failure:
            print(engine("service", "ls"), file=sys.stderr)
            for service in ROLES:
                print(engine("service", "ps", "--no-trunc", f"{STACK}_{service}", check=False), file=sys.stderr)
                print(cluster.logs(service), file=sys.stderr)
            raise
        finally:
            engine("stack", "rm", STACK, check=False)
            wait_for("the stack's containers to end", lambda: not engine("ps", "--quiet", "--filter", f"label={label}"), 60)
            engine("swarm", "leave", "--force", check=False)
            engine.remove_labelled(label)
        say("passed")


def drill(cluster):
    for role in ROLES:
        cluster.wait_healthy(role)
    cluster.wait_for_steps(20000)
    say("the stack runs")

    cluster.engine("service", "scale", "--detach", f"{STACK}_actor=4")
    cluster.wait_healthy("actor", 4)
    cluster.wait_for_steps(20000)
    say("four actors")

    killed = cluster.crash("replay")
    wait_for("another replay server", lambda: set(cluster.containers("replay")) - {killed}, 60)
    cluster.wait_healthy("replay")
    cluster.wait_for_steps(20000)
    say("the replay server is back")


if __name__ == "__main__":
    try:
        main()
    except Failure as failure:
        print(f"FAILED: {failure}", file=sys.stderr)
        sys.exit(1)
