"""Steps per second of processor time of the Python package, beside its C++, IR-SIM's LiDAR and an EnvPool environment.

    python_rates.py [--program PROGRAM]

Needs `pip install ir-sim envpool gymnasium`; what is missing is left out and named. One thread each; the clock is the processor time
of this process, so other work on the machine counts little. The ways are measured in turn, three times, and the median is printed.

- C++: the module's own step of 64 environments, which makes no arrays; views and copies: a whole `environments.step` of make_vec.
- IR-SIM: one environment with one robot, the cylinders of one of the same courses, and a LiDAR of as many beams.
- EnvPool: 64 environments of Gymnasium's Pendulum-v1 and HalfCheetah-v5, for scale; they have no LiDAR.
"""

import argparse
import os
import statistics
import subprocess
import tempfile
import time

import numpy as np

import slalom

COURSES = "generated:1:96"
NUM_ENVS = 64
BEAMS = 720


def of_slalom():
    """Functions that make one step of 64 environments."""
    random = np.random.default_rng(0)
    actions = [np.stack([random.uniform(-0.2, 0.8, NUM_ENVS), random.uniform(-1, 1, NUM_ENVS)], 1).astype(np.float32)
               for _ in range(100)]
    ways = {}
    for name, copy in ("Slalom in C++", False), ("Slalom, views", False), ("Slalom, copies", True):
        environments = slalom.make_vec(COURSES, num_envs=NUM_ENVS, copy=copy,
                                       episode={"start_position_jitter": 0.05, "start_yaw_jitter": 0.05})
        environments.reset(seed=1)
        step = environments._core.step if name.endswith("C++") else environments.step
        ways[name] = lambda k, step=step: step(actions[k % 100])
    return ways


def of_envpool():
    import envpool
    ways = {}
    for task in "Pendulum-v1", "HalfCheetah-v5":
        pool = envpool.make_gymnasium(task, num_envs=NUM_ENVS, num_threads=1, seed=1)
        pool.reset()
        low, high = pool.action_space.low, pool.action_space.high
        random = np.random.default_rng(0)
        actions = [random.uniform(low, high, (NUM_ENVS, *low.shape)).astype(low.dtype) for _ in range(100)]
        ways[f"EnvPool's {task}"] = lambda k, pool=pool, actions=actions: pool.step(actions[k % 100])
    return ways


WORLD = """
world: {height: 20, width: 20, step_time: 0.2, sample_time: 0.2, offset: [-10, -5]}
robot:
  - kinematics: {name: diff}
    shape: {name: rectangle, length: 0.458, width: 0.416}
    state: [%s, %s, %s]
    goal: [0, 10, 0]
    vel_max: [2, 3.14]
    sensors:
      - {type: lidar2d, range_min: 0.1, range_max: 5, angle_range: 4.71238, number: %d, noise: true, std: 0.001}
obstacle:
"""


def of_irsim(program):
    import irsim
    with tempfile.TemporaryDirectory() as directory:
        course = os.path.join(directory, "one.courses")
        subprocess.run([program, "courses", "generate", "--courses", "generated:1:1", "--output", course], check=True,
                       stdout=subprocess.DEVNULL)
        with open(course, encoding="utf8") as file:
            lines = [line.split() for line in file]
        start = next(words[1:] for words in lines if words[:1] == ["start"])
        circles = [words[1:] for words in lines if words[:1] == ["circle"]]
        world = os.path.join(directory, "world.yaml")
        with open(world, "w", encoding="utf8") as file:
            file.write(WORLD % (*start, BEAMS))
            for x, y, radius in circles:
                file.write(f"  - {{shape: {{name: circle, radius: {radius}}}, state: [{x}, {y}, 0]}}\n")
        environment = irsim.make(world, display=False, log_level="ERROR")
    assert len(environment.get_lidar_scan()["ranges"]) == BEAMS

    def step(k):
        environment.step(np.array([[0.2 * (-1) ** (k // 20)], [0.5]]))  # To and fro before the field.
        return environment.get_lidar_scan()["ranges"]

    return {f"IR-SIM, {len(circles)} cylinders": step}


def rate(step, size, seconds=2.0):
    """Steps per second of processor time."""
    begin = time.process_time()
    k = 0
    while time.process_time() - begin < seconds:
        for _ in range(10):
            step(k)
            k += 1
    return k * size / (time.process_time() - begin)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/release/cli/slalom")
    options = parser.parse_args()
    ways = {name: (step, NUM_ENVS) for name, step in of_slalom().items()}
    for name, make in ("IR-SIM", lambda: of_irsim(options.program)), ("EnvPool", of_envpool):
        try:
            ways |= {way: (step, 1 if name == "IR-SIM" else NUM_ENVS) for way, step in make().items()}
        except ImportError as error:
            print(f"{name} is left out: {error}")
    rates = {name: [] for name in ways}
    for _ in range(3):
        for name, (step, size) in ways.items():
            rates[name].append(rate(step, size))
    medians = {name: statistics.median(found) for name, found in rates.items()}
    for name, found in medians.items():
        print(f"{name:30} {found:12,.0f} steps/s  {100 * found / medians['Slalom in C++']:8.2f} % of C++")


if __name__ == "__main__":
    main()
