"""A service of real processes on this machine, for drills: starts, kills and watches them.

Needs nothing but Python's standard library. Each drill is a script that takes the program's path.
"""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

# Small enough that several drills fit into a test run, and still learns: the fast preset's network on few courses.
CONFIG = """\
base = "{root}/{preset}"
[run]
max_steps = 100000000
max_seconds = 0.0
updates_per_step = {updates_per_step}
learning_starts = {learning_starts}
checkpoint_seconds = 2.0
[courses]
train = "static-train-50"
test = "{test}"
[actor]
num_environments = {environments}
[replay]
capacity = {capacity}
[replay_server]
sync_interval = 0.5
max_ahead_steps = {max_ahead}
[service]
replay = {replay}
learner = "tcp://{learner_host}:{learner_port}"
state = "{state}"
"""


class DrillFailed(Exception):
    pass


def check(condition, what):
    if not condition:
        raise DrillFailed(what)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_for(what, condition, timeout=60.0):
    """Polls until `condition()` gives something, and returns that."""
    end = time.monotonic() + timeout
    last = None
    while time.monotonic() < end:
        try:
            last = condition()
            if last:
                return last
        except (OSError, ValueError, KeyError, subprocess.SubprocessError) as error:
            last = error
        time.sleep(0.05)
    raise DrillFailed(f"{what} did not come within {timeout:.0f} s (last: {last})")


