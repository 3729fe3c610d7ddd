"""A Docker engine for tests: the machine's own or, as root, one that is started here and stopped at the end.

Nothing is pulled from a registry: base images are made of Debian's packages where they are missing. The image of Slalom is made
from the program that the tests were built with, on the Debian that they run on. With SLALOM_IMAGE_FROM=source it is compiled once
more, as users do it: on Debian 13, against its LibTorch 2.x.
"""

import contextlib
import json
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
FROM_SOURCE = os.environ.get("SLALOM_IMAGE_FROM") == "source"
SUITE = "trixie" if FROM_SOURCE else platform.freedesktop_os_release()["VERSION_CODENAME"]
BASE = f"debian:{SUITE}-slim"
IMAGE = "slalom:test"
PROMETHEUS_IMAGE = "slalom-prometheus:test"
SKIPPED = 77  # ctest's SKIP_RETURN_CODE.


# Each library in the image has its licence there, and so have those that are compiled into the program.
LICENCES = """
while read -r package version library; do test -s "/usr/share/doc/$package/copyright"; done </usr/share/slalom/libraries
grep -q 'Permission is hereby granted' /usr/share/doc/slalom/copyright
grep -q '= libtomlplusplus-dev =' /usr/share/doc/slalom/copyright
"""


class Failure(Exception):
    """What the test was to find."""


def say(text):
    print(f"[{time.monotonic() - START:6.1f} s] {text}", flush=True)


START = time.monotonic()


def end_with(test):
    """Runs a test, and ends the process as it ends."""
    try:
        test()
    except Failure as failure:
        print(f"FAILED: {failure}", file=sys.stderr)
        sys.exit(1)


def skip(why):
    print(f"SKIPPED: {why}")
    sys.exit(SKIPPED)


def run(*command, check=True, quiet=True, **options):
    """Runs a command; its standard output. Throws `Failure` with all that it said where it fails."""
    command = [str(part) for part in command]
    done = subprocess.run(command, text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE if quiet else None, check=False, **options)
    if check and done.returncode != 0:
        raise Failure(f"{' '.join(command)} ended with {done.returncode}:\n{done.stdout}{done.stderr or ''}")
    return done.stdout


def wait_for(what, condition, limit_s):
    """Asks until `condition` gives something true, and returns it. Throws where it does not within a generous limit."""
    end = time.monotonic() + limit_s
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > end:
            raise Failure(f"{what}: not within {limit_s} s")
        time.sleep(0.5)


def succeeds(*command):
    return subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode == 0


def find_docker():
    """The first client on the path that builds with BuildKit: later ones need a plug-in, which may not be there."""
    for folder in os.environ.get("PATH", "").split(":"):
        client = shutil.which("docker", path=folder)
        if client is None:
            continue
        version = run(client, "version", "--format", "{{.Client.Version}}", check=False).strip()
        if succeeds(client, "buildx", "version") or (version and int(version.split(".")[0]) < 23):
            return client
    skip("no docker client that builds with BuildKit (Debian: docker.io)")


