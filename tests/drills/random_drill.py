#!/usr/bin/env python3
"""random_drill.py PROGRAM [FAULTS [SEED]]: random faults of all kinds, one after the other, in one run with keys.

Kills, stops and stalls of every role; delays, stalls, one-way cuts, resets and damaged bytes on every connection; crowds of silent
strangers; full disks (as root), slow ones, and system calls that fail; damaged spools and checkpoints. Passes if after each fault the learner makes updates and each actor
steps again, and in the end every step that an actor ever made is accepted or counted as lost, the same on both sides. The same seed
draws the same faults.
"""

import os
import random
import re
import signal
import socket
import subprocess
import time

from proxy import Proxy
from service import Service, check, check_accounts, main, wait_for

MORE_CONFIG = """\
[learner]
batch_size = 32
[evaluator_service]
interval = 20.0
[security]
keys = "{keys}"
"""


# System calls that fail on the files of a role for some seconds, with an error. A sync that fails ends a journal's writing until a
# person has looked at the disk and started the server again, so it is not among them.
CALLS = ("open", "fopen", "write", "pwritev", "rename", "stat", "unlink", "mkdir", "read")
ERRORS = {5: "EIO", 24: "EMFILE", 28: "ENOSPC", 116: "ESTALE", 0: "a part"}


