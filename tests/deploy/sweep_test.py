#!/usr/bin/env python3
"""A sweep by containers that share a directory, as Compose scales them and as a job of a one-node Swarm: the bits of a sweep on
this machine alone, and no cell twice. Then one whose cells are trained by services in the containers.

    sweep_test.py PROGRAM

Needs root, or an engine that answers; else it is skipped.
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

from engine import IMAGE, ROOT, Failure, end_with, run, running_engine, say, wait_for
from sweep_plan import CELLS, LEARNING_STARTS, UPDATES_PER_STEP, read_policy, require_equal, results, run_here, write_plan

PROJECT = "slalom_sweep_test"
STEPS = 400000
SERVICE_STEPS = 40000
WORKERS = 2
USER = 10001  # The image's.


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    with running_engine() as engine, tempfile.TemporaryDirectory(prefix="slalom-sweep-") as scratch:
        folder = pathlib.Path(scratch)
        folder.chmod(0o755)
        plan = write_plan(folder, STEPS)
        # No container gets these, and another kernel of the BLAS makes other cells.
        here = {name: value for name, value in os.environ.items() if not name.startswith("OPENBLAS_")}
        run_here(program, plan, folder / "local", here)
        expected = results(folder / "local")
        say("done without containers")
        engine.make_base_image()
        engine.build_image_of(program)
        say("the image is built")
        for test in (by_compose, by_swarm):
            store = new_store(folder / test.__name__)
            environment = dict(os.environ, SLALOM_IMAGE=IMAGE, SLALOM_SWEEPS=str(store), SLALOM_PLAN="/var/lib/slalom/plan.toml",
                               SLALOM_SWEEP_SETS="sweep.name=shared", SLALOM_KEYS=str(folder / "keys"))
            test(engine, environment, store)
            require_equal(store, expected, test.__name__)
            require_once(store)
        store = new_store(folder / "services")
        environment = dict(environment, SLALOM_SWEEPS=str(store), SLALOM_SWEEP_CPUS="2",
                           SLALOM_SWEEP_SETS=f"sweep.name=shared sweep.trainer=service sweep.actors=2 run.max_steps={SERVICE_STEPS}")
        by_compose(engine, environment, store)
        require_services(store)
        say("passed")


def new_store(store):
    """A directory as an operator would make it: the plan in it, and the image's user may write to it."""
    store.mkdir()
    write_plan(store, STEPS)
    if os.geteuid() == 0:
        shutil.chown(store, USER, USER)
    else:
        store.chmod(0o777)
    return store


def require_once(store):
    """Throws `Failure` if a training was begun more than once, or if one worker did them all."""
    hosts = set()
    for cell in store.glob("cells/*"):
        hosts.add(json.loads((cell / "trained.json").read_text())["host"])
        begun = (cell / "log.txt").read_text().count("training on")
        if begun != 1:
            raise Failure(f"cell {cell.name} was begun {begun} times:\n{(cell / 'log.txt').read_text()}")
    if len(hosts) != WORKERS:
        raise Failure(f"the cells were trained by {len(hosts)} containers, expected {WORKERS}")


def require_services(store):
    """Throws `Failure` unless each cell was trained by a service of two actors, made all updates that its steps earn, and has a score."""
    updates = int(UPDATES_PER_STEP * (SERVICE_STEPS - LEARNING_STARTS))
    for cell in store.glob("cells/*"):
        header, _ = read_policy(cell / "run/policy.safetensors")
        made = int(header["__metadata__"]["updates"])
        if made < updates or not list(cell.glob("scores/*/evaluation.json")):
            raise Failure(f"cell {cell.name}: {made} updates, expected {updates} and a score: {sorted(cell.rglob('*'))}")
        log = (cell / "log.txt").read_text()
        if not all(f"actor 'actor-{i}'" in log for i in (1, 2)):
            raise Failure(f"cell {cell.name} was not trained by two actors:\n{log}")


def by_compose(engine, environment, store):
    def compose(*arguments):
        return run(*engine.compose, "-p", PROJECT, "-f", ROOT / "deploy/compose.yml", *arguments, env=environment)

    label = f"com.docker.compose.project={PROJECT}"
    engine.remove_labelled(label)  # What a run that was killed has left.
    try:
        compose("up", "-d", "--no-build", "sweeper")
        if engine("ps", "--all", "--quiet", "--filter", f"label={label}").split():
            raise Failure("a sweeper was started that nobody asked for")
        compose("up", "-d", "--no-build", "--scale", f"sweeper={WORKERS}", "sweeper")
        containers = engine("ps", "--all", "--quiet", "--filter", f"label={label}").split()
        if len(containers) != WORKERS:
            raise Failure(f"{len(containers)} sweepers, expected {WORKERS}")
        wait_for("the sweepers to end",
                 lambda: all(engine.inspect(container, "{{.State.Status}}") == "exited" for container in containers), 180)
        for container in containers:
            code = engine.inspect(container, "{{.State.ExitCode}} {{.RestartCount}}")
            if code != "0 0":
                raise Failure(f"a sweeper ended with {code}\n" + output_of(engine, "logs", container))
        status = compose("run", "--rm", "sweeper", "status")
        if f"{CELLS} done" not in status:
            raise Failure(f"expected {CELLS} cells that are done: {status}")
        say("done by Compose")
    finally:
        compose("down", "--volumes", "--remove-orphans")


def by_swarm(engine, environment, store):
    if engine("info", "--format", "{{.Swarm.LocalNodeState}}").strip() != "inactive":
        raise Failure("this engine is part of a swarm already, expected one that the test may use")
    engine("swarm", "init", "--advertise-addr", "127.0.0.1")
    try:
        run(ROOT / "deploy/sweep-on-swarm", WORKERS, PROJECT, "--no-resolve-image",
            env=dict(environment, PATH=f"{os.path.dirname(engine.docker)}:{os.environ['PATH']}"))

        def complete():
            found = engine("service", "ps", "--format", "{{.CurrentState}}", PROJECT).splitlines()
            if any(state.split()[0] in ("Failed", "Rejected") for state in found):
                raise Failure(engine("service", "ps", "--no-trunc", PROJECT) + output_of(engine, "service", "logs", PROJECT))
            return sum(state.startswith("Complete") for state in found) == WORKERS

        wait_for("the job to end", complete, 180)
        say("done by a Swarm")
    finally:
        engine("service", "rm", PROJECT, check=False)
        label = f"com.docker.swarm.service.name={PROJECT}"
        wait_for("the job's containers to end", lambda: not engine("ps", "--quiet", "--filter", f"label={label}"), 60)
        engine("swarm", "leave", "--force", check=False)
        engine.remove_labelled(label)


def output_of(engine, *command):
    return subprocess.run([engine.docker, *command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False).stdout


if __name__ == "__main__":
    end_with(main)
