#!/usr/bin/env python3
"""A sweep through a real Slurm of one node, with a task that is requeued in the middle: the same bits as on this machine alone.

    slurm_sweep_test.py PROGRAM

Needs Debian's slurmctld, slurmd, slurm-client and munge, and root; else it is skipped.
"""

import json
import pathlib
import sys
import tempfile

from engine import Failure, end_with, say, wait_for
from slurm import Slurm
from sweep_plan import CELLS, require_equal, results, run_here, write_plan

STEPS = 800000


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory(prefix="slalom-slurm-") as scratch:
        folder = pathlib.Path(scratch)
        plan = write_plan(folder, STEPS)
        with Slurm(folder / "slurm") as slurm:
            store = folder / "store"
            try:
                drill(slurm, program, plan, store)
            except Failure as failure:
                outputs = "\n".join(f"--- {path.name}\n{path.read_text()}" for path in store.glob("plans/*/slurm/*.txt"))
                raise Failure(f"{failure}\n{outputs}\n{slurm.logs()}") from None
        run_here(program, plan, folder / "local", slurm.environment)
        require_equal(store, results(folder / "local"), "Slurm")
        say("passed: the same bits as without Slurm")


def drill(slurm, program, plan, store):
    def submit(*more):
        return slurm(program, "sweep", "run", plan, "--output", store, "--engine", "slurm", *more)

    try:
        submit("--set", "slurm.partition=nowhere")
        raise Failure("an array for a partition that is not there was submitted")
    except Failure as failure:
        if "invalid partition specified: nowhere" not in str(failure):
            raise
    said = submit("--set", "slurm.at_once=2", "--set", "slurm.memory_mb=1000")
    if f"{CELLS} are submitted as array 1" not in said:
        raise Failure(f"expected an array of {CELLS} tasks: {said}")
    say(said.strip())
    said = submit()
    if "0 are submitted" not in said or f"{CELLS} are in Slurm already" not in said:
        raise Failure(f"expected nothing to be submitted twice: {said}")

    interrupted = []

    def interrupt(*command):
        """Runs a command on a task that has saved a checkpoint, so that there is something to go on with. Returns the task."""
        def found():
            return [task for task, state in slurm.states().items() if state == "RUNNING" and task not in interrupted
                    and list(store.glob(f"cells/{cell_of(store, task)}/run/checkpoints/step-*"))]

        task = wait_for("a task that has saved a checkpoint", found, 60)[0]
        slurm(*command, task)
        interrupted.append(task)
        return task

    task = wait_for("a task that runs", lambda: [task for task, state in slurm.states().items() if state == "RUNNING"], 60)[0]
    status = slurm(program, "sweep", "status", plan, "--output", store)
    if not any(task in line and "RUNNING" in line for line in status.splitlines()):
        raise Failure(f"expected task {task} to run: {status}")
    # As when another job preempts it; as a minute before the time limit, when the script alone is told; and for good.
    requeued = interrupt("scontrol", "requeue")
    wait_for(f"task {requeued} back in the queue", lambda: slurm.states().get(requeued) == "PENDING", 60)
    told = interrupt("scancel", "--batch", "--signal=TERM")
    wait_for(f"task {told} back in the queue", lambda: slurm.states().get(told) == "PENDING", 60)
    cancelled = interrupt("scancel")
    wait_for(f"task {cancelled} out of the queue", lambda: cancelled not in slurm.states(), 60)
    say(f"{requeued} was requeued, {told} told to end, {cancelled} cancelled")
    wait_for("the queue to empty", lambda: not slurm.states(), 300)
    if store.joinpath("cells", cell_of(store, cancelled), "trained.json").exists():
        raise Failure(f"task {cancelled} was trained after it had been cancelled")
    said = submit()
    if "1 are submitted" not in said:
        raise Failure(f"expected the cancelled cell alone to be submitted: {said}")
    wait_for("the queue to empty again", lambda: not slurm.states(), 120)

    for task in interrupted:
        log = (store / "cells" / cell_of(store, task) / "log.txt").read_text()
        if "resum" not in log:
            raise Failure(f"the training of task {task} began anew:\n{log}")
    status = slurm(program, "sweep", "status", plan, "--output", store)
    if f"{CELLS} done" not in status:
        raise Failure(f"expected {CELLS} cells that are done: {status}")
    if "accounting storage is disabled" not in status:
        raise Failure(f"expected a note that there is no database: {status}")
    said = submit()
    if f"{CELLS} of {CELLS} cells are done" not in said or "0 are submitted" not in said:
        raise Failure(f"expected nothing to be left: {said}")


def cell_of(store, task):
    """The id of the cell that a task works on."""
    job, index = task.split("_")
    for record in store.glob("plans/*/slurm/submitted.json"):
        for array in json.loads(record.read_text())["arrays"]:
            if array["job"] == job:
                return array["cells"][int(index)]
    raise Failure(f"no array {job} was recorded")


if __name__ == "__main__":
    end_with(main)
