#!/usr/bin/env python3
"""hostile_drill.py PROGRAM [SECONDS [SEED]]: random bytes, HTTP, half handshakes and floods on every port, wrong keys and no keys.

Passes if the service, which runs with keys, goes on meanwhile, no process grows or dies, whoever has no right key gets in nowhere,
and every step is accounted for.
"""

import os
import random
import re
import shutil
import socket
import subprocess
import time

from service import Service, check, check_accounts, main, wait_for

GREETING = b"\xff\0\0\0\0\0\0\0\x01\x7f\x03\x01CURVE" + bytes(15) + b"\0" + bytes(31)
NULL_GREETING = b"\xff\0\0\0\0\0\0\0\x01\x7f\x03\x01NULL" + bytes(16) + b"\0" + bytes(31)


def attack(draw, port):
    """One connection with something that is not this protocol."""
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=1.0) as peer:
            peer.settimeout(0.2)
            kind = draw.randrange(6)
            if kind == 0:
                peer.sendall(draw.randbytes(draw.randrange(1, 100000)))
            elif kind == 1:
                peer.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n" + b"A" * draw.randrange(100000))
            elif kind == 2:
                peer.sendall(GREETING + draw.randbytes(draw.randrange(2000)))
            elif kind == 3:
                peer.sendall(NULL_GREETING + draw.randbytes(draw.randrange(2000)))
            elif kind == 4:  # A frame of a length that nobody has memory for.
                peer.sendall(GREETING + b"\x02" + b"\x7f" * 8 + draw.randbytes(5000))
            else:
                peer.sendall(GREETING[:draw.randrange(len(GREETING))])
                time.sleep(0.05)
            try:
                peer.recv(4096)
            except OSError:
                pass
    except OSError:
        pass


def drill(program, seconds="20", seed="1"):
    draw = random.Random(int(seed))
    with Service(program) as service:
        keys, stolen = (os.path.join(service.directory, name) for name in ("keys", "stolen"))
        for directory in (keys, stolen):
            subprocess.run([service.program, "keys", "new", directory], check=True, capture_output=True)
        # An attacker knows the public keys of the servers and has a key of its own, or an actor's key and plays the learner.
        for role in ("replay", "learner"):
            shutil.copy(os.path.join(keys, f"{role}.pub"), stolen)
        with open(service.config, "a") as config:
            config.write(f'[security]\nkeys = "{keys}"\n')
        replay, learner, actor = (service.add(role).start() for role in ("replay", "learner", "actor"))
        wait_for("updates", lambda: service.figure("learner", "learner", "updates") > 300, 120.0)
        ports = [int(p) for p in re.findall(r"tcp://127.0.0.1:(\d+)", open(service.config).read())]
        ports += [int(re.search(r"metrics at http://[^:]+:(\d+)/", p.log_text()).group(1)) for p in service.processes]
        memory = {p.name: p.resident_mib() for p in service.processes}
        rejected = replay.metric("slalom_rejected_connections_total")
        updates = service.figure("learner", "learner", "updates")
        intruders = [service.add("actor", "no-rights", ["--set", f"security.keys={stolen}"]).start(),
                     service.add("actor", "no-keys", ["--set", "security.keys="]).start()]
        end, attacks = time.monotonic() + float(seconds), 0
        while time.monotonic() < end:
            attack(draw, draw.choice(ports))
            attacks += 1
        for process in (replay, learner, actor):
            process.check_alive()
        for intruder in intruders:
            check("session" not in intruder.log_text().split("waiting for")[-1], f"{intruder.name} got in: {intruder.log_text()}")
            intruder.kill()
            service.processes.remove(intruder)
        check(service.figure("learner", "learner", "updates") > updates, "learning stopped")
        check(replay.metric("slalom_rejected_connections_total") > rejected, "no rejected connection was counted")
        status = service.status()
        check({name for _, name in status} == {"replay", "learner", "actor"}, f"roles: {list(status)}")
        for process in (replay, learner, actor):
            # The table fills meanwhile: 300 MB at most here.
            check(process.resident_mib() < memory[process.name] + 330, f"{process.name} grew to {process.resident_mib():.0f} MiB")
        made, lost = check_accounts(service)
        check(lost == 0, f"{lost} steps lost")
        print(f"{attacks} attacks on {len(ports)} ports in {seconds} s, {made} steps meanwhile, none lost")


main(drill)
