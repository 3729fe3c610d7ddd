#!/usr/bin/env python3
"""`./slalom deb` on a bare Debian: its packages install; a robot is trained, scored and driven from Python there, by presets that are
found from any folder and without a compiler; then the C++ of docs/robot.md builds against the libraries and drives it, too.

    packages_test.py [RELEASE]

RELEASE is that of another Debian than this machine's, such as trixie: the packages are built in a root of it, which takes an hour, and
so is a wheel for its Python, which is installed in a virtual environment of the bare root.
"""

import json
import re
import shutil
import subprocess
import sys

from bare_root import bare_root, compiler_cache, copy_checkout, run_inside
from engine import ROOT, say

LEAST_SUCCESS = 0.5  # After a million steps.
DRIVE = """
cd /root
apt-get -qq update
DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends /packages/{slalom,python3-slalom}_*.deb >/dev/null
test -z "$(command -v c++ cmake)"
grep -q '= libtomlplusplus-dev =' /usr/share/doc/slalom/copyright
grep -q '= pybind11-dev =' "$(dirname "$(python3 -c 'import slalom; print(slalom.__file__)')")/copyright"
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
# The other libraries, and the guard of docs/robot.md.
STORE = """
#include <array>

#include "policy/network_agent.h"
#include "replay/table.h"
#include "sim/environments.h"

std::unique_ptr<slalom::env::Agent> Guarded(std::unique_ptr<slalom::policy::PolicyAgent> policy);

int main() {
  slalom::policy::PolicySpec driver;
  const auto agent = Guarded(std::make_unique<slalom::policy::NetworkAgent>(slalom::policy::ZeroSnapshot(driver)));
  slalom::env::ObservationBatch wall;
  wall.Resize(1, driver.observation.num_beams);
  wall.ranges_cm.assign(wall.ranges_cm.size(), 25);
  std::array<float, 2> action{};
  agent->Act(wall, action);
  if (!agent->Intervened(0)) return 2;
  const auto spec = slalom::sim::MakeObservationSpec(slalom::sim::EnvironmentConfig{});
  slalom::replay::Table table({.capacity = 100}, spec.num_beams);
  table.Insert(slalom::replay::Chunk(spec.num_beams));
  return spec.num_beams == 720 && table.num_rows() == 0 ? 0 : 1;
}
"""


def write_program(directory):
    cmake, drive, guard = re.findall(r"```(?:cmake|cpp)\n(.*?)```", (ROOT / "docs/robot.md").read_text(), re.S)
    directory.mkdir()
    (directory / "drive.cc").write_text(drive)
    (directory / "guard.cc").write_text(guard)
    (directory / "store.cc").write_text(STORE)
    (directory / "CMakeLists.txt").write_text(cmake + "add_executable(store store.cc guard.cc)\n"
                                              "target_link_libraries(store PRIVATE slalom::sim slalom::replay\n"
                                              "  slalom::policy_actor slalom::planners)\n"
                                              "add_library(shared SHARED drive.cc)\n"
                                              "target_link_libraries(shared PRIVATE slalom::policy_actor)\n")


# On another release, beside its packages.
WHEEL = f"""
cd {ROOT}
./slalom deb
DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends python3-pip python3-scikit-build-core >/dev/null
pip wheel --no-build-isolation --no-deps --no-index --wheel-dir build/packages .
"""
INSTALL_WHEEL = """
cd /root
DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends python3-venv >/dev/null
python3 -m venv --system-site-packages venv
dpkg --remove python3-slalom
venv/bin/pip install --no-deps --no-index /packages/slalom-*.whl
venv/bin/python -c 'import slalom
print(slalom.__file__)
assert "venv" in slalom.__file__
print(slalom.evaluate(slalom.Policy.load("runs/quickstart/policy.safetensors"), "static-validation", episodes=1))'
"""


def build_packages(release):
    """Makes the packages in build/packages, and beside them the wheel of another release."""
    if release is None:
        subprocess.run([ROOT / "slalom", "deb"], check=True)
        return
    made = ROOT / "build/packages"
    shutil.rmtree(made, ignore_errors=True)
    with bare_root(release) as root:
        checkout = copy_checkout(root)
        if run_inside(root, ["/bin/bash", "-exo", "pipefail", "-c", WHEEL], compiler_cache()) != 0:
            for log in (checkout / "build").glob("*.log"):
                shutil.copy(log, ROOT / "build")
            raise SystemExit(f"the packages of {release} cannot be built; logs are in build/")
        shutil.copytree(checkout / "build/packages", made)


def main():
    release = sys.argv[1] if len(sys.argv) > 1 else None
    build_packages(release)
    with bare_root(release) as root:
        packages = sorted((ROOT / "build/packages").iterdir())
        kinds = [re.split("[_-][0-9]", package.name)[0] + package.suffix for package in packages]
        expected = ["libslalom-dev.deb", "python3-slalom.deb", "slalom.deb"] + ["slalom.whl"] * (release is not None)
        if sorted(kinds) != expected:
            say(f"expected {expected}, found {packages}")
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
        code = run_inside(root, ["/bin/bash", "-exo", "pipefail", "-c", BUILD])
        if code == 0 and release is not None:
            code = run_inside(root, ["/bin/bash", "-exo", "pipefail", "-c", INSTALL_WHEEL])
        return code


if __name__ == "__main__":
    sys.exit(main())
