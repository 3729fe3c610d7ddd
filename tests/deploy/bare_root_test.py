#!/usr/bin/env python3
"""README's first command in one go on a bare Debian: a root made by mmdebstrap with nothing installed, a clone, and the result, which
the Python package then drives.

    bare_root_test.py [--cold] [COMMAND ARGUMENT...]

The compiler's cache of this machine is shared, so that a test that has built everything anyway takes minutes; --cold does without,
for the times that README gives. Archives of packages are shared in both cases.
"""

import json
import sys
import time

from bare_root import bare_root, compiler_cache, copy_checkout, run_inside
from engine import ROOT, say

LEAST_SUCCESS = 0.95
FIRST_COMMAND = ["train", "configs/quickstart.toml"]
DRIVE_FROM_PYTHON = """
import sys
import slalom
slalom.make("static-test", profile="configs/real-robot.toml").reset(seed=1)
print(slalom.evaluate(slalom.Policy.load(sys.argv[1]), "static-validation", episodes=1))
"""


def main():
    arguments = sys.argv[1:]
    cold = arguments[:1] == ["--cold"]
    command = arguments[cold:] or FIRST_COMMAND
    with bare_root() as root:
        checkout = copy_checkout(root)
        say("a bare root, with a clone in it")

        def run(command, folder=ROOT):
            begin = time.monotonic()
            inside = ["/bin/bash", "-c", 'cd "$0" && exec "$@"', str(folder), str(ROOT / "slalom"), *command]
            code = run_inside(root, inside, "" if cold else compiler_cache())
            took = time.monotonic() - begin
            say(f"./slalom {command[0]}: exit {code} after {took / 60:.1f} minutes")
            return code == 0

        if not run(command):
            return 1
        if command != FIRST_COMMAND:
            return 0
        evaluation = json.loads((checkout / "runs/quickstart/evaluation.json").read_text())
        success = evaluation["success_rate"]
        say(f"{100 * success:.1f} % on courses that it never saw; at least {100 * LEAST_SUCCESS:.0f} are expected")
        if success < LEAST_SUCCESS:
            return 1
        # From another folder, where presets are found by name as well.
        policy = str(ROOT / "runs/quickstart/policy.safetensors")
        return 0 if run(["python", "-c", DRIVE_FROM_PYTHON, policy], folder="/") else 1


if __name__ == "__main__":
    sys.exit(main())
