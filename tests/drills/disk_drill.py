#!/usr/bin/env python3
"""disk_drill.py PROGRAM: disks of all roles that are full, or read-only while snapshots and checkpoints are due. Needs root (tmpfs mounts).

Passes if every role lives on and says what is wrong, nothing that was acknowledged is lost, all goes on once there is space again, and
steps that an actor cannot keep for its next start are counted as lost, the same on both sides.
"""

import os
import subprocess
import sys

from service import Service, check, check_accounts, fill, main, mount, said_lost, wait_for


def make_read_only(path):
    subprocess.run(["mount", "--bind", path, path], check=True)
    subprocess.run(["mount", "-o", "remount,bind,ro", path], check=True)
    return path


def make_writable(path):
    subprocess.run(["umount", path], check=True)


def drill(program):
    if os.geteuid() != 0:
        print("SKIPPED: mounting a small file system needs root")
        sys.exit(77)
    # Thousands of updates are always due.
    with Service(program, capacity=20000, updates_per_step=4.0, more_config="[evaluator_service]\ninterval = 1.0\n",
                 test="static-validation") as service:
        disks = [os.path.join(service.state, name) for name in ("replay", "learner", "actors/actor-0", "evaluators/evaluator")]
        for disk in disks:
            mount(disk, 200)
        try:
            roles = replay, learner, actor, evaluator = [
                service.add("replay", extra=("--set", "replay_server.segment_bytes=4194304")), service.add("learner"),
                service.add("actor", "actor-0"), service.add("evaluator", extra=("--set", "evaluation.episodes_per_course=1"))]
            for process in roles:
                process.start()
            wait_for("updates", lambda: service.figure("learner", "learner", "updates") > 200)
            wait_for("a checkpoint", lambda: learner.metric("slalom_checkpoints_total") >= 1)

            # The replay server's disk full, then read-only (seen when the next segment begins): nothing more is acknowledged, sampling
            # and learning go on.
            for name, reason, begin, end in (("full", "No space left", fill, os.remove),
                                             ("read-only", "Read-only file system", make_read_only, make_writable)):
                thing = begin(disks[0])
                wait_for(f"the journal's failing on a disk that is {name}", lambda: replay.metric("slalom_journal_failing") == 1, 120.0)
                check(reason in replay.health(), f"it says that it is well: {replay.health()}")
                acknowledged = actor.metric("slalom_steps_acknowledged_total")
                updates = service.figure("learner", "learner", "updates")
                wait_for("learning that goes on", lambda: service.figure("learner", "learner", "updates") > updates)
                end(thing)
                wait_for("the journal's recovery", lambda: replay.metric("slalom_journal_failing") == 0, 90.0)
                check(replay.health() == "ok", f"it says that it is not well: {replay.health()}")
                wait_for("acknowledgements", lambda: actor.metric("slalom_steps_acknowledged_total") > acknowledged)
                check(reason in replay.log_text(), f"the log does not say it: {replay.log_text()[-1500:]}")
                print(f"replay server: disk {name}, learning went on, the journal came back", flush=True)

            checkpoints = os.path.join(disks[1], "checkpoints")
            # The learner's disk full, then read-only: the earlier checkpoint stays, training goes on.
            for name, begin, end in (
                    ("full", lambda: fill(disks[1]), os.remove),
                    ("read-only", lambda: make_read_only(checkpoints), make_writable)):
                failures = learner.metric("slalom_checkpoint_failures_total")
                thing = begin()
                wait_for(f"a checkpoint that fails on a disk that is {name}",
                         lambda: learner.metric("slalom_checkpoint_failures_total") > failures)
                updates = service.figure("learner", "learner", "updates")
                wait_for("learning that goes on", lambda: service.figure("learner", "learner", "updates") > updates)
                good = learner.metric("slalom_checkpoints_total")
                end(thing)
                wait_for("the next checkpoint", lambda: learner.metric("slalom_checkpoints_total") > good)
                print(f"learner: disk {name}, training went on, checkpoints came back", flush=True)

            # The evaluator's disk full: it scores on, and keeps scores and policies again once there is space.
            filler = fill(disks[3])
            wait_for("scores that cannot be written", lambda: "No space left" in evaluator.log_text(), 120.0)
            scored = service.figure("evaluator", "evaluator", "evaluations")
            wait_for("the next score", lambda: service.figure("evaluator", "evaluator", "evaluations") > scored, 120.0)
            os.remove(filler)
            scores = os.path.join(disks[3], "scores.csv")
            before = os.path.getsize(scores)
            wait_for("the next line of scores", lambda: os.path.getsize(scores) > before, 120.0)
            print("evaluator: disk full, scoring went on, scores are written again", flush=True)
            for process in roles:
                process.check_alive()

            # The actor's disk full: it drives on. What it cannot deliver at its end has no place and is lost, and it says so.
            filler = fill(disks[2])
            made = actor.metric("slalom_environment_steps_total")
            wait_for("steps with a full disk", lambda: actor.metric("slalom_environment_steps_total") > made + 2000)
            replay.kill()
            wait_for("steps that wait", lambda: actor.metric("slalom_steps_pending") > 0)
            code, _ = actor.stop(30.0)
            check(code != 0 and "No space left" in actor.log_text(), f"it ended with {code}: {actor.log_text()[-1500:]}")
            os.remove(filler)
            replay.start()
            actor.start()
            made = wait_for("the actor's metrics", lambda: actor.metric("slalom_environment_steps_total"))
            wait_for("steps again", lambda: actor.metric("slalom_environment_steps_total") > made)
            said = said_lost(actor)
            made, lost = check_accounts(service)
            check(said == lost > 0, f"{lost} steps are lost, and the actor's log speaks of {said}")
            print(f"actor: disk full, {made} steps made, {lost} of them without a place at its end, 0 unaccounted", flush=True)
            for process in (evaluator, replay):
                code, _ = process.stop(10.0)
                check(code == 0, f"{process.name} ended with {code}")
        finally:
            for process in service.processes:
                if process.process is not None:
                    process.kill()
            for disk in disks:
                subprocess.run(["umount", "-l", disk], check=False)


main(drill)
