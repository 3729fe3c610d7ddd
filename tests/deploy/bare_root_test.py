#!/usr/bin/env python3
"""README's first command in one go on a bare Debian: a root made by mmdebstrap with nothing installed, a clone, and the result, which
the Python package then drives.

    bare_root_test.py [--cold] [COMMAND ARGUMENT...]

The compiler's cache of this machine is shared, so that a test that has built everything anyway takes minutes; --cold does without,
for the times that README gives. Archives of packages are shared in both cases. Needs root and mmdebstrap; else it is skipped.
"""

import json
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import tempfile
import time

from engine import ROOT, say, skip

LEAST_SUCCESS = 0.95
FIRST_COMMAND = ["train", "configs/quickstart.toml"]
DRIVE_FROM_PYTHON = """
import slalom
print(slalom.evaluate(slalom.Policy.load("runs/quickstart/policy.safetensors"), "static-validation", episodes=1))
"""

# Runs in namespaces of its own, so that no mount and no process is left behind.
INSIDE = """
set -e
mount -t proc proc "$1/proc"
mount --rbind /dev "$1/dev"
mkdir -p "$1/var/cache/apt/archives" "$1/root/.cache/ccache"
mount --bind /var/cache/apt/archives "$1/var/cache/apt/archives"
[ -z "$3" ] || mount --bind "$3" "$1/root/.cache/ccache"
root=$1 checkout=$2
shift 3
exec chroot "$root" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin "$@"
"""


def copy_checkout(checkout):
    """A clone, with what has changed in the work tree since the last commit."""
    subprocess.run(["git", "clone", "--quiet", ROOT, checkout], check=True)
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", "-z", "--modified", "--others", "--exclude-standard"],
                            check=True, stdout=subprocess.PIPE, text=True).stdout
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).exists():
            (checkout / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, checkout / name)


def compiler_cache():
    found = subprocess.run(["ccache", "--get-config", "cache_dir"], check=False, stdout=subprocess.PIPE, text=True).stdout.strip()
    return found if found and pathlib.Path(found).is_dir() else ""


def main():
    arguments = sys.argv[1:]
    cold = arguments[:1] == ["--cold"]
    command = arguments[cold:] or FIRST_COMMAND
    if os.geteuid() != 0:
        skip("a root of its own needs root")
    if shutil.which("mmdebstrap") is None:
        skip("mmdebstrap is not installed")
    with tempfile.TemporaryDirectory(prefix="slalom-bare-") as scratch:
        root = pathlib.Path(scratch) / "root"
        subprocess.run(["mmdebstrap", "--quiet", "--variant=minbase", platform.freedesktop_os_release()["VERSION_CODENAME"], root],
                       check=True, stdin=subprocess.DEVNULL)
        for file in ("etc/resolv.conf", "etc/hosts"):
            shutil.copy(f"/{file}", root / file)
        checkout = root / str(ROOT).lstrip("/")  # The same path, for the compiler's cache.
        checkout.parent.mkdir(parents=True, exist_ok=True)
        copy_checkout(checkout)
        say("a bare root, with a clone in it")

        def run(command):
            begin = time.monotonic()
            inside = ["/bin/bash", "-c", 'cd "$0" && exec ./slalom "$@"', str(ROOT), *command]
            done = subprocess.run(["unshare", "--mount", "--pid", "--fork", "bash", "-c", INSIDE, "bare", str(root), str(ROOT),
                                   "" if cold else compiler_cache(), *inside], check=False, stdin=subprocess.DEVNULL)
            took = time.monotonic() - begin
            say(f"./slalom {command[0]}: exit {done.returncode} after {took / 60:.1f} minutes")
            return done.returncode == 0

        if not run(command):
            return 1
        if command != FIRST_COMMAND:
            return 0
        evaluation = json.loads((checkout / "runs/quickstart/evaluation.json").read_text())
        success = evaluation["success_rate"]
        say(f"{100 * success:.1f} % on courses that it never saw; at least {100 * LEAST_SUCCESS:.0f} are expected")
        if success < LEAST_SUCCESS:
            return 1
        return 0 if run(["python", "-c", DRIVE_FROM_PYTHON]) else 1


if __name__ == "__main__":
    sys.exit(main())
