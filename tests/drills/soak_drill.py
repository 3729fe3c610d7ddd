#!/usr/bin/env python3
"""soak_drill.py PROGRAM [SECONDS [CSV]]: four actors, an evaluator and nothing else for an hour.

Passes if, after the table is full, neither memory nor descriptors of any process nor the policy lag grow.
"""

import statistics
import time

from service import Service, check, main, wait_for


def drill(program, seconds="3600", csv=None):
    seconds = float(seconds)
    samples = []
    with Service(program, environments=8, capacity=50000, more_config="[evaluator_service]\ninterval = 30.0\n") as service:
        service.add("replay")
        service.add("learner")
        service.add("evaluator")
        for i in range(4):
            service.add("actor", f"actor-{i}")
        for process in service.processes:
            process.start()
        wait_for("a full table", lambda: service.figure("replay", "replay", "table_rows") >= 49000, 1800.0)
        wait_for("a scored policy", lambda: service.figure("evaluator", "evaluator", "evaluations") >= 1, 900.0)
        began = time.monotonic()
        while time.monotonic() - began < seconds:
            status = wait_for("the status", service.status, 300.0)  # The machine may have other work, too.
            learner = status[("learner", "learner")]["figures"]
            lag = learner["policy_version"] - min(
                v["figures"]["policy_version"] for (role, _), v in status.items() if role == "actor")
            samples.append((time.monotonic() - began, lag, status[("replay", "replay")]["figures"]["steps"], learner["updates"],
                            {p.name: (p.resident_mib(), p.num_descriptors()) for p in service.processes}))
            for process in service.processes:
                process.check_alive()
            time.sleep(min(10.0, seconds / 20))
    names = list(samples[0][4])
    if csv:
        with open(csv, "w") as file:
            file.write("seconds,lag_versions,steps,updates," + ",".join(f"{n}_mib,{n}_descriptors" for n in names) + "\n")
            for t, lag, steps, updates, each in samples:
                file.write(f"{t:.0f},{lag:.0f},{steps:.0f},{updates:.0f}," + ",".join(f"{each[n][0]:.1f},{each[n][1]}" for n in names) + "\n")
    third = max(1, len(samples) // 3)
    first, last = samples[:third], samples[-third:]
    for name in names:
        memory = [statistics.median(s[4][name][0] for s in part) for part in (first, last)]
        descriptors = [statistics.median(s[4][name][1] for s in part) for part in (first, last)]
        print(f"{name}: {memory[0]:.0f} -> {memory[1]:.0f} MiB, {descriptors[0]:.0f} -> {descriptors[1]:.0f} descriptors")
        check(memory[1] < memory[0] * 1.05 + 8, f"{name}'s memory grew from {memory[0]:.0f} to {memory[1]:.0f} MiB")
        check(descriptors[1] <= descriptors[0] + 4, f"{name}'s descriptors grew from {descriptors[0]:.0f} to {descriptors[1]:.0f}")
    lags = [statistics.median(s[1] for s in part) for part in (first, last)]
    rates = [(part[-1][3] - part[0][3]) / max(1.0, part[-1][0] - part[0][0]) for part in (first, last)]
    print(f"policy lag {lags[0]:.0f} -> {lags[1]:.0f} updates, of {rates[0]:.0f} -> {rates[1]:.0f} a second; "
          f"{samples[-1][2]:.0f} steps, {samples[-1][3]:.0f} updates in {samples[-1][0] / 60:.0f} min")
    # Both versions come from reports that are up to a second old: some thousand updates of noise.
    check(lags[1] < lags[0] + 3000, f"the policy lag grew from {lags[0]} to {lags[1]}")


main(drill)
