#!/usr/bin/env python3
"""kill_drill.py PROGRAM [KILLS [SEED]]: kill -9 of actors, replay server and learner at random moments.

Passes if training goes on after each kill, every step that an actor ever made is accepted or counted as lost, the same on both
sides, the learner never goes back past its last checkpoint, and the policy still learns to drive.
"""

import random
import re
import statistics
import time

from service import Service, check, check_accounts, main, said_lost, wait_for


def drill(program, kills="30", seed="1"):
    draw = random.Random(int(seed))
    with Service(program) as service:
        replay = service.add("replay").start()
        learner = service.add("learner").start()
        actors = [service.add("actor", f"actor-{i}").start() for i in range(2)]
        wait_for("the first 300 updates", lambda: learner.metric("slalom_updates_total") >= 300)
        recoveries = {"replay": [], "learner": [], "actor": []}
        for number in range(int(kills)):
            time.sleep(draw.uniform(0.2, 2.5))
            victim = draw.choice([replay, learner, *actors])
            checkpoint = 0
            if victim is learner:
                checkpoint = learner.metric("slalom_checkpoint_updates") if "slalom_checkpoint_updates" in str(learner.metrics()) else 0
            victim.kill()
            began = time.monotonic()
            victim.start()
            if victim is learner:
                resumed = wait_for("the learner's start", lambda: re.search(r"policies at", learner.log_text()) and learner.log_text())
                found = re.search(r"resumed from .* (\d+) updates", resumed)
                check((int(found.group(1)) if found else 0) >= checkpoint, f"went back past its checkpoint at {checkpoint}: {resumed}")
            before = None

            def goes_on():
                nonlocal before
                status = service.status()
                now = status["learner", "learner"]["figures"]["updates"], status["replay", "replay"]["figures"]["steps"]
                before = before or now
                return now[0] > before[0] and now[1] > before[1]

            wait_for(f"updates and steps after kill {number} of {victim.name}", goes_on, 30.0)
            recoveries[victim.role].append(time.monotonic() - began)
            for process in service.processes:
                process.check_alive()
            print(f"kill {number + 1}: {victim.name}, going on {recoveries[victim.role][-1]:.1f} s later", flush=True)

        wait_for("a policy that drives",
                 lambda: statistics.mean(a.metric("slalom_success_rate") for a in actors) > 0.5, 240.0)
        made, lost = check_accounts(service)
        said = sum(map(said_lost, actors))
        check(said == lost, f"{lost} steps are lost, and the actors' logs speak of {said}")
        code, _ = replay.stop()
        check(code == 0, f"the replay server ended with {code}")
        for role, times in recoveries.items():
            if times:
                print(f"{role}: {len(times)} kills, going on after {statistics.median(times):.1f} s (median), {max(times):.1f} s (longest)")
        print(f"{made} steps made, {made - lost} accepted or still kept, {lost} lost with the actors that were killed "
              f"(not acknowledged), 0 unaccounted")


main(drill)
