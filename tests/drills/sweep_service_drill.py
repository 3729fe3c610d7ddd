#!/usr/bin/env python3
"""sweep_service_drill.py PROGRAM [KILLS [SEED]]: kill -9 of a sweep that trains by services, and of the services' processes.

A worker trains two cells, each by a replay server, a learner and two actors. Passes if no process outlives its worker, and if in
the end each cell has the files of a cell that one process trained, with the steps, updates and snapshots of its plan.
"""

import json
import os
import pathlib
import random
import signal
import subprocess
import tempfile
import time

import service
import sweep_drill
from service import check, wait_for
from sweep_drill import MAX_STEPS, STARTS, UPDATES_PER_STEP

AHEAD = 1024

PRESET = f"""{sweep_drill.PRESET}
[replay_server]
max_ahead_steps = {AHEAD}
"""

PLAN = """
[sweep]
preset = "preset.toml"
seeds = [1, 2]
trainer = "{trainer}"
lockstep = false
checkpoint_steps = 4000
[[score]]
name = "test"
courses = "generated:3:20"
episodes = 2
snapshots = true
"""


def processes(text):
    """Ids of the processes with this text in their command lines."""
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                if text in (entry / "cmdline").read_text(errors="replace"):
                    found.append(int(entry.name))
            except OSError:
                pass  # It has ended.
    return found


def files(cell):
    """A cell's files, by names that do not depend on times and numbers."""
    names = set()
    for path in cell.rglob("*"):
        name = str(path.relative_to(cell))
        if path.is_file() and not name.startswith(("run/events.out", "run/snapshots/")):
            names.add(name)
    return names


def main(program, kills="6", seed="1"):
    program = os.path.abspath(program)
    draw = random.Random(int(seed))
    with tempfile.TemporaryDirectory(prefix="slalom-sweep-service-") as name:
        directory = pathlib.Path(name)
        (directory / "preset.toml").write_text(PRESET)
        log = directory / "log.txt"

        def worker(trainer, store):
            plan = directory / f"{trainer}.toml"
            plan.write_text(PLAN.format(trainer=trainer))
            return subprocess.Popen([program, "sweep", "run", str(plan), "--output", str(directory / store), "--at-once", "1"],
                                    stdout=subprocess.DEVNULL, stderr=log.open("a"))

        def members():
            return processes(str(directory / "served"))

        check(worker("process", "alone").wait() == 0, log.read_text())
        served, num_kills, num_orphaned = worker("service", "served"), 0, 0
        while num_kills < int(kills):
            roles = wait_for("a replay server, a learner and two actors, or the end",
                             lambda: served.poll() is not None or (len(found := members()) == 5 and found))
            if roles is True:
                break  # The sweep has ended before this kill.
            time.sleep(draw.uniform(0.0, 2.0))
            num_kills += 1
            if num_kills % 3 == 0:
                num_orphaned += len([p for p in members() if p != served.pid])
                served.kill()
                served.wait()
                wait_for("the end of the worker's children", lambda: not members(), 10.0)
                served = worker("service", "served")
                continue
            victim = draw.choice([p for p in roles if p != served.pid])
            try:
                os.kill(victim, signal.SIGKILL)
            except ProcessLookupError:
                pass
        check(served.wait() == 0, log.read_text())
        check(not members(), "processes are left")

        alone = sorted((directory / "alone/cells").iterdir())
        cells = sorted((directory / "served/cells").iterdir())
        check(len(alone) == len(cells) == 2 and not {c.name for c in alone} & {c.name for c in cells}, "two cells, with ids of their own")
        for cell in cells:
            check(files(cell) == files(alone[0]), f"other files: {sorted(files(cell) ^ files(alone[0]))}")
            trained = json.loads((cell / "trained.json").read_text())
            check(MAX_STEPS <= trained["steps"] <= MAX_STEPS + 2 * AHEAD, f"{trained['steps']} steps")
            earned = UPDATES_PER_STEP * (MAX_STEPS - STARTS)
            check(0 <= trained["updates"] - int(earned) <= 2, f"{trained['updates']} updates, {earned} are earned")
            check(len(list((cell / "run/snapshots").iterdir())) >= 1, "a snapshot")
        print(f"{num_kills} kills: each cell has {len(files(cells[0]))} files, those of a cell that one process trained, and its "
              f"{MAX_STEPS} steps; {num_orphaned} processes ended with their workers")


service.main(main)
