"""Types what the pages of the manual tell their reader to type.

    pages_test.py PROGRAM PAGE          runs the commands of one page, in order, in one scratch directory
    pages_test.py PROGRAM --all PAGE... says of every command on any page, run or not, whether it exists with its options, and
                                        whether each page with commands to run is among those named

A command stands in a block of ```sh. A block that cannot be run here has, on the line before it, <!-- not run: REASON -->. What a
page needs that another page made is <!-- runs first: COMMAND --> on a line of its own. Everything else is run, with little to do
(shortened.py). A command that fails is named with page and line.
"""

import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import wrapper
from page import Page, words

ROOT = wrapper.ROOT
HERE = Path(__file__).resolve().parent
SECONDS = 280


def free_ports(count):
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [str(each.getsockname()[1]) for each in sockets]
    for each in sockets:
        each.close()
    return ports


def end_session(session):
    """Ends what a page left running."""
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and int((entry / "stat").read_text().rpartition(")")[2].split()[3]) == session:
                os.kill(int(entry.name), signal.SIGKILL)
        except (OSError, IndexError):
            continue


def run_page(program, page):
    """Returns 0, or 1 after saying which line failed."""
    if not any(page.script):
        return 0
    name = page.path.relative_to(ROOT)
    with tempfile.TemporaryDirectory(prefix="slalom-page-") as scratch:
        for folder in ("configs", "docs"):
            shutil.copytree(ROOT / folder, Path(scratch) / folder)
        stub = Path(scratch) / "slalom"
        stub.write_text("#!/bin/sh\nexec " + shlex.join(
            [sys.executable, "-B", str(HERE / "shortened.py"), str(program), str(page.path)]) + ' "$@"\n')
        stub.chmod(0o755)
        # One line of script for each line of the page, so LINENO is the page's.
        first = f"set -Eemo pipefail; PS4='+ {name}:$LINENO: '; trap 'echo \"{name}:$LINENO: failed: $BASH_COMMAND\"' ERR; set -x; "
        script = Path(scratch) / "page.sh"
        script.write_text(first + "\n".join(page.script) + "\n")
        process = subprocess.Popen(["bash", "page.sh"], cwd=scratch, stdin=subprocess.DEVNULL, stderr=subprocess.STDOUT,
                                   start_new_session=True, env=os.environ | {"SLALOM_PORTS": " ".join(free_ports(2))})
        try:
            status = process.wait(timeout=SECONDS)
        except subprocess.TimeoutExpired:
            print(f"{name}: the commands took more than {SECONDS} s")
            status = 1
        finally:
            end_session(process.pid)
        return 1 if status else 0


class Program:
    """What the program says of itself."""

    def __init__(self, path):
        self.path = path
        self.groups = {}
        self.keys, section = set(), ""
        for line in self.ask("config", "docs").splitlines():
            heading, row = re.match(r"## `\[(\S+)\]`", line), re.match(r"\| `(\w+)` \|", line)
            section = heading.group(1) if heading else section
            if row:
                self.keys.add(f"{section}.{row.group(1)}")

    def ask(self, *arguments):
        done = subprocess.run([self.path, *arguments], capture_output=True, text=True)
        return done.stdout if done.returncode == 0 else ""

    def commands(self, *group):
        """The help of each command, or of each one of a group, by its name. All of them from one start of the program."""
        if group not in self.groups:
            _, *parts = re.split(r"^([a-z][a-z-]*)$", self.ask(*group, "--help-all"), flags=re.MULTILINE)
            self.groups[group] = dict(zip(parts[::2], parts[1::2]))
        return self.groups[group]

    def fault(self, arguments):
        """Why the program would not take these arguments, or None."""
        if arguments[0] in wrapper.COMMANDS:
            return wrapper.fault(arguments)
        if arguments[0].startswith("-"):
            return None
        command, rest = [arguments[0]], arguments[1:]
        text = self.commands().get(command[0])
        if text and re.search(r"^ +Subcommands:", text, re.MULTILINE) and rest and not rest[0].startswith("-"):
            text = self.commands(*command).get(rest[0])
            command.append(rest[0])
        if not text:
            return f"there is no command {' '.join(command)}"
        for word in rest:
            name = word.partition("=")[0]
            if name.startswith("--") and name != "--help" and not re.search(re.escape(name) + r"(?![\w-])", text):
                return f"{' '.join(command)} has no {name}"
            if re.fullmatch(r"[a-z_]+(\.[a-z_0-9]+)+", name) and "=" in word and name not in self.keys:
                return f"no config has a key {name}"
        return None


def check_pages(program, tested):
    """Returns how many faults were said."""
    faults = []
    pages = [Page(path) for path in sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])]
    for page in pages:
        if any(page.script) and page.path not in tested:
            faults.append(f"{page.path.relative_to(ROOT)}: not in the list of pages of tests/docs/CMakeLists.txt")
    asked = Program(program)
    for page in pages:
        name = page.path.relative_to(ROOT)
        faults += [f"{name}:{line}: {fault}" for line, fault in page.faults]
        for line, command in page.commands:
            arguments = words(command)[1:]
            fault = asked.fault(arguments) if arguments else None
            if fault:
                faults.append(f"{name}:{line}: {fault}: {command.strip()}")
    print("\n".join(faults))
    return len(faults)


def main():
    program, *arguments = sys.argv[1:]
    program = Path(program).resolve()
    if arguments[0] == "--all":
        sys.exit(1 if check_pages(program, [ROOT / name for name in arguments[1:]]) else 0)
    sys.exit(run_page(program, Page(ROOT / arguments[0])))


main()
