#!/usr/bin/env python3
"""restart_drill.py PROGRAM [ROUNDS [SEED]]: actors stopped and killed while the replay server holds their rows.

In each round an actor is stopped, which leaves a spool, and started again: in every other round after the server has let in all that
it held, else with kills -9 while the spool is sent. Passes if each actor makes steps again after each round, and no step is lost or
counted twice.
"""

import random
import re
import signal
import time

from service import Service, check, check_accounts, final_account, main, wait_for

HAS_A_SESSION = re.compile(r"session \d+ with the replay server")


def drill(program, rounds="10", seed="1"):
    draw = random.Random(int(seed))
    # So many updates for each step that the learner cannot keep up, as with the paper's networks.
    with Service(program, environments=8, updates_per_step=2.0, max_ahead=64, learning_starts=500,
                 more_config="[actor_service]\nchunk_rows = 64\n") as service:
        replay = service.add("replay", extra=["--set", "replay_server.window_bytes=1048576"]).start()
        learner = service.add("learner").start()
        actors = [service.add("actor", f"actor-{i}").start() for i in range(2)]
        wait_for("inserts that are held", lambda: service.figure("learner", "learner", "updates") > 0 and
                 replay.metric("slalom_queue_depth", queue="inserts") > 0, 120.0)
        spooled, kills, may_lose = 0, 0, set()

        for number in range(int(rounds)):
            actor = actors[number % 2]
            actor.process.terminate()
            if number % 2 == 0:
                time.sleep(0.7)  # Some of its rows are let in, so that the last of them are sent, too.
            # While the learner stands still, the server holds the rest.
            learner.process.send_signal(signal.SIGSTOP)
            code = actor.process.wait(timeout=5.0)
            actor.process = None
            check(code == 0, f"{actor.name} ended with {code}: {actor.log_text()[-1500:]}")
            made, _, kept, _ = final_account(actor)
            spooled += kept
            if number % 2 == 0:
                steps = service.figure("replay", "replay", "steps")
                learner.process.send_signal(signal.SIGCONT)
                # First come, first let in; the other actor sends as much.
                wait_for("inserts that go on", lambda: service.figure("replay", "replay", "steps") > steps + 3 * kept)
            for _ in range(draw.randint(2, 3) if number % 2 == 1 else 0):
                actor.start()
                learner.process.send_signal(signal.SIGCONT)
                wait_for(f"an acknowledgement of {actor.name}'s spool", lambda: actor.metric("slalom_chunks_acknowledged_total") > 0)
                learner.process.send_signal(signal.SIGSTOP)
                actor.kill()
                if HAS_A_SESSION.search(actor.log_text()):
                    may_lose.add(actor)
                else:
                    kills += 1
            learner.process.send_signal(signal.SIGCONT)
            began = time.monotonic()
            actor.start()
            wait_for(f"steps of {actor.name} after round {number + 1}", lambda: service.figure("actor", actor.name, "steps_made") > made)
            seconds = time.monotonic() - began
            for other in actors:
                before = service.figure("actor", other.name, "steps_made")
                wait_for(f"steps of {other.name}", lambda: service.figure("actor", other.name, "steps_made") > before)
                # By reason, as what is counted twice is lost by the server and won by the kill.
                for reason in ["server", "replaced"] + ["killed"] * (other not in may_lose):
                    lost = other.metric("slalom_steps_lost_total", reason=reason)
                    check(lost == 0, f"{other.name} counts {lost:.0f} steps as lost ({reason})")
            for process in service.processes:
                process.check_alive()
            print(f"round {number + 1}: {actor.name} kept {kept} steps and made new ones {seconds:.1f} s after its start", flush=True)

        check(spooled > 0, "no step went by way of a spool")
        made, lost = check_accounts(service)
        check(lost == 0 or may_lose, f"{lost} steps lost")
        print(f"{rounds} rounds, {kills} kills while a spool was sent; {made} steps made, {spooled} went by way of a spool, "
              f"{lost} lost with actors that were killed while they drove, 0 unaccounted")


main(drill)
