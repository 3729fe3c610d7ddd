#!/usr/bin/env python3
"""A training by a service through a real Slurm of one node: an actor is killed, the job is told that its time is up and
requeued, and in the end both sides agree on every step and the policy has a score.

    slurm_service_test.py PROGRAM

Needs Debian's slurmctld, slurmd, slurm-client and munge, and root; else it is skipped.
"""

import os
import pathlib
import re
import signal
import sys
import tempfile

from engine import ROOT, Failure, end_with, say, wait_for
from slurm import Slurm

SCRIPT = ROOT / "deploy/slurm/service.sbatch"
ACTORS = 2
ACCOUNT = r"stopped: (\d+) steps made, (\d+) accepted, (\d+) kept for the next start, (\d+) lost"


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory(prefix="slalom-slurm-service-") as scratch:
        folder = pathlib.Path(scratch)
        with Slurm(folder / "slurm", cpus=2 + ACTORS) as slurm:
            try:
                drill(slurm, program, folder)
            except Failure as failure:
                said = "\n".join(f"--- {path.name}\n{path.read_text()}" for path in [*folder.glob("*.txt"), *folder.glob("state/logs/*")])
                raise Failure(f"{failure}\n{said}\n{slurm.logs()}") from None


def drill(slurm, program, folder):
    state, output = folder / "state", folder / "job.txt"
    slurm.environment |= {"SLALOM": str(program), "SLALOM_COURSES": "static-validation"}
    config = ROOT / "configs/cluster.toml"
    settings = ["run.max_steps=400000", "run.updates_per_step=0.005", "run.learning_starts=2000", "run.checkpoint_seconds=1",
                "evaluation.episodes_per_course=1"]

    def submit(*more):
        return slurm("sbatch", "--parsable", f"--ntasks={2 + ACTORS}", "--mem-per-cpu=1G", f"--output={output}", SCRIPT, *more).strip()

    def said():
        return output.read_text(errors="replace") if output.exists() else ""

    def log(name):
        return (state / f"logs/{name}.log").read_text(errors="replace")

    for mistake, expected in ((("nowhere.toml", state), "nowhere.toml: expected a config"),
                              ((config, state, "run.name"), "the replay ended before it listened")):
        submit(*mistake)
        wait_for(f"the error {expected}", lambda: expected in said(), 60)
        wait_for("the queue to empty", lambda: not slurm.states(), 60)
        output.unlink()
    job = submit(config, state, *settings)
    wait_for("updates", lambda: list(state.glob("learner/checkpoints/step-[1-9]*")), 120)
    say("the service learns")

    victim = processes(program, "actor-1")[0]
    os.kill(victim, signal.SIGKILL)
    wait_for("another actor-1", lambda: [each for each in processes(program, "actor-1") if each != victim], 60)
    wait_for("the word of it", lambda: "ended by signal 9, started again" in log("actor-1"), 10)
    say("a killed actor came back")

    slurm("scancel", "--batch", "--signal=TERM", job)  # As a minute before the time limit.
    wait_for("the job back in the queue", lambda: "PENDING" in slurm.states().values(), 90)
    if "stopped and saved" not in said():
        raise Failure("the job was requeued without having saved")
    if processes(program, "actor-"):
        raise Failure("an actor outlived its job")
    say("the job saved and was requeued")
    wait_for("the queue to empty", lambda: not slurm.states(), 300)

    if "resum" not in log("learner"):
        raise Failure("the learner began anew")
    accounts = []
    for actor in range(ACTORS):
        found = re.findall(ACCOUNT, log(f"actor-{actor}"))
        if not found:
            raise Failure(f"actor-{actor} gave no account")
        made, accepted, kept, lost = map(int, found[-1])
        accounts.append((made, accepted, kept, lost))
        if made != accepted + kept + lost:
            raise Failure(f"actor-{actor}: {made} made, {accepted} accepted, {kept} kept, {lost} lost")
    server = int(re.findall(r"stopped with (\d+) steps accepted", log("replay"))[-1])
    if sum(each[1] for each in accounts) != server:
        raise Failure(f"the server has {server} steps, the actors {accounts}")
    if "success" not in said() or not (state / "score/evaluation.json").exists():
        raise Failure("the policy has no score")
    say(f"passed: {server} steps, {sum(each[3] for each in accounts)} lost with the killed actor, 0 unaccounted")


def processes(program, name):
    """Those of this program whose command line names it."""
    found = []
    for each in pathlib.Path("/proc").iterdir():
        try:
            if each.name.isdigit() and (each / "exe").resolve() == program and name in (each / "cmdline").read_text():
                found.append(int(each.name))
        except OSError:
            pass  # It has ended.
    return found


if __name__ == "__main__":
    end_with(main)
