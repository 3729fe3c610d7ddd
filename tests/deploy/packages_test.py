#!/usr/bin/env python3
"""`./slalom deb` on a bare Debian: both packages install, and a robot is trained, scored and driven from Python there, by presets that
are found from any folder and without a compiler."""

import json
import shutil
import subprocess
import sys

from bare_root import bare_root, run_inside
from engine import ROOT, say

LEAST_SUCCESS = 0.5  # After a million steps.
DRIVE = """
cd /root
apt-get -qq update
DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends /packages/*.deb >/dev/null
test -z "$(command -v c++ cmake)"
slalom train configs/quickstart.toml --deterministic --set run.max_seconds=0 --set run.max_steps=1000000
slalom evaluate --policy runs/quickstart/policy.safetensors --courses static-validation --profile configs/real-robot.toml --episodes 1
slalom evaluate --agent dwa --config configs/planners/fast-dwa.toml --courses generated:3:4 --episodes 1
slalom sweep plan configs/sweeps/static.toml
slalom export --policy runs/quickstart/policy.safetensors --onnx policy.onnx
python3 -c 'import slalom
print(slalom.evaluate(slalom.Policy.load("runs/quickstart/policy.safetensors"), "static-validation", episodes=1))
slalom.make("static-test", profile="configs/real-robot.toml").reset(seed=1)'
(slalom train configs/quickstrat.toml 2>&1 || true) | grep "did you mean 'configs/quickstart.toml'"
"""


def main():
    with bare_root() as root:
        subprocess.run([ROOT / "slalom", "deb"], check=True)
        packages = sorted((ROOT / "build/packages").glob("*.deb"))
        if [package.name.split("_")[0] for package in packages] != ["python3-slalom", "slalom"]:
            say(f"expected two packages, found {packages}")
            return 1
        (root / "packages").mkdir()
        for package in packages:
            shutil.copy(package, root / "packages")
        code = run_inside(root, ["/bin/bash", "-exo", "pipefail", "-c", DRIVE])
        if code != 0:
            return code
        success = json.loads((root / "root/runs/quickstart/evaluation.json").read_text())["success_rate"]
        say(f"{100 * success:.1f} % on courses that it never saw; at least {100 * LEAST_SUCCESS:.0f} are expected")
        return 0 if success >= LEAST_SUCCESS else 1


if __name__ == "__main__":
    sys.exit(main())
