#!/usr/bin/env python3
"""crowd_drill.py PROGRAM [ACTORS [SECONDS [CSV]]]: many more actors than cores, a learner that stands still, a replay server that does.

Passes if the memory of every process stays bounded while what comes in cannot be taken, and the rates settle when it can. Writes
the memory of replay server, learner and the largest actor over time to CSV.
"""

import signal
import time

from service import Service, check, main, wait_for


def drill(program, actors="64", seconds="20", csv=None):
    seconds = float(seconds)
    rows = []
    with Service(program, environments=4, capacity=50000, max_ahead=10000,
                 more_config="[actor_service]\nunacknowledged_bytes = 2097152\n") as service:
        replay = service.add("replay").start()
        learner = service.add("learner").start()
        crowd = [service.add("actor", f"actor-{i:02}").start() for i in range(int(actors))]
        began = time.monotonic()

        def watch(phase, duration):
            end = time.monotonic() + duration
            while time.monotonic() < end:
                rows.append((time.monotonic() - began, phase, replay.resident_mib(), learner.resident_mib(),
                             max(a.resident_mib() for a in crowd)))
                time.sleep(0.5)

        wait_for("steps of all actors",
                 lambda: sum(r[0] == "actor" and v["figures"]["steps_made"] > 0 for r, v in service.status().items()) == len(crowd), 300.0)
        wait_for("updates", lambda: service.figure("learner", "learner", "updates") > 100, 120.0)
        watch("all run", seconds)
        learner.process.send_signal(signal.SIGSTOP)
        watch("learner stands still", seconds)
        learner.process.send_signal(signal.SIGCONT)
        watch("all run again", seconds)
        replay.process.send_signal(signal.SIGSTOP)
        watch("replay server stands still", seconds)
        replay.process.send_signal(signal.SIGCONT)
        watch("all run at the end", seconds)
        before = service.figure("replay", "replay", "steps"), service.figure("learner", "learner", "updates"), time.monotonic()
        time.sleep(5.0)
        rate = (service.figure("replay", "replay", "steps") - before[0]) / (time.monotonic() - before[2])
        updates = (service.figure("learner", "learner", "updates") - before[1]) / (time.monotonic() - before[2])
        check(rate > 0 and updates > 0, f"{rate} steps/s, {updates} updates/s at the end")
        for process in service.processes:
            process.check_alive()
    if csv:
        with open(csv, "w") as file:
            file.write("seconds,phase,replay_mib,learner_mib,largest_actor_mib\n")
            file.writelines(f"{t:.1f},{phase},{a:.0f},{b:.0f},{c:.0f}\n" for t, phase, a, b, c in rows)
    first = [row for row in rows if row[1] == "all run"]
    for column, name, limit in ((2, "replay server", 120), (3, "learner", 60), (4, "largest actor", 40)):
        start, highest = max(row[column] for row in first), max(row[column] for row in rows)
        print(f"{name}: at most {start:.0f} MiB at first, {highest:.0f} MiB in all")
        # A table that is still filling grows by what its rows take; beyond that only buffers, which are bounded.
        check(highest < start + limit, f"{name} grew from {start:.0f} to {highest:.0f} MiB")
    print(f"{len(crowd)} actors at the end: {rate:.0f} steps/s, {updates:.0f} updates/s")


main(drill)
