#!/usr/bin/env python3
"""shards_drill.py PROGRAM [KILLS [SEED]]: two replay servers, of which one is down, stopped, without disk or killed. The disk needs root.

Passes if learning goes on from the other one each time and says so, the one that comes back is drawn from again, every step that an
actor ever made is accepted or counted as lost, the same on both sides, and the policy still learns to drive.
"""

import os
import random
import signal
import statistics
import subprocess
import sys
import time

from service import Service, check, check_accounts, fill, main, mount, said_lost, wait_for


def drill(program, kills="10", seed="1"):
    if os.geteuid() != 0:
        print("SKIPPED: mounting a small file system needs root")
        sys.exit(77)
    draw = random.Random(int(seed))
    with Service(program, servers=2, capacity=20000) as service:
        disk = os.path.join(service.state, "replay-1")
        mount(disk, 200)
        try:
            servers = [service.add("replay", "replay"),
                       service.add("replay", "replay-1", extra=("--set", "replay_server.segment_bytes=4194304"))]
            learner = service.add("learner")
            actors = [service.add("actor", f"actor-{i}") for i in range(2)]
            for process in service.processes:
                process.start()

            def drawn(server):
                """Batches that it has sent since its start."""
                try:
                    return server.metric("slalom_batches_total")
                except (OSError, ValueError, KeyError):
                    return 0.0  # It does not show its metrics yet.

            def goes_on(what, *more):
                """Waits until the learner has made 200 updates and `more` servers have sent batches since now."""
                updates = wait_for("the learner's updates", lambda: learner.metric("slalom_updates_total"))
                sent = [drawn(server) for server in more]
                wait_for(f"updates {what}", lambda: learner.metric("slalom_updates_total") >= updates + 200 and
                         all(drawn(server) > before for server, before in zip(more, sent)), 60.0)

            wait_for("the first updates", lambda: learner.metric("slalom_updates_total") >= 300)
            goes_on("from both", *servers)

            # Down: its batches are missed, its actor waits.
            servers[1].kill()
            goes_on("with one server down")
            wait_for("the learner's warning", lambda: "no replay server answers at" in learner.log_text())
            check(learner.health() == "ok", f"the learner says that it is not well: {learner.health()}")
            gone = [r for (role, _), r in service.status().items() if role == "replay" and not r["connected"]]
            check(len(gone) == 1, f"the status does not show the server that is down: {gone}")
            servers[1].start()
            goes_on("after its start", *servers)
            wait_for("the learner's word that it is back", lambda: "answers again" in learner.log_text())
            print("down and back", flush=True)

            # Stopped: it answers nothing, and its connections stay.
            servers[1].process.send_signal(signal.SIGSTOP)
            for _ in range(3):
                goes_on("with one server stopped")
                time.sleep(2.0)
            servers[1].process.send_signal(signal.SIGCONT)
            goes_on("once it runs again", *servers)
            print("stopped and back", flush=True)

            # Its disk is full: it accepts nothing, and goes on sending what it holds as far as that was earned.
            filler = fill(disk)
            wait_for("the journal's failing", lambda: servers[1].metric("slalom_journal_failing") == 1, 120.0)
            goes_on("with one disk full")
            os.remove(filler)
            wait_for("the journal's recovery", lambda: servers[1].metric("slalom_journal_failing") == 0, 90.0)
            goes_on("with space again", *servers)
            print("disk full and back", flush=True)

            for number in range(int(kills)):
                time.sleep(draw.uniform(0.2, 2.0))
                victim = draw.choice([*servers, learner, *actors])
                victim.kill()
                victim.start()
                goes_on(f"after kill {number + 1}, of {victim.name}", *servers)
                for process in service.processes:
                    process.check_alive()
            wait_for("a policy that drives", lambda: statistics.mean(a.metric("slalom_success_rate") for a in actors) > 0.5, 240.0)
            made, lost = check_accounts(service)
            said = sum(map(said_lost, actors))
            check(said == lost, f"{lost} steps are lost, and the actors' logs speak of {said}")
            for server in servers:
                code, _ = server.stop()
                check(code == 0, f"{server.name} ended with {code}")
            print(f"{made} steps made, {made - lost} accepted or still kept, {lost} lost with the actors that were killed, 0 unaccounted")
        finally:
            for process in service.processes:
                if process.process is not None:
                    process.kill()
            subprocess.run(["umount", "-l", disk], check=False)


main(drill)
