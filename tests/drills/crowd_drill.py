#!/usr/bin/env python3
"""crowd_drill.py PROGRAM [ACTORS [SECONDS [CSV]]]: many more actors than cores, a learner that stands still, a replay server that does.

Passes if the memory of every process stays bounded while what comes in cannot be taken, and the rates settle when it can. Writes
the memory of replay server, learner and the largest actor and the steps accepted over time to CSV, which crowd_curve.gnuplot draws.
"""

import math
import signal
import time

from service import Service, check, main, wait_for

STILL = "replay server stands still"


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
                accepted = math.nan if phase == STILL else replay.metric("slalom_steps_accepted_total")
                rows.append((time.monotonic() - began, phase, replay.resident_mib(), learner.resident_mib(),
                             max(a.resident_mib() for a in crowd), accepted))
                time.sleep(0.5)

        def rates_over(window):
            """Steps and updates a second."""
            def look():
                return (replay.metric("slalom_steps_accepted_total"), learner.metric("slalom_updates_total"), time.monotonic())
            before = look()
            time.sleep(window)
            steps, updates, seconds = (b - a for a, b in zip(before, look()))
            return steps / seconds, updates / seconds

        wait_for("steps of all actors",
                 lambda: sum(r[0] == "actor" and v["figures"]["steps_made"] > 0 for r, v in service.status().items()) == len(crowd), 300.0)
        wait_for("updates", lambda: service.figure("learner", "learner", "updates") > 100, 120.0)
        watch("all run", seconds)
        learner.process.send_signal(signal.SIGSTOP)
        watch("learner stands still", seconds)
        learner.process.send_signal(signal.SIGCONT)
        watch("all run again", seconds)
        replay.process.send_signal(signal.SIGSTOP)
        watch(STILL, seconds)
        replay.process.send_signal(signal.SIGCONT)
        watch("all run at the end", seconds)
        # Settled: two windows one after the other see about the same, as far as a busy machine lets them.
        rates = [rates_over(8.0) for _ in range(2)]
        check(all(rate > 0 for pair in rates for rate in pair), f"{rates} steps/s and updates/s at the end")
        check(all(max(pair) < 3.0 * min(pair) for pair in zip(*rates)), f"{rates} steps/s and updates/s at the end have not settled")
        for process in service.processes:
            process.check_alive()
    if csv:
        with open(csv, "w") as file:
            file.write("seconds,phase,replay_mib,learner_mib,largest_actor_mib,steps_accepted\n")
            file.writelines(f"{t:.1f},{phase},{a:.0f},{b:.0f},{c:.0f},{'' if math.isnan(s) else int(s)}\n" for t, phase, a, b, c, s in rows)
    first = [row for row in rows if row[1] == "all run"]
    for column, name, limit in ((2, "replay server", 120), (3, "learner", 60), (4, "largest actor", 40)):
        start, highest = max(row[column] for row in first), max(row[column] for row in rows)
        print(f"{name}: at most {start:.0f} MiB at first, {highest:.0f} MiB in all")
        # A table that is still filling grows by what its rows take; beyond that only buffers, which are bounded.
        check(highest < start + limit, f"{name} grew from {start:.0f} to {highest:.0f} MiB")
    print(f"{len(crowd)} actors at the end, twice 8 s: " + ", then ".join(f"{s:.0f} steps/s, {u:.0f} updates/s" for s, u in rates))


main(drill)