def mount(path, megabytes):
    """A small disk at `path`."""
    os.makedirs(path, exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", path], check=True)


def fill(path):
    """Leaves no space on the disk at `path`. The file to remove."""
    name = os.path.join(path, "filler")
    with open(name, "wb", buffering=0) as file:
        try:
            while True:
                file.write(b"x" * 65536)
        except OSError:
            pass
    return name


class Process:
    """One role: its process, its log, its metrics."""

    def __init__(self, service, role, name, extra=(), wrapper=()):
        self.service, self.role, self.name, self.extra, self.wrapper = service, role, name, list(extra), list(wrapper)
        self.log = os.path.join(service.directory, f"{role}-{name}.log")
        self.process = None
        self.program = service.program
        self.environment = {}  # Besides this process's own.
        self.starts = 0

    def start(self):
        check(self.process is None, f"{self.name} runs already")
        command = self.wrapper + [self.program, self.role, "--config", self.service.config, "--name", self.name]
        self.starts += 1
        self.log_offset = os.path.getsize(self.log) if os.path.exists(self.log) else 0
        with open(self.log, "ab") as log:
            self.process = subprocess.Popen(command + self.extra, stdout=log, stderr=log, env={**os.environ, **self.environment})
        return self

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        self.process = None

    def stop(self, timeout=5.0):
        """SIGTERM; the exit code and the seconds that it took."""
        began = time.monotonic()
        self.process.send_signal(signal.SIGTERM)
        try:
            code = self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            self.kill()
            raise DrillFailed(f"{self.role} {self.name} did not end within {timeout} s of SIGTERM") from None
        self.process = None
        return code, time.monotonic() - began

    def check_alive(self):
        check(self.process.poll() is None, f"{self.role} {self.name} ended by itself: {self.log_text()[-2000:]}")

    def log_text(self):
        """Of the last start."""
        with open(self.log, errors="replace") as log:
            log.seek(self.log_offset)
            return log.read()

    def metrics(self):
        """{(name, labels): value} of its metrics page."""
        port = re.search(r"metrics at http://[^:]+:(\d+)/", self.log_text())
        if not port:
            raise ValueError("no metrics yet")
        page = urllib.request.urlopen(f"http://127.0.0.1:{port.group(1)}/metrics", timeout=5).read().decode()
        return {
            line.rsplit(" ", 1)[0]: float(line.rsplit(" ", 1)[1])
            for line in page.splitlines()
            if line and not line.startswith("#")
        }

    def health(self):
        """What it answers to health checks: "ok", or what is wrong."""
        port = re.search(r"metrics at http://[^:]+:(\d+)/", self.log_text()).group(1)
        try:
            return urllib.request.urlopen(f"http://127.0.0.1:{port}/healthy", timeout=5).read().decode().strip()
        except urllib.error.HTTPError as error:
            return error.read().decode().strip()

    def metric(self, name, **labels):
        """The sum of the metric over all label values that match."""
        found = [
            value
            for key, value in self.metrics().items()
            if re.match(re.escape(name) + r"(\{|$)", key) and all(f'{k}="{v}"' in key for k, v in labels.items())
        ]
        if not found:
            raise KeyError(name)
        return sum(found)

    def resident_mib(self):
        with open(f"/proc/{self.process.pid}/status") as status:
            return int(re.search(r"VmRSS:\s+(\d+) kB", status.read()).group(1)) / 1024

    def num_descriptors(self):
        return len(os.listdir(f"/proc/{self.process.pid}/fd"))


class Service:
    """Roles that share a config, in a directory of their own, removed at the end if all went well."""

    def __init__(self, program, environments=16, updates_per_step=0.25, capacity=200000, max_ahead=4096, test="static-test",
                 learning_starts=2000, more_config="", preset="configs/fast.toml", hosts=("127.0.0.1", "127.0.0.1"), wrapper=(), servers=1):
        self.program = os.path.abspath(program)
        self.wrapper = list(wrapper)  # Of commands that ask for the status.
        self.directory = tempfile.mkdtemp(prefix="slalom-drill-")
        self.state = os.path.join(self.directory, "state")
        self.config = os.path.join(self.directory, "service.toml")
        self.processes = []
        text = CONFIG.format(root=ROOT, preset=preset, environments=environments, updates_per_step=updates_per_step, capacity=capacity,
                             max_ahead=max_ahead, test=test, learning_starts=learning_starts, replay=json.dumps([f"tcp://{hosts[0]}:{free_port()}" for _ in range(servers)]), learner_host=hosts[1], learner_port=free_port(), state=self.state)
        with open(self.config, "w") as file:
            file.write(text + more_config)

    def add(self, role, name=None, extra=(), wrapper=()):
        process = Process(self, role, name or role, extra, wrapper)
        self.processes.append(process)
        return process

    def status(self):
        out = subprocess.run(self.wrapper + [self.program, "status", "--config", self.config, "--json"], capture_output=True, text=True,
                             timeout=20)
        if out.returncode != 0:
            raise ValueError(out.stderr.strip())
        return {(r["role"], r["name"]): r for r in json.loads(out.stdout)["roles"]}

    def steps(self):
        """That the replay servers accepted, together."""
        return sum(r["figures"]["steps"] for (role, _), r in self.status().items() if role == "replay")

    def figure(self, role, name, key):
        return self.status()[(role, name)]["figures"][key]

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        for process in self.processes:
            if process.process is not None:
                process.process.kill()
                process.process.wait()
        if kind is None:
            shutil.rmtree(self.directory, ignore_errors=True)
        else:
            print(f"logs and state are in {self.directory}", file=sys.stderr)


def final_account(actor):
    """Steps made, accepted, kept for the next start and lost, as an actor that was stopped said last."""
    found = re.search(r"stopped: (\d+) steps made, (\d+) accepted, (\d+) kept for the next start, (\d+) lost", actor.log_text())
    check(found, f"{actor.name} gave no account: {actor.log_text()[-1500:]}")
    made, accepted, kept, lost = map(int, found.groups())
    check(made == accepted + kept + lost, f"{actor.name}: {made} made, {accepted} accepted, {kept} kept, {lost} lost")
    return made, accepted, kept, lost


def said_lost(actor):
    """How many steps are lost as an actor's log says, of all its starts."""
    with open(actor.log, errors="replace") as log:
        return sum(map(int, re.findall(r"(\d+) steps of session \d+ are lost", log.read())))


def check_accounts(service):
    """Stops the learner and the actors of a service that otherwise runs; both sides must agree to the step. (made, lost)"""
    for process in service.processes:
        if process.role == "learner":
            process.stop()  # Then nothing that the server holds back is let in any more.
    made = accepted = lost = 0
    for actor in (p for p in service.processes if p.role == "actor"):
        code, _ = actor.stop()
        check(code == 0, f"{actor.name} ended with {code}")
        m, a, _, l = final_account(actor)
        made, accepted, lost = made + m, accepted + a, lost + l
    wait_for(f"the {accepted} steps that the actors were told of, on the server", lambda: service.steps() == accepted, 10.0)
    return made, lost


def main(drill):
    if len(sys.argv) < 2:
        sys.exit(f"usage: {sys.argv[0]} PROGRAM [ARGUMENT...]")
    try:
        drill(*sys.argv[1:])
    except DrillFailed as failure:
        sys.exit(f"FAILED: {failure}")
