#!/usr/bin/env python3
"""oom_drill.py PROGRAM: each role in turn needs more memory than its control group may have, and the kernel kills it.

Passes if the kernel counts the kill, the role goes on with more memory, and every step that the actor ever made is accepted or counted
as lost, the same on both sides. Needs root and control groups with a memory controller (version 1 or 2).
"""

import os
import sys

from service import Service, check, check_accounts, main, wait_for

ENTER = ("sh", "-c", 'echo $$ > "$0"; exec "$@"')


class Group:
    """A control group for one role."""

    def __init__(self, name):
        v1 = os.path.exists("/sys/fs/cgroup/memory/memory.limit_in_bytes")
        self.path = os.path.join("/sys/fs/cgroup/memory" if v1 else "/sys/fs/cgroup", f"slalom-oom-{os.getpid()}-{name}")
        self.limit, self.used, self.kills, self.unlimited = (
            ("memory.limit_in_bytes", "memory.usage_in_bytes", "memory.oom_control", "-1") if v1 else
            ("memory.max", "memory.current", "memory.events", "max"))
        try:
            os.mkdir(self.path)
            self.write(self.limit, self.unlimited)
        except OSError as error:
            if os.path.isdir(self.path):
                os.rmdir(self.path)
            print(f"SKIPPED: {error}: no control group with a limit on memory here")
            sys.exit(77)
        # Else the kernel would move memory to the swap, where there is one.
        for swap in ("memory.swap.max", "memory.swappiness"):
            if os.path.exists(os.path.join(self.path, swap)):
                self.write(swap, "0")
        self.wrapper = (*ENTER, os.path.join(self.path, "cgroup.procs"))

    def write(self, name, text):
        with open(os.path.join(self.path, name), "w", encoding="utf8") as file:
            file.write(text)

    def read(self, name):
        with open(os.path.join(self.path, name), encoding="utf8") as file:
            return file.read()

    def tighten(self):
        """Sets a limit that the role will hit. Raises OSError if the kernel refuses it because the role just took more."""
        used = int(self.read(self.used))
        try:
            # Below what it uses: it is refused while that cannot be given back, so it ends up a little above.
            self.write(self.limit, str(used // 2))
        except OSError:
            self.write(self.limit, str(used + (1 << 16)))
        return used

    def num_kills(self):
        return next(int(line.split()[1]) for line in self.read(self.kills).splitlines() if line.split()[0] == "oom_kill")


def drill(program):
    with Service(program) as service:
        groups = {role: Group(role) for role in ("replay", "learner", "actor")}
        try:
            for role, group in groups.items():
                service.add(role, wrapper=group.wrapper).start()
            wait_for("updates", lambda: service.figure("learner", "learner", "updates") >= 500)

            def progress():
                return service.figure("learner", "learner", "updates"), service.figure("replay", "replay", "steps")

            for process in service.processes:
                group = groups[process.role]
                used = wait_for(f"a limit for the {process.name}", group.tighten)
                code = wait_for(f"the kernel's end of the {process.name}", lambda: process.process.poll() or 0, 120.0)
                check(code == -9 and group.num_kills() >= 1, f"{process.name} ended with {code}, {group.num_kills()} kills by the kernel")
                process.process = None
                group.write(group.limit, group.unlimited)
                process.start()
                before = wait_for("the service", progress, 30.0)
                wait_for(f"updates and steps after the end of the {process.name}",
                         lambda: all(now > then for now, then in zip(progress(), before)), 30.0)
                print(f"{process.name}: out of memory at {used / 2**20:.0f} MiB, going on", flush=True)
            made, lost = check_accounts(service)
            print(f"{made} steps made, {lost} lost with the actor, 0 unaccounted")
        finally:
            for process in service.processes:
                if process.process is not None:
                    process.kill()
            for group in groups.values():
                os.rmdir(group.path)


main(drill)