class Drill:
    def __init__(self, service, proxy, seed):
        self.service, self.proxy = service, proxy
        self.draw = random.Random(seed)
        self.disks = []
        self.assertions = 0
        self.links = {}  # By the name of the process: its links to the servers.
        self.ports = {role: int(port) for role, port in
                      re.findall(r'^(replay|learner) = "tcp://127.0.0.1:(\d+)"$', open(service.config).read(), re.M)}
        self.replay = service.add("replay", extra=["--set", "replay_server.segment_bytes=4194304"])
        self.learner = self.behind_proxy("learner", "learner", ["replay"])
        self.actors = [self.behind_proxy("actor", f"actor-{i}", ["replay", "learner"]) for i in range(3)]
        self.evaluator = self.behind_proxy("evaluator", "evaluator", ["replay", "learner"])
        # Stands in for functions of the C library (tests/support/failing_libc.cc). A rule in the file says what fails.
        self.rule = os.path.join(service.directory, "rule")
        library = os.path.join(os.path.dirname(os.path.dirname(service.program)), "tests", "libfailing_libc_preload.so")
        self.library = library if os.path.exists(library) else None
        for process in service.processes if self.library else ():
            process.environment = {"LD_PRELOAD": library, "SLALOM_FAILING_CALL_FILE": self.rule}

    def behind_proxy(self, role, name, servers):
        links = {server: self.proxy.add(self.ports[server]) for server in servers}
        self.links[name] = links
        extra = []
        for server, link in links.items():
            extra += ["--set", f"service.{server}=tcp://127.0.0.1:{link.port}"]
        if role == "learner":
            extra += ["--set", f"service.learner_bind=tcp://127.0.0.1:{self.ports['learner']}"]
        return self.service.add(role, name, extra)

    def mount_disks(self):
        """Small disks for the servers, if this user may mount them."""
        for role in ("replay", "learner"):
            path = os.path.join(self.service.state, role)
            os.makedirs(path, exist_ok=True)
            if os.geteuid() != 0 or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=300m", "tmpfs", path], check=False,
                                                   capture_output=True).returncode != 0:
                print("no disk is filled: mounting small ones needs root")
                return
            self.disks.append(path)

    def unmount_disks(self):
        for path in self.disks:
            subprocess.run(["umount", "-l", path], check=False)

    def any_process(self):
        return self.draw.choice(self.service.processes)

    def any_link(self):
        name = self.draw.choice(sorted(self.links))
        server = self.draw.choice(sorted(self.links[name]))
        return f"{name} - {server}", self.links[name][server]

    # Each fault happens, ends, and returns what it was.

    def kill(self):
        victim = self.any_process()
        victim.kill()
        time.sleep(self.draw.uniform(0.0, 1.0))
        victim.start()
        return f"kill -9 of {victim.name}"

    def kill_two(self):
        victims = self.draw.sample(self.service.processes, 2)
        for victim in victims:
            victim.kill()
        time.sleep(self.draw.uniform(0.0, 1.0))
        for victim in victims:
            victim.start()
        return f"kill -9 of {victims[0].name} and {victims[1].name}"

    def stop(self):
        victim = self.any_process()
        victim.stop(30.0)
        time.sleep(self.draw.uniform(0.0, 1.0))
        victim.start()
        return f"stop of {victim.name}"

    def stand_still(self):
        victim, seconds = self.any_process(), self.draw.uniform(0.5, 8.0)
        victim.process.send_signal(signal.SIGSTOP)
        time.sleep(seconds)
        victim.process.send_signal(signal.SIGCONT)
        return f"{victim.name} stands still for {seconds:.1f} s"

    def delay(self):
        (name, link), seconds, delay = self.any_link(), self.draw.uniform(1.0, 4.0), self.draw.uniform(0.01, 0.5)
        link.delay = delay
        time.sleep(seconds)
        link.calm()
        return f"{name} delayed by {1000 * delay:.0f} ms for {seconds:.1f} s"

    def stall(self):
        (name, link), seconds = self.any_link(), self.draw.uniform(0.5, 9.0)
        link.stalled = ("to", "from")
        time.sleep(seconds)
        link.calm()
        return f"{name} stalled for {seconds:.1f} s"

    def cut_one_way(self):
        (name, link), seconds, way = self.any_link(), self.draw.uniform(0.5, 9.0), self.draw.choice(("to", "from"))
        link.stalled = (way,)
        time.sleep(seconds)
        link.calm()
        return f"{name} cut in the direction {way} the server for {seconds:.1f} s"

    def reset(self):
        name, link = self.any_link()
        link.reset = True
        return f"{name} reset"

    def reset_all(self):
        for links in self.links.values():
            for link in links.values():
                link.reset = True
        return "all connections reset"

    def damage_bytes(self):
        name, link = self.any_link()
        link.damage = True
        return f"a byte damaged on {name}"

    def crowd(self):
        port = self.draw.choice(sorted(self.ports.values()))
        strangers = []
        for _ in range(600):
            try:
                strangers.append(socket.create_connection(("127.0.0.1", port), timeout=1.0))
            except OSError:
                break
        check(self.service.status(), "the operator is not answered")
        for stranger in strangers:
            stranger.close()
        return f"{len(strangers)} silent strangers at port {port}"

    def full_disk(self):
        if not self.disks:
            return self.kill()
        path, seconds = self.draw.choice(self.disks), self.draw.uniform(1.0, 5.0)
        filler = os.path.join(path, "filler")
        with open(filler, "wb", buffering=0) as file:
            try:
                while True:
                    file.write(bytes(65536))
            except OSError:
                pass
        time.sleep(seconds)
        os.remove(filler)
        return f"{os.path.basename(path)}'s disk full for {seconds:.1f} s"

    def damage_spool(self):
        actor = self.draw.choice(self.actors)
        link = self.links[actor.name]["replay"]
        link.stalled = ("to", "from")
        time.sleep(0.5)
        actor.stop(30.0)
        link.calm()
        spool = os.path.join(self.service.state, "actors", actor.name, "spool")
        damaged = os.path.exists(spool)
        if damaged:
            damage(spool, self.draw)
        actor.start()
        return f"{actor.name} stopped while it was cut off, its spool " + ("damaged" if damaged else "empty")

    def damage_checkpoint(self):
        self.learner.kill()
        root = os.path.join(self.service.state, "learner", "checkpoints")
        checkpoints = sorted((d for d in os.listdir(root) if re.fullmatch(r"step-\d+", d)), key=lambda d: int(d[5:])) \
            if os.path.isdir(root) else []
        what = "kill -9 of learner"
        if len(checkpoints) > 1:
            directory = os.path.join(root, checkpoints[-1])
            file = max((os.path.join(directory, name) for name in os.listdir(directory)), key=os.path.getsize)
            damage(file, self.draw)
            what += ", its newest checkpoint damaged"
        self.learner.start()
        return what

    def with_rule(self, calls, result, seconds):
        """While the time passes, such calls of any role on its state have a result: an error, or a delay in ms if it is below 0."""
        unfinished = self.rule + ".new"
        with open(unfinished, "w") as file:
            file.write(f"{calls} {self.service.state}/* {result} 1 1000000000 {self.rule}.count")
        os.rename(unfinished, self.rule)
        time.sleep(seconds)
        os.remove(self.rule)

    def slow_disk(self):
        if not self.library:
            return self.kill()
        seconds, delay = self.draw.uniform(2.0, 6.0), self.draw.randrange(100, 1500)
        calls = self.draw.choice(("f*sync", "pwritev", "write"))
        self.with_rule(calls, -delay, seconds)
        return f"{calls} takes {delay} ms longer for {seconds:.1f} s"

    def failing_calls(self):
        if not self.library:
            return self.kill()
        calls, error, seconds = self.draw.choice(CALLS), self.draw.choice(sorted(ERRORS)), self.draw.uniform(0.5, 5.0)
        self.with_rule(calls, error, seconds)
        return f"{calls} gives {ERRORS[error]} for {seconds:.1f} s"

    FAULTS = (kill, kill_two, stop, stand_still, delay, stall, cut_one_way, reset, reset_all, damage_bytes, crowd, full_disk,
              slow_disk, failing_calls, damage_spool, damage_checkpoint)

    def progress(self):
        status = self.service.status()
        return [status[("learner", "learner")]["figures"]["updates"]] + [
            status[("actor", actor.name)]["figures"]["steps_made"] for actor in self.actors]

    def revive(self):
        """Starts what an assertion of libzmq 4.3.4 has ended, as whatever supervises a role does: a kill that nobody drew.

        https://github.com/zeromq/libzmq/issues/4364: an event of a connection that broke in the same moment. Any other end is a failure.
        """
        for process in self.service.processes:
            if process.process.poll() is None or "Assertion failed: !_io_error" not in process.log_text():
                process.check_alive()
                continue
            self.assertions += 1
            print(f"an assertion of libzmq ended {process.name}; it is started again", flush=True)
            process.process = None
            process.start()

    def wait_until_all_goes_on(self, what, timeout=90.0):
        began, before = time.monotonic(), None

        def goes_on():
            nonlocal before
            self.revive()
            now = self.progress()
            # A learner that went back to its checkpoint counts from there.
            before = [min(b, n) for b, n in zip(before, now)] if before else now
            return all(n > b for n, b in zip(now, before))

        wait_for(f"updates, and steps of each actor, after {what}", goes_on, timeout)
        return time.monotonic() - began


