#!/usr/bin/env python3
"""service_figures.py PROGRAM [FIGURE...]: what the service of real processes on this machine reaches; see docs/results/service.md.

FIGURE is recovery, sync, policies, scale or sessions; all of them unless told. Nothing passes or fails here: it prints medians, and what else
the machine was doing (its load average before, without these processes). Figures are read from the processes' metrics pages, which are
asked for every 10 ms.
"""

import os
import re
import resource
import statistics
import subprocess
import sys
import threading
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "tests", "drills"))
from service import Service, wait_for  # noqa: E402

ROWS = 1_000_000


def metric(process, name):
    """A metric's value; 0 where the process does not answer (yet)."""
    try:
        return process.metric(name)
    except (OSError, ValueError, KeyError):
        return 0.0


def until(condition, limit_s=600.0):
    """Seconds until it is true."""
    began = time.monotonic()
    while not condition():
        if time.monotonic() - began > limit_s:
            sys.exit("it did not come")
        time.sleep(0.01)
    return time.monotonic() - began


def load():
    return "load average before: " + " ".join(open("/proc/loadavg").read().split()[:3])


def summary(times):
    return f"median {statistics.median(times):.2f} s, longest {max(times):.2f} s of {len(times)}"


def full_service(program, rows, replay_options=()):
    """Replay server with a full table of `rows`, learner, two actors, at work. Nobody learns before the table is full."""
    service = Service(program, capacity=rows, environments=32, learning_starts=rows)
    roles = [service.add("replay", extra=replay_options), service.add("learner"), service.add("actor", "actor-0"), service.add("actor", "actor-1")]
    for role in roles:
        role.start()
    seconds = until(lambda: metric(roles[0], "slalom_table_rows") >= rows, 3600.0)
    until(lambda: metric(roles[1], "slalom_batches_total") > 100)
    print(f"  a table of {rows} rows after {seconds:.0f} s", flush=True)
    return service, roles


def recovery(program, rounds=5):
    """From the start after a `kill -9` until the role does its work again."""
    print(f"recovery ({load()})", flush=True)
    service, (replay, learner, first, second) = full_service(program, ROWS)
    with service:
        times = {"actor": [], "replay": [], "learner": []}
        for _ in range(rounds):
            for victim in (first, replay, learner):
                time.sleep(3.0)
                began = time.monotonic()
                victim.kill()
                victim.start()
                time.sleep(0.1)  # What was on its way has come.
                before = metric(learner, "slalom_batches_total"), metric(second, "slalom_chunks_acknowledged_total")
                if victim is first:  # It made a chunk of rows and sent it.
                    goes_on = lambda: metric(first, "slalom_chunks_sent_total") > 0
                elif victim is learner:  # It learned from a batch.
                    goes_on = lambda: metric(learner, "slalom_batches_total") > 0
                else:  # It gives batches and acknowledges chunks.
                    goes_on = lambda: (metric(learner, "slalom_batches_total") > before[0]
                                       and metric(second, "slalom_chunks_acknowledged_total") > before[1])
                until(goes_on)
                times[victim.role].append(time.monotonic() - began)
        for role, all_of_it in times.items():
            print(f"  {role}: at work again after {summary(all_of_it)}", flush=True)


def sync(program, rounds=3):
    """Batches and chunks per second before and during an fdatasync of a million rows, which the server had not synced before."""
    print(f"sync of a million rows ({load()})", flush=True)
    shares = {"batches": [], "chunks": []}
    for _ in range(rounds):
        service, (replay, learner, first, second) = full_service(program, ROWS, ["--set", "replay_server.sync_interval=3600"])
        with service:
            samples = []

            def look():
                samples.append((time.monotonic(), metric(learner, "slalom_batches_total"),
                                metric(first, "slalom_chunks_acknowledged_total") + metric(second, "slalom_chunks_acknowledged_total")))
                time.sleep(0.02)

            begin = time.monotonic()
            while time.monotonic() - begin < 10.0:
                look()
            syncing = time.monotonic()
            directory = os.path.join(service.state, "replay")
            pid = os.fork()
            if pid == 0:
                for name in sorted(os.listdir(directory)):
                    if name.endswith(".log"):
                        os.fdatasync(os.open(os.path.join(directory, name), os.O_RDONLY))
                os._exit(0)
            while os.waitpid(pid, os.WNOHANG) == (0, 0):
                look()
            done = time.monotonic()
            look()

        def rate(column, since, until_then):
            inside = [s for s in samples if since <= s[0] <= until_then]
            return (inside[-1][column] - inside[0][column]) / (inside[-1][0] - inside[0][0])

        for column, (name, all_of_it) in enumerate(shares.items(), 1):
            before, during = rate(column, begin, syncing), rate(column, syncing, samples[-1][0])
            all_of_it.append(100.0 * during / before)
            print(f"  {name}/s: {before:.0f} before, {during:.0f} during the sync of {done - syncing:.1f} s", flush=True)
    for name, all_of_it in shares.items():
        print(f"  {name}: {statistics.median(all_of_it):.0f} % (from {min(all_of_it):.0f} to {max(all_of_it):.0f})", flush=True)


