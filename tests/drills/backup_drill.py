#!/usr/bin/env python3
"""backup_drill.py PROGRAM [COPIES]: copies of the state of a service that runs, and a service that goes on from one.

Passes if each copy is made while the service goes on, and if a service from the last copy makes updates and steps of each actor
again. In the end every step that its actors ever made is accepted or counted as lost, the same on both sides.
"""

import os
import shutil
import subprocess
import time

from service import Service, check, check_accounts, main, wait_for


def drill(program, copies="5"):
    # Segments, checkpoints and rows come and go fast, so that copies meet them in the middle.
    with Service(program, capacity=20000, more_config='[evaluator_service]\ninterval = 20.0\n') as service:
        replay = service.add("replay", extra=["--set", "replay_server.segment_bytes=1048576"])
        learner = service.add("learner", extra=["--set", "run.checkpoint_seconds=0.2"])
        actors = [service.add("actor", f"actor-{i}") for i in range(2)]
        service.add("evaluator")

        def progress():
            return [service.figure("learner", "learner", "updates")] + [service.figure("actor", a.name, "steps_made") for a in actors]

        def wait_until_all_goes_on(what):
            before = wait_for(f"the status {what}", progress)
            wait_for(f"updates, and steps of each actor, {what}", lambda: all(n > b for n, b in zip(progress(), before)), 120.0)

        for process in service.processes:
            process.start()
        wait_until_all_goes_on("after the start")
        wait_for("a checkpoint", lambda: learner.metric("slalom_checkpoints_total") >= 1)
        for number in range(int(copies)):
            time.sleep(1.0)
            backup = os.path.join(service.directory, f"backup-{number}")
            made = subprocess.run([service.program, "backup", service.state, backup], capture_output=True, text=True, check=False)
            check(made.returncode == 0, f"copy {number}: {made.stderr}")
            print(made.stdout.strip(), flush=True)
        again = subprocess.run([service.program, "backup", service.state, backup], capture_output=True, text=True, check=False)
        check(again.returncode == 1 and backup in again.stderr, f"a copy replaced another: {again.stdout}{again.stderr}")
        copied = service.figure("replay", "replay", "steps")
        wait_until_all_goes_on("beside the copies")
        for process in service.processes:
            process.kill()
        shutil.rmtree(service.state)
        shutil.copytree(backup, service.state)
        for process in service.processes:
            process.start()
        check("lost to damage: 0" in wait_for("the journal's recovery", lambda: "steps in the table" in replay.log_text() and replay.log_text()),
              f"the copy of the journal is damaged: {replay.log_text()}")
        check("resumed from" in wait_for("the learner's start", lambda: "policies at" in learner.log_text() and learner.log_text()),
              f"the learner does not go on from its checkpoint: {learner.log_text()}")
        wait_until_all_goes_on("from the copy")
        check(service.figure("replay", "replay", "steps") > 0, "no steps")
        made, lost = check_accounts(service)
        print(f"{copies} copies while {copied:.0f} steps were made; from the last one: {made} steps made, {lost} lost, the same on both sides")


main(drill)