def damage(path, draw):
    """Changes a byte of a file."""
    with open(path, "r+b") as file:
        at = draw.randrange(os.path.getsize(path))
        file.seek(at)
        byte = file.read(1)[0]
        file.seek(at)
        file.write(bytes([byte ^ (1 << draw.randrange(8))]))


def drill(program, faults="100", seed=None):
    seed = int(seed) if seed is not None else random.SystemRandom().randrange(1 << 31)
    print(f"seed {seed}", flush=True)
    with Service(program, capacity=20000) as service:
        keys = os.path.join(service.directory, "keys")
        subprocess.run([service.program, "keys", "new", keys], check=True, capture_output=True)
        with open(service.config, "a") as config:
            config.write(MORE_CONFIG.format(keys=keys))
        proxy = Proxy()
        drill_ = Drill(service, proxy, seed)
        drill_.mount_disks()
        try:
            for process in service.processes:
                process.start()
            drill_.wait_until_all_goes_on("the start", 120.0)
            took = {}
            # Every kind once in each round, in an order that is drawn.
            kinds = []
            for number in range(1, int(faults) + 1):
                if not kinds:
                    kinds = drill_.draw.sample(Drill.FAULTS, len(Drill.FAULTS))
                kind = kinds.pop()
                what = kind(drill_)
                seconds = drill_.wait_until_all_goes_on(f"fault {number} of seed {seed} ({what})")
                took.setdefault(kind.__name__, []).append(seconds)
                print(f"fault {number}: {what}; all going on {seconds:.1f} s later", flush=True)
            drill_.revive()
            made, lost = check_accounts(service)
            for kind, times in sorted(took.items()):
                print(f"{kind}: {len(times)} times, all going on after {max(times):.1f} s at most")
            print(f"{faults} faults of seed {seed}: {made} steps made, {lost} lost with their reasons, 0 unaccounted; "
                  f"{drill_.assertions} assertions of libzmq")
        finally:
            for process in service.processes:
                if process.process is not None:
                    process.process.send_signal(signal.SIGCONT)
                    process.kill()
            proxy.close()
            drill_.unmount_disks()


main(drill)
