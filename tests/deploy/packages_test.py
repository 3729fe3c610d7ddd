#!/usr/bin/env python3
"""`./slalom deb` on a bare Debian: its packages install; a robot is trained, scored and driven from Python there, by presets that are
found from any folder and without a compiler; then the C++ of docs/robot.md builds against the libraries and drives it, too."""

import json
import re
import shutil
import subprocess
import sys

from bare_root import bare_root, run_inside
from engine import ROOT, say

LEAST_SUCCESS = 0.5  # After a million steps.
DRIVE = """
cd /root
apt-get -qq update
DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends /packages/{slalom,python3-slalom}_*.deb >/dev/null
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

BUILD = """
cd /root/drive
DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends g++ cmake make /packages/libslalom-dev_*.deb >/dev/null
cmake -B build -DCMAKE_BUILD_TYPE=Release
cmake --build build
build/drive ../runs/quickstart/policy.safetensors | tee commands
[ "$(grep -c 'm/s' commands)" = 3 ]
build/store
"""
# The other two libraries.
STORE = """
#include "replay/table.h"
#include "sim/environments.h"

int main() {
  const auto spec = slalom::sim::MakeObservationSpec(slalom::sim::EnvironmentConfig{});
  slalom::replay::Table table({.capacity = 100}, spec.num_beams);
  table.Insert(slalom::replay::Chunk(spec.num_beams));
  return spec.num_beams == 720 && table.num_rows() == 0 ? 0 : 1;
}
"""


def write_program(directory):
    blocks = dict(re.findall(r"```(cmake|cpp)\n(.*?)```", (ROOT / "docs/robot.md").read_text(), re.S))
    directory.mkdir()
    (directory / "drive.cc").write_text(blocks["cpp"])
    (directory / "store.cc").write_text(STORE)
    (directory / "CMakeLists.txt").write_text(blocks["cmake"] + "add_executable(store store.cc)\n"
                                              "target_link_libraries(store PRIVATE slalom::sim slalom::replay)\n"
                                              "add_library(shared SHARED drive.cc)\n"
                                              "target_link_libraries(shared PRIVATE slalom::policy_actor)\n")


def main():
    with bare_root() as root:
        subprocess.run([ROOT / "slalom", "deb"], check=True)
        packages = sorted((ROOT / "build/packages").glob("*.deb"))
        if [package.name.split("_")[0] for package in packages] != ["libslalom-dev", "python3-slalom", "slalom"]:
            say(f"expected three packages, found {packages}")
            return 1
        (root / "packages").mkdir()
        for package in packages:
            shutil.copy(package, root / "packages")
        code = run_inside(root, ["/bin/bash", "-exo", "pipefail", "-c", DRIVE])
        if code != 0:
            return code
        success = json.loads((root / "root/runs/quickstart/evaluation.json").read_text())["success_rate"]
        say(f"{100 * success:.1f} % on courses that it never saw; at least {100 * LEAST_SUCCESS:.0f} are expected")
        if success < LEAST_SUCCESS:
            return 1
        write_program(root / "root/drive")
        return run_inside(root, ["/bin/bash", "-exo", "pipefail", "-c", BUILD])


if __name__ == "__main__":
    sys.exit(main())
