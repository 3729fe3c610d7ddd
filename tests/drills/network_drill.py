#!/usr/bin/env python3
"""network_drill.py PROGRAM [SECONDS...]: cuts between every pair of machines, for 1, 10 and 60 s unless told. Needs root.

Each role runs in a network namespace of its own, as a machine of its own would, with CURVE keys. Then each server in turn accepts
and does not answer. Passes if all goes on after each cut and every step is accounted for.
"""

import itertools
import os
import signal
import subprocess
import sys
import time

from service import Service, check_accounts, main, wait_for

MACHINES = {"replay": "10.77.0.2", "learner": "10.77.0.3", "actor": "10.77.0.4", "operator": "10.77.0.5", "evaluator": "10.77.0.6"}


def ip(*arguments, check=True):
    return subprocess.run(["ip", *arguments], check=check, capture_output=True, text=True)


def namespace(machine):
    return f"slalom-{machine}"


def tear_down():
    for machine in MACHINES:
        ip("netns", "delete", namespace(machine), check=False)


def set_up():
    """A cable between every two machines: a bridge would be subject to the firewall rules of a Docker engine."""
    tear_down()
    for machine, address in MACHINES.items():
        ip("netns", "add", namespace(machine))
        ip("-n", namespace(machine), "link", "set", "lo", "up")
        ip("-n", namespace(machine), "addr", "add", f"{address}/32", "dev", "lo")
    for a, b in itertools.combinations(MACHINES, 2):
        ip("-n", namespace(a), "link", "add", f"to-{b}", "type", "veth", "peer", "name", f"to-{a}", "netns", namespace(b))
        for here, there in ((a, b), (b, a)):
            ip("-n", namespace(here), "link", "set", f"to-{there}", "up")
        mend(a, b)


def cut(a, b):
    """No packet reaches the other, in either direction, and nobody is told."""
    for here, there in ((a, b), (b, a)):
        ip("-n", namespace(here), "route", "replace", "blackhole", f"{MACHINES[there]}/32")


def mend(a, b):
    for here, there in ((a, b), (b, a)):
        ip("-n", namespace(here), "route", "replace", f"{MACHINES[there]}/32", "dev", f"to-{there}", "src", MACHINES[here])


def inside(machine):
    return ["ip", "netns", "exec", namespace(machine)]


def drill(program, *seconds):
    if os.geteuid() != 0:
        print("SKIPPED: network namespaces need root")
        sys.exit(77)
    try:
        set_up()
    except subprocess.CalledProcessError as error:
        print(f"SKIPPED: no network namespaces here: {error.stderr.strip()}")
        sys.exit(77)
    try:
        with Service(program, hosts=(MACHINES["replay"], MACHINES["learner"]), wrapper=inside("operator"),
                     more_config="[evaluator_service]\ninterval = 10.0\n") as service:
            keys = os.path.join(service.directory, "keys")
            subprocess.run([service.program, "keys", "new", keys], check=True, capture_output=True)
            with open(service.config, "a") as config:
                config.write(f'[security]\nkeys = "{keys}"\n')
            replay, learner, *_ = (service.add(role, role, wrapper=inside(role)).start()
                                   for role in ("replay", "learner", "actor", "evaluator"))

            def progress():
                for process in service.processes:
                    process.check_alive()
                return (service.figure("learner", "learner", "updates"), service.figure("replay", "replay", "steps"),
                        service.figure("actor", "actor", "policy_version"), service.figure("evaluator", "evaluator", "policy_version"))

            def wait_until_all_goes_on(what, timeout):
                before = wait_for(f"the status after {what}", progress, timeout)
                began = time.monotonic()
                wait_for(f"updates, steps and policies after {what}", lambda: all(n > b for n, b in zip(progress(), before)), timeout)
                return time.monotonic() - began

            wait_until_all_goes_on("the start", 120.0)
            for length in [float(s) for s in seconds] or [1.0, 10.0, 60.0]:
                for pair in (("actor", "replay"), ("actor", "learner"), ("learner", "replay"), ("evaluator", "replay"),
                             ("evaluator", "learner")):
                    cut(*pair)
                    time.sleep(length)
                    mend(*pair)
                    took = wait_until_all_goes_on(f"a cut of {length} s between {pair[0]} and {pair[1]}", 60.0)
                    print(f"{pair[0]} - {pair[1]} cut for {length:.0f} s: all going on {took:.1f} s after", flush=True)
            for server in (replay, learner):
                server.process.send_signal(signal.SIGSTOP)  # The kernel still accepts connections.
                time.sleep(20.0)
                server.process.send_signal(signal.SIGCONT)
                took = wait_until_all_goes_on(f"{server.name} stood still", 60.0)
                print(f"{server.name} accepted and did not answer for 20 s: all going on {took:.1f} s after", flush=True)
            for process in service.processes:
                process.check_alive()
            made, lost = check_accounts(service)
            print(f"{made} steps made, {lost} lost, the same on both sides")
            if lost:
                sys.exit("FAILED: steps were lost though nothing was killed")
    finally:
        tear_down()


main(drill)
