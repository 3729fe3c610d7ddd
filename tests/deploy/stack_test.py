#!/usr/bin/env python3
"""The same service as a Swarm stack of one machine: deployed, scaled, a container killed, removed. Skipped like cluster_test.py."""

import os
import pathlib
import shutil
import sys
import tempfile

from cluster import ROLES, Cluster
from engine import IMAGE, PROMETHEUS_IMAGE, ROOT, Failure, end_with, run, running_engine, say, skip, succeeds, wait_for

STACK = "slalom_stack_test"


def main():
    with running_engine() as engine, tempfile.TemporaryDirectory() as scratch:
        if engine("info", "--format", "{{.Swarm.LocalNodeState}}").strip() != "inactive":
            skip("this engine is part of a swarm already")
        engine.build_images(sys.argv[1])
        environment = dict(os.environ, SLALOM_IMAGE=IMAGE, SLALOM_PROMETHEUS_IMAGE=PROMETHEUS_IMAGE,
                           SLALOM_KEYS=str(pathlib.Path(scratch) / "keys"))
        run(ROOT / "deploy/new-keys", env=dict(environment, PATH=f"{os.path.dirname(engine.docker)}:{os.environ['PATH']}"))
        environment.update(SLALOM_STACK=STACK, SLALOM_PROMETHEUS_PORT="0")
        label = f"com.docker.stack.namespace={STACK}"
        engine.remove_labelled(label)  # What a run that was killed has left.
        engine("swarm", "init", "--advertise-addr", "127.0.0.1")
        cluster = Cluster(engine, f"com.docker.swarm.service.name={STACK}_{{}}")
        try:
            run(engine.docker, "stack", "deploy", "--resolve-image", "never", "-c", ROOT / "deploy/compose.yml",
                "-c", stack_file(scratch), STACK, env=environment)
            drill(cluster)
            watch(engine, environment)
        except Failure:
            print(engine("service", "ls"), file=sys.stderr)
            for service in ROLES:
                print(engine("service", "ps", "--no-trunc", f"{STACK}_{service}", check=False), file=sys.stderr)
                print(cluster.logs(service), file=sys.stderr)
            raise
        finally:
            monitoring(engine, environment, "down", "--volumes", check=False)
            engine("stack", "rm", STACK, check=False)
            wait_for("the stack's containers to end", lambda: not engine("ps", "--quiet", "--filter", f"label={label}"), 60)
            engine("swarm", "leave", "--force", check=False)
            engine.remove_labelled(label)
        say("passed")


def stack_file(scratch):
    """deploy/stack.yml. Where this kernel has no ESP, which encrypts between machines, a copy that does not ask for it."""
    state = ["ip", "xfrm", "state"]
    ends = ["src", "127.0.0.1", "dst", "127.0.0.2", "proto", "esp", "spi", "0x51a"]
    key = "0x" + "00" * 20
    if shutil.which("ip") and succeeds(*state, "add", *ends, "mode", "transport", "aead", "rfc4106(gcm(aes))", key, "128"):
        run(*state, "delete", *ends)
        return ROOT / "deploy/stack.yml"
    say("this kernel has no ESP: the stack's network is tried without encryption")
    text = (ROOT / "deploy/stack.yml").read_text()
    option = '    driver_opts: {encrypted: "true"}\n'
    if option not in text:
        raise Failure("deploy/stack.yml does not encrypt its network")
    file = pathlib.Path(scratch) / "stack.yml"
    file.write_text(text.replace(option, ""))
    return file


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


def monitoring(engine, environment, *arguments, check=True):
    """Compose beside the stack, as docs/operations.md has it."""
    run(*engine.compose, "-p", f"{STACK}_monitoring", "-f", ROOT / "deploy/compose.yml", "-f", ROOT / "deploy/stack-monitoring.yml",
        *arguments, env=environment, check=check)


def watch(engine, environment):
    monitoring(engine, environment, "up", "-d", "--no-build", "prometheus")
    found = Cluster(engine, f"com.docker.compose.project={STACK}_monitoring", "com.docker.compose.service={}")
    wait_for("Prometheus beside the stack sees four actors", lambda: found.queried('count(up{job="actor"} == 1)') == [4.0], 120)
    published = engine("port", found.containers("prometheus")[0]).splitlines()
    if not published or not all("-> 127.0.0.1:" in line for line in published):
        raise Failure(f"Prometheus is published at {published}, expected 127.0.0.1 alone")
    for service in ("prometheus", "grafana"):
        if engine("service", "ps", "--quiet", "--filter", "desired-state=running", f"{STACK}_{service}").strip():
            raise Failure(f"{service} runs in the stack, which would open its port on all addresses")
    say("Prometheus answers on this machine alone")


if __name__ == "__main__":
    end_with(main)
