"""A Debian with nothing installed, made by mmdebstrap, for tests that install something there. Needs root and mmdebstrap; else the test
is skipped."""

import os
import pathlib
import platform
import shutil
import subprocess
import tempfile
from contextlib import contextmanager

from engine import ROOT, skip

# Runs in namespaces of its own, so that no mount and no process is left behind.
INSIDE = """
set -e
mount -t proc proc "$1/proc"
mount --rbind /dev "$1/dev"
mkdir -p "$1/var/cache/apt/archives" "$1/root/.cache/ccache"
mount --bind /var/cache/apt/archives "$1/var/cache/apt/archives"
[ -z "$2" ] || mount --bind "$2" "$1/root/.cache/ccache"
root=$1
shift 2
exec chroot "$root" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin "$@"
"""


def compiler_cache():
    found = subprocess.run(["ccache", "--get-config", "cache_dir"], check=False, stdout=subprocess.PIPE, text=True).stdout.strip()
    return found if found and pathlib.Path(found).is_dir() else ""


def this_release():
    return platform.freedesktop_os_release()["VERSION_CODENAME"]


@contextmanager
def bare_root(release=None):
    """The folder of a new root of a release of Debian, by default this machine's. Archives of packages are shared with it."""
    if os.geteuid() != 0:
        skip("a root of its own needs root")
    if shutil.which("mmdebstrap") is None:
        skip("mmdebstrap is not installed")
    with tempfile.TemporaryDirectory(prefix="slalom-bare-") as scratch:
        root = pathlib.Path(scratch) / "root"
        subprocess.run(["mmdebstrap", "--quiet", "--variant=minbase", release or this_release(), root], check=True,
                       stdin=subprocess.DEVNULL)
        for file in ("etc/resolv.conf", "etc/hosts"):
            shutil.copy(f"/{file}", root / file)
        yield root


def copy_checkout(root):
    """A clone under the same path in the root, with what has changed in the work tree since the last commit. Returns its folder."""
    checkout = root / str(ROOT).lstrip("/")  # The same path, for the compiler's cache.
    checkout.parent.mkdir(parents=True, exist_ok=True)
    subprocess.run(["git", "clone", "--quiet", ROOT, checkout], check=True)
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", "-z", "--modified", "--others", "--exclude-standard"],
                            check=True, stdout=subprocess.PIPE, text=True).stdout
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).exists():
            (checkout / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, checkout / name)
    return checkout


def run_inside(root, command, cache=""):
    """The exit code of a command in the root. cache: a folder of this machine that is ccache's there."""
    inside = ["unshare", "--mount", "--pid", "--fork", "bash", "-c", INSIDE, "bare", str(root), cache, *command]
    return subprocess.run(inside, check=False, stdin=subprocess.DEVNULL).returncode