class Engine:
    """The engine and the images of this tree. `docker` and `compose` are the commands to call them by."""

    def __init__(self):
        self.docker = find_docker()
        self.compose = [self.docker, "compose"] if succeeds(self.docker, "compose", "version") else ["docker-compose"]
        if shutil.which(self.compose[0]) is None:
            skip("no docker-compose")
        self.environment = dict(os.environ, DOCKER_BUILDKIT="1")

    def __call__(self, *arguments, **options):
        return run(self.docker, *arguments, env=self.environment, **options)

    def answers(self):
        return succeeds(self.docker, "info") and bool(self("info", "--format", "{{.ServerVersion}}", check=False).strip())

    def inspect(self, what, template):
        return self("inspect", "--format", template, what).strip()

    def has_image(self, name):
        return succeeds(self.docker, "image", "inspect", name)

    def remove_labelled(self, label):
        """Removes all containers that bear a label, ended ones too, and its volumes: a container that ended still holds them."""
        def none_left():
            left = False
            for kind, listed in [("container", ["ls", "--all", "--quiet"]), ("volume", ["ls", "--quiet"])]:
                found = self(kind, *listed, "--filter", f"label={label}").split()
                if found:
                    self(kind, "rm", "--force", *found, check=False)
                    left = True
            return not left

        wait_for(f"what bears {label} to go", none_left, 60)

    def make_base_image(self):
        if self.has_image(BASE):
            return
        say(f"making {BASE}")
        if shutil.which("mmdebstrap") is None:
            self("pull", BASE)
            return
        with tempfile.TemporaryDirectory() as scratch:
            archive = pathlib.Path(scratch) / "root.tar"
            without = [f"--dpkgopt=path-exclude=/usr/share/{part}/*" for part in ("doc", "man", "locale")]  # As in Debian's own.
            without.append("--dpkgopt=path-include=/usr/share/doc/*/copyright")
            run("mmdebstrap", "--quiet", "--variant=minbase", *without, SUITE, archive)
            self("import", "--change", 'CMD ["bash"]', archive, BASE)

    def build_images(self, program):
        """The images under the tests' names."""
        self.make_base_image()
        say("building the images")
        if FROM_SOURCE:
            # Optimised less than users have it, as that compiles in two thirds of the time.
            commit = run("git", "-C", ROOT, "rev-parse", "--short=12", "HEAD", check=False).strip() or "unknown"
            self("build", "--tag", IMAGE, "--file", ROOT / "deploy/Dockerfile", "--build-arg", f"COMMIT={commit}",
                 "--build-arg", "OPTIMISATION=-O1", ROOT)
        else:
            self.build_image_of(program)
        self("build", "--tag", PROMETHEUS_IMAGE, "--build-arg", f"BASE={BASE}", ROOT / "deploy/prometheus")
        self("run", "--rm", IMAGE, "config", "print", "configs/fast.toml")  # Presets are found by name.
        self("run", "--rm", "--entrypoint", "sh", IMAGE, "-ec", LICENCES)
        size = int(self.inspect(IMAGE, "{{.Size}}"))
        say(f"{IMAGE} has {size / 1e6:.0f} MB")

    def build_image_of(self, program):
        with tempfile.TemporaryDirectory() as scratch:
            context = pathlib.Path(scratch)
            base_packages = context / "base-packages"
            base_packages.write_text(self("run", "--rm", BASE, "dpkg-query", "-W", "-f", "${Package} ${Version}\\n"))
            run(ROOT / "deploy/image/collect", program, base_packages, context / "collected")
            shutil.copytree(ROOT / "configs", context / "collected/program/usr/share/slalom/configs")
            shutil.copytree(ROOT / "deploy/image", context / "deploy/image")
            self("build", "--tag", IMAGE, "--file", ROOT / "deploy/Dockerfile", "--build-arg", f"BASE={BASE}",
                 "--build-arg", "BUILT=prebuilt", context)


@contextlib.contextmanager
def running_engine():
    """An `Engine` that answers."""
    engine = Engine()
    if engine.answers():
        yield engine
        return
    if os.geteuid() != 0:
        skip("no Docker engine answers, and only root can start one")
    if shutil.which("dockerd") is None:
        skip("no Docker engine answers, and dockerd is not installed")
    with tempfile.NamedTemporaryFile(prefix="dockerd", suffix=".log", mode="w+") as log:
        daemon = subprocess.Popen(["dockerd"], stdout=log, stderr=log, start_new_session=True)
        try:
            say("starting a Docker engine")
            for _ in range(120):
                if engine.answers() or daemon.poll() is not None:
                    break
                time.sleep(0.5)
            if not engine.answers():
                log.seek(0)
                skip("no Docker engine can be started here: " + "".join(log.readlines()[-5:]))
            yield engine
        finally:
            daemon.terminate()
            daemon.wait(60)


def metrics_of(text):
    """Samples of Prometheus' text format: (name, {label: value}, number)."""
    samples = []
    for line in text.splitlines():
        if not line or line.startswith("#"):
            continue
        series, number = line.rsplit(" ", 1)
        name, _, labels = series.partition("{")
        pairs = {}
        for pair in filter(None, labels.rstrip("}").replace('",', '"\n').split("\n")):
            key, value = pair.split("=", 1)
            pairs[key] = value.strip('"')
        samples.append((name, pairs, float(number)))
    return samples


def prometheus_query(engine, container, query):
    """Prometheus' answer to an instant query: [(labels, number)]."""
    answer = engine("exec", container, "promtool", "query", "instant", "--format=json", "http://127.0.0.1:9090", query, check=False)
    if not answer.strip():
        return []
    return [(sample["metric"], float(sample["value"][1])) for sample in json.loads(answer)]