def policies(program, actors=8, seconds=30.0):
    """From a policy's publication until an actor drives with it, by the actors' histogram."""
    print(f"publish to acting in {actors} actors ({load()})", flush=True)
    with Service(program, environments=4) as service:
        service.add("replay").start()
        learner = service.add("learner").start()
        crowd = [service.add("actor", f"actor-{i}").start() for i in range(actors)]
        wait_for("updates", lambda: metric(learner, "slalom_batches_total") > 300, 300.0)

        def buckets():
            total = {}
            for actor in crowd:
                for key, value in actor.metrics().items():
                    found = re.match(r"slalom_publish_to_acting_seconds_bucket\{.*le=\"([^\"]+)\"", key)
                    if found:
                        bound = float(found.group(1))
                        total[bound] = total.get(bound, 0.0) + value
            return total

        before = buckets()
        time.sleep(seconds)
        counts = {bound: value - before[bound] for bound, value in buckets().items()}
        number = counts[float("inf")]
        print(f"  {number:.0f} policies taken over in {seconds:.0f} s", flush=True)
        for share in (0.5, 0.9, 0.99):
            bound = min(b for b, c in counts.items() if c >= share * number)
            print(f"  p{100 * share:.0f}: at most {1000 * bound:.0f} ms", flush=True)


def scale(program, seconds=10.0, rounds=3):
    """Environment steps per second of 1, 2 and 4 actors while nobody learns."""
    print(f"actors ({load()}, {os.cpu_count()} cores)", flush=True)
    with Service(program, capacity=100000, environments=64, learning_starts=10**9) as service:
        service.add("replay").start()
        service.add("learner").start()
        crowd = [service.add("actor", f"actor-{i}") for i in range(4)]
        rates = {1: [], 2: [], 4: []}
        for _ in range(rounds):
            for number in rates:
                running = [actor.start() for actor in crowd[:number]]
                for actor in running:
                    until(lambda: metric(actor, "slalom_chunks_acknowledged_total") > 0)
                name = "slalom_steps_sent_total"
                begin, before = time.monotonic(), sum(metric(actor, name) for actor in running)
                time.sleep(seconds)
                rates[number].append((sum(metric(actor, name) for actor in running) - before) / (time.monotonic() - begin))
                for actor in running:
                    actor.stop(20.0)
        for number, all_of_it in rates.items():
            print(f"  {number}: {statistics.median(all_of_it):.0f} steps/s (from {min(all_of_it):.0f} to {max(all_of_it):.0f})", flush=True)


def sessions(program, number=1000, processes=4, seconds=40):
    """Many sessions of actors by their protocol, 50 frames/s each, before and after a death of the replay server."""
    print(f"{number} sessions ({load()})", flush=True)
    driver = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(program))), "benchmarks", "sessions")
    resource.setrlimit(resource.RLIMIT_NOFILE, (resource.getrlimit(resource.RLIMIT_NOFILE)[1],) * 2)
    # A policy a second: 1,000 readers of one every 20 ms would fill the network. Nothing is held back.
    with Service(program, capacity=200000, updates_per_step=0.001, max_ahead=0,
                 more_config="[learner_service]\npublish_seconds = 1.0\n") as service:
        # Room for two chunks of each; by default all share 4 MiB.
        replay = service.add("replay", extra=("--set", "replay_server.window_bytes=33554432")).start()
        learner = service.add("learner").start()
        wait_for("the learner", lambda: "policies at" in learner.log_text())
        empty = replay.resident_mib(), replay.num_descriptors()
        crowd = [subprocess.Popen([driver, service.config, str(i * number // processes), str(number // processes), str(seconds)],
                                  stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) for i in range(processes)]
        connected, lines = [0] * len(crowd), [0] * len(crowd)
        results = [[] for _ in crowd]

        def follow(i):
            for line in crowd[i].stdout:
                words = line.split()
                if words[0].isdigit():
                    connected[i], lines[i] = int(words[1]), lines[i] + 1
                else:
                    results[i].append(words)

        threads = [threading.Thread(target=follow, args=(i,)) for i in range(len(crowd))]
        for thread in threads:
            thread.start()
        def all_are_connected():
            if any(process.poll() for process in crowd):
                sys.exit(f"{driver} failed")
            return sum(connected) == number

        print(f"  all connected after {until(all_are_connected):.1f} s", flush=True)
        wait_for("the first half", lambda: all(len(result) >= 4 for result in results), 2.0 * seconds)
        print(f"  replay server: {replay.resident_mib():.0f} MiB and {replay.num_descriptors()} descriptors ({empty[0]:.0f} and "
              f"{empty[1]} before), {metric(replay, 'slalom_steps_accepted_total'):.0f} steps accepted", flush=True)
        began = time.monotonic()
        shown = len([role for role, _ in service.status() if role == "actor"])
        print(f"  `slalom status` shows {shown} actors after {time.monotonic() - began:.2f} s", flush=True)
        replay.kill()
        replay.start()
        before = list(lines)
        seconds = until(lambda: all(now >= then + 2 for now, then in zip(lines, before)) and all_are_connected())
        print(f"  after kill -9 of the replay server all are back within {seconds:.1f} s", flush=True)
        for thread in threads:
            thread.join()
        # Of the second quarter: all are connected, and the replay server lives.
        for what in ("acknowledged", "policies"):
            found = [[words for words in result if words[0] == what][1] for result in results]
            count = sum(int(words[1]) for words in found)
            print(f"  {what}: {count}, p50 {max(float(w[2]) for w in found):.0f} ms, p99 {max(float(w[3]) for w in found):.0f} ms, longest "
                  f"{max(float(w[4]) for w in found):.0f} ms (the worst of {processes} processes)", flush=True)


FIGURES = {"recovery": recovery, "sync": sync, "policies": policies, "scale": scale, "sessions": sessions}

if len(sys.argv) < 2 or not set(sys.argv[2:]) <= set(FIGURES):
    sys.exit(f"usage: {sys.argv[0]} PROGRAM [{'|'.join(FIGURES)}]...")
for figure in sys.argv[2:] or FIGURES:
    FIGURES[figure](sys.argv[1])
