#!/usr/bin/env python3
"""stop_drill.py PROGRAM [ROUNDS [SEED]]: SIGTERM everywhere in the middle of work, in any order.

Passes if every process ends within 5 s with exit code 0, no step is lost, and what is started again goes on.
"""

import random
import re
import time

from service import Service, check, final_account, main, wait_for


def drill(program, rounds="5", seed="1"):
    draw = random.Random(int(seed))
    with Service(program, environments=8) as service:
        roles = [service.add("replay"), service.add("learner"), service.add("actor", "actor-0"), service.add("actor", "actor-1"),
                 service.add("evaluator")]
        slowest, kept, updates, steps = 0.0, 0, 0, 0
        for number in range(int(rounds)):
            order = draw.sample(roles, len(roles))
            for process in order:
                process.start()
            wait_for("updates that go on", lambda: service.figure("learner", "learner", "updates") > updates + 200)
            wait_for("steps that go on", lambda: service.figure("replay", "replay", "steps") > steps)
            time.sleep(draw.uniform(0.0, 2.0))
            steps = service.figure("replay", "replay", "steps")
            updates = service.figure("learner", "learner", "updates")
            # All at once, as when a machine is shut down.
            began = time.monotonic()
            for process in draw.sample(roles, len(roles)):
                process.process.terminate()
            for process in roles:
                code = process.process.wait(timeout=30)
                seconds = time.monotonic() - began
                slowest = max(slowest, seconds)
                check(code == 0, f"{process.name} ended with {code}: {process.log_text()[-1500:]}")
                check(seconds < 5.0, f"{process.name} took {seconds:.1f} s to end")
                process.process = None
            accounts = [final_account(p) for p in roles if p.role == "actor"]
            for _, _, _, lost in accounts:
                check(lost == 0, f"{lost} steps lost by a clean stop")
            kept += sum(a[2] for a in accounts)
            resumed = [int(x) for x in re.findall(r"resumed from .* (\d+) updates", roles[1].log_text())]
            print(f"round {number + 1}: all ended after {time.monotonic() - began:.1f} s; kept in spools: "
                  f"{sum(a[2] for a in accounts)} steps; the learner had resumed at {resumed or 'nothing'}", flush=True)
        print(f"{rounds} rounds, slowest end {slowest:.1f} s, 0 steps lost, {kept} steps went by way of a spool")


main(drill)
