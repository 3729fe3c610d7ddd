"""A training by a service on a Ray cluster. docs/service.md is the guide."""

from __future__ import annotations

import ctypes
import os
import pathlib
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Sequence
from typing import Optional

import ray
from ray.util.placement_group import placement_group, remove_placement_group
from ray.util.scheduling_strategies import PlacementGroupSchedulingStrategy

from . import _slalom

_PR_SET_PDEATHSIG = 1


def _dies_with_its_worker():
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


@ray.remote(max_restarts=-1, max_task_retries=-1, max_concurrency=4)
class _Role:
    """A process of the service. If a signal ends it, its worker ends, too, and Ray starts both again."""

    def __init__(self, program, role, name, options, state):
        self._endpoint_file = state / f"{role}.endpoint"
        self._address = ray.util.get_node_ip_address()
        command = [program, role, "--name", name, *options]
        if role in ("replay", "learner"):  # A later start listens where the first one did.
            bind = self._endpoint_file.read_text().strip() if self._endpoint_file.exists() else "tcp://*:0"
            command += ["--set", f"service.{role}_bind={bind}"]
        self._code: Optional[int] = None
        self._told = False
        self._started = threading.Event()
        # The kernel ties the process to the thread that starts it.
        self._thread = threading.Thread(target=self._run, args=(command, state / "logs" / f"{name}.log"), daemon=True)
        self._thread.start()
        self._started.wait()

    def _run(self, command, log):
        with open(log, "ab") as output:
            self._process = subprocess.Popen(command, stdout=output, stderr=output, stdin=subprocess.DEVNULL,
                                             preexec_fn=_dies_with_its_worker)
        self._started.set()
        code = self._process.wait()
        if code < 0 and not self._told:
            os._exit(1)
        self._code = code

    def endpoint(self):
        """The address at which a server listens, once it does; None if it has ended."""
        while not self._endpoint_file.exists():
            if self._code is not None:
                return None
            time.sleep(0.1)
        return f"tcp://{self._address}:{self._endpoint_file.read_text().strip().rpartition(':')[2]}"

    def code(self):
        """The exit code, or None while the process runs."""
        return self._code

    def stop(self):
        """Lets it save and end. Returns its exit code."""
        self._told = True
        if self._code is None:
            self._process.terminate()
        self._thread.join()
        return self._code


class Training:
    """A service that trains; `launch` makes one."""

    def __init__(self, group, state: pathlib.Path):
        self._group, self._state = group, state
        self._roles: list[tuple[str, ray.actor.ActorHandle]] = []

    def wait(self) -> pathlib.Path:
        """Waits until the training has ended, stops the service, and returns the policy's file. Raises `slalom.Error` that
        names the log if a role ended with an error."""
        try:
            while True:
                codes = ray.get([role.code.remote() for _, role in self._roles])
                for (name, _), code in zip(self._roles, codes):
                    if code or (code == 0 and name != "learner"):
                        raise _slalom.Error(f"the service ended, as {name} did with exit code {code}; "
                                            f"{self._state}/logs/{name}.log says why")
                    if code == 0:
                        return self._state / "learner" / "policy.safetensors"
                time.sleep(0.5)
        finally:
            self.stop()

    def stop(self) -> None:
        """Saves and ends all: the actors first, which deliver what they have. `launch` goes on."""
        roles, self._roles = self._roles, []
        ray.get([role.stop.remote() for name, role in roles if name not in ("replay", "learner")])
        for name in ("learner", "replay"):
            ray.get([role.stop.remote() for each, role in roles if each == name])
        for _, role in roles:
            ray.kill(role)
        if roles:
            remove_placement_group(self._group)


def launch(config: str | os.PathLike, *, actors: int, state: str | os.PathLike, evaluator: bool = False,
           settings: Sequence[str] = (), program: str | os.PathLike = "slalom") -> Training:
    """Starts replay server, learner and actors, each a Ray actor with a core, in one placement group. The same call goes on.

    config: a file such as "configs/cluster.toml", with its state and its addresses replaced.
    state: a directory that all nodes see. It has everything: the run in learner/, logs/, keys of this start.
    settings: "section.key=value".
    program: `slalom`, at the same place on all nodes.

    Raises `slalom.Error` if a server ends before it listens."""
    found = shutil.which(program)
    if found is None:
        raise _slalom.Error(f"{os.fspath(program)}: there is no such program, expected slalom")
    if actors < 1:
        raise _slalom.Error(f"actors is {actors}, expected 1 or more")
    program, state = os.path.abspath(found), pathlib.Path(state).absolute()
    (state / "logs").mkdir(parents=True, exist_ok=True)
    shutil.rmtree(state / "keys", ignore_errors=True)
    subprocess.run([program, "keys", "new", state / "keys"], check=True, stdout=subprocess.DEVNULL)
    options = ["--config", os.path.abspath(config)]
    for setting in [*settings, f"service.state={state}", f"security.keys={state}/keys", "learner_service.exit_when_finished=true"]:
        options += ["--set", setting]
    names = ["replay", "learner", *(f"actor-{i}" for i in range(actors)), *(["evaluator"] if evaluator else [])]
    group = placement_group([{"CPU": 1}] * len(names))
    training = Training(group, state)
    for i, name in enumerate(names):
        role = name.partition("-")[0]
        (state / f"{role}.endpoint").unlink(missing_ok=True)
        strategy = PlacementGroupSchedulingStrategy(group, placement_group_bundle_index=i)
        process = _Role.options(num_cpus=1, scheduling_strategy=strategy).remote(program, role, name, list(options), state)
        training._roles.append((name, process))
        if role in ("replay", "learner"):
            endpoint = ray.get(process.endpoint.remote())
            if endpoint is None:
                training.stop()
                raise _slalom.Error(f"{name} ended before it listened; {state}/logs/{name}.log says why")
            options += ["--set", f"service.{role}={endpoint}"]
    return training
