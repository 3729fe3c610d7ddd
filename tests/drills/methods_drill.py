#!/usr/bin/env python3
"""methods_drill.py PROGRAM [PRESET...]: each method trains a little over the service, by its preset.

Passes if both actors of each drive with a policy of many updates, their accounts and the server's agree to the step, models imagine
or plan where the preset says so, a policy goes to actors with its model only if they plan, and the policy that the run saves is
scored.
"""

import csv
import json
import os
import subprocess

from service import Service, check, check_accounts, main, wait_for

PRESETS = ["td3-mlp", "td3-gru-h4", "sac-mlp", "lagrangian-mlp", "dyna-deterministic-mlp", "dyna-probabilistic-mlp", "mbpo-mlp",
           "mpc-deterministic-mlp", "mpc-probabilistic-mlp"]

UPDATES = 200  # Of the policies that the actors must come to drive with.

# Models imagine and plan before the end. Fewer sequences than the presets' leave time for steps.
EARLY = """
[imagination]
learning_starts = 50
[mpc]
learning_starts = 50
samples = 16
"""


def sizes(policy):
    """Bytes of a policy's tensors: of the actor, and of all."""
    with open(policy, "rb") as file:
        header = json.loads(file.read(int.from_bytes(file.read(8), "little")))
    header.pop("__metadata__")
    lengths = {name: end - begin for name, (begin, end) in ((n, t["data_offsets"]) for n, t in header.items())}
    return sum(n for name, n in lengths.items() if name.startswith("actor.")), sum(lengths.values())


def imagined(run):
    """Transitions that the run has imagined, by the last row of metrics.csv that tells."""
    with open(os.path.join(run, "metrics.csv"), newline="") as file:
        told = [row["imagined_transitions"] for row in csv.DictReader(file) if row["imagined_transitions"]]
    return float(told[-1]) if told else 0.0


def train(program, preset):
    plans, imagines = preset.startswith("mpc"), preset.startswith(("dyna", "mbpo"))
    with Service(program, preset=f"configs/fast/{preset}.toml", environments=8, updates_per_step=0.25, capacity=20000, max_ahead=1024,
                 learning_starts=500, more_config=EARLY) as service:
        run = os.path.join(service.state, "learner")
        replay = service.add("replay").start()
        learner = service.add("learner", extra=["--set", "run.log_interval=0.2"]).start()
        actors = [service.add("actor", f"actor-{i}").start() for i in range(2)]
        for actor in actors:
            wait_for(f"{preset}: a policy of {UPDATES} updates at {actor.name}",
                     lambda actor=actor: actor.metric("slalom_policy_version") >= UPDATES, 120.0)
        if imagines:
            wait_for(f"{preset}: imagined transitions", lambda: imagined(run) > 0.0)
        sent = learner.metric("slalom_policy_bytes")
        for process in service.processes:
            process.check_alive()
        made, lost = check_accounts(service)
        check(lost == 0, f"{preset}: {lost} steps lost")
        code, _ = replay.stop()
        check(code == 0, f"{preset}: the replay server ended with {code}")

        policy = os.path.join(run, "policy.safetensors")
        of_actor, of_all = sizes(policy)
        check((of_all > of_actor) == (plans or imagines), f"{preset}: {of_all} bytes of tensors, {of_actor} of them the actor's")
        check((sent >= of_all) if plans else (of_actor <= sent < of_actor + 20000),
              f"{preset}: policies of {sent} bytes went to the actors; tensors have {of_all} bytes, the actor's {of_actor}")
        scored = subprocess.run([program, "evaluate", "--policy", policy, "--courses", "generated:3:2", "--set", "evaluation.episodes_per_course=1",
                                 "--output", os.path.join(service.directory, "scores")], capture_output=True, text=True, check=False)
        check(scored.returncode == 0, f"{preset}: {scored.stderr}")
        print(f"{preset}: {made} steps made, 0 lost; {of_all} bytes of tensors saved, {sent:.0f} bytes sent to an actor", flush=True)


def drill(program, *presets):
    for preset in presets or PRESETS:
        train(program, preset)


main(drill)
