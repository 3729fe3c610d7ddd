#!/usr/bin/env python3
"""upgrade_drill.py PROGRAM [EARLIER]: a service of an earlier program is upgraded role by role while it trains, and back.

EARLIER: the program of another commit, so that every pair of versions meets on the wire and in the files; without it the same program
takes its own place. Passes if after each change every actor makes new steps and the learner new updates, the learner goes on from its
checkpoint and the server from its journal, and every step is accepted or kept, the same on both sides.
"""

import re

from service import Service, check, check_accounts, main, wait_for


def drill(program, earlier=None):
    with Service(earlier or program) as service:
        replay = service.add("replay").start()
        learner = service.add("learner").start()
        actors = [service.add("actor", f"actor-{i}").start() for i in range(2)]
        roles = [replay, learner, *actors]

        def figures():
            return [service.figure("learner", "learner", "updates")] + [service.figure("actor", a.name, "steps_made") for a in actors]

        def goes_on(what):
            before = wait_for(f"figures {what}", figures)
            wait_for(f"updates and steps of each actor {what}", lambda: all(now > then for now, then in zip(figures(), before)), 60.0)

        wait_for("the first 100 updates", lambda: service.figure("learner", "learner", "updates") >= 100)
        for way, to, order in (("to", program, roles), ("back to", earlier or program, roles[::-1])):
            for role in order:
                steps = service.figure("replay", "replay", "steps")
                code, _ = role.stop(15.0)
                check(code == 0, f"{role.name} ended with {code}: {role.log_text()[-1500:]}")
                role.program = to
                role.start()
                goes_on(f"after {role.name} went {way} the other program")
                check(service.figure("replay", "replay", "steps") >= steps, f"{role.name}: steps were forgotten")
                if role is learner:
                    check(re.search(r"resumed from .* [1-9]\d* updates", role.log_text()), f"the learner began again: {role.log_text()[:2000]}")
                print(f"{way} the other program: {role.name}", flush=True)
        made, lost = check_accounts(service)
        check(lost == 0, f"{lost} steps lost")
        print(f"{2 * len(roles)} changes of program, {made} steps made, 0 lost, the same on both sides")


main(drill)
