#!/usr/bin/env python3
"""The service by compose, on a real engine: built, brought up, scaled, trained until its policy drives, killed and taken down.

Needs root, or an engine that answers; else it is skipped. Everything it makes bears the project's name and is removed.
"""

import os
import pathlib
import sys
import tempfile

from cluster import ROLES, SERVICES, Cluster
from engine import IMAGE, PROMETHEUS_IMAGE, ROOT, Failure, end_with, run, running_engine, say, wait_for

PROJECT = "slalom_compose_test"
SUCCESS_RATE = 0.6  # An untrained policy has 0.


def main():
    with running_engine() as engine, tempfile.TemporaryDirectory() as scratch:
        engine.build_images(sys.argv[1])
        environment = dict(os.environ, SLALOM_IMAGE=IMAGE, SLALOM_PROMETHEUS_IMAGE=PROMETHEUS_IMAGE, SLALOM_PROMETHEUS_PORT="0",
                           SLALOM_KEYS=str(pathlib.Path(scratch) / "keys"))
        run(ROOT / "deploy/new-keys", env=dict(environment, PATH=f"{os.path.dirname(engine.docker)}:{os.environ['PATH']}"))

        def compose(*arguments):
            return run(*engine.compose, "-p", PROJECT, "-f", ROOT / "deploy/compose.yml", *arguments, env=environment)

        def up(actors):
            compose("up", "-d", "--no-build", "--scale", f"actor={actors}", *SERVICES)

        label = f"com.docker.compose.project={PROJECT}"
        cluster = Cluster(engine, label, "com.docker.compose.service={}")
        engine.remove_labelled(label)  # What a run that was killed has left.
        try:
            drill(cluster, compose, up)
        except Failure:
            for service in SERVICES:
                print(cluster.logs(service), file=sys.stderr)
            raise
        finally:
            compose("down", "--volumes", "--remove-orphans")
        say("passed")


def drill(cluster, compose, up):
    up(actors=1)
    for service in SERVICES:
        cluster.wait_healthy(service)
    cluster.wait_for_steps(20000)
    say("one actor fills the table")

    up(actors=4)
    cluster.wait_healthy("actor", 4)
    wait_for("Prometheus sees four actors that step",
             lambda: cluster.queried('count(rate(slalom_environment_steps_total[1m]) > 0)') == [4.0], 120)
    say("four actors")

    wait_for(f"a success rate of {SUCCESS_RATE} at the evaluator",
             lambda: cluster.value("evaluator", "slalom_evaluation_success_rate") >= SUCCESS_RATE, 360)
    say(f"the policy reaches {100 * cluster.value('evaluator', 'slalom_evaluation_success_rate'):.0f} %")

    wait_for("a checkpoint", lambda: cluster.value("learner", "slalom_checkpoints_total") > 0, 120)
    for role in ROLES:
        before = cluster.value("learner", "slalom_updates_total")
        kept = cluster.value("learner", "slalom_checkpoint_updates")
        restarts = restarts_of(cluster, role)
        cluster.crash(role)
        wait_for(f"{role} started again", lambda: restarts_of(cluster, role) > restarts, 60)
        cluster.wait_healthy(role, 4 if role == "actor" else 1)
        cluster.wait_for_steps(20000)
        updates = cluster.value("learner", "slalom_updates_total")
        if updates < kept:
            raise Failure(f"the learner went back to {updates:.0f} updates, beyond its checkpoint at {kept:.0f}")
        wait_for("updates go on", lambda: cluster.value("learner", "slalom_updates_total") > before, 180)
        say(f"{role} is back")

    # The accounts of both sides, once the actors have ended cleanly.
    ended = cluster.containers("actor")
    compose("stop", "actor")
    expect_clean_end(cluster, ended)
    accounts = cluster.ledgers(f"{PROJECT}_actors")
    made, accepted, lost, pending = (sum(account[entry] for account in accounts.values())
                                     for entry in ("made", "accepted", "lost", "pending"))
    in_table = cluster.value("replay", "slalom_steps_accepted_total")
    say(f"{len(accounts)} actors made {made} steps: {accepted} accepted, {lost} lost with a killed actor, {pending} pending; "
        f"the replay server accepted {in_table:.0f}")
    if len(accounts) != 4 or made != accepted + lost + pending or pending != 0 or accepted != in_table:
        raise Failure(f"the accounts do not balance: {accounts}")

    ended = [container for service in SERVICES for container in cluster.containers(service)]
    compose("stop")
    expect_clean_end(cluster, ended)
    say("all ended cleanly")


def expect_clean_end(cluster, containers):
    for container in containers:
        code = cluster.engine.inspect(container, "{{.State.ExitCode}}")
        role = cluster.engine.inspect(container, '{{index .Config.Labels "com.docker.compose.service"}}')
        if code != ("143" if role in ROLES else "0"):  # deploy/image/role: a role that was told to stop and did so.
            raise Failure(f"{cluster.engine.inspect(container, '{{.Name}}')} ended with {code} after SIGTERM\n"
                          + cluster.engine("logs", "--tail", "20", container))


def restarts_of(cluster, service):
    return sum(int(cluster.engine.inspect(container, "{{.RestartCount}}")) for container in cluster.containers(service))


if __name__ == "__main__":
    end_with(main)
