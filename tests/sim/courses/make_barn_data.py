#!/usr/bin/env python3
"""Makes the directory of published worlds that the tests compare with (docs/courses.md).

    git clone https://github.com/Daffan/ros_jackal
    tests/sim/courses/make_barn_data.py ros_jackal OUTPUT

Reads the world files, paths, plugins and configs of the clone with nothing but Python's own library and objdump, and shares no code
with Slalom's importer, which the tests check against the result. The plugins are not run: the numbers that they give to Gazebo are
read out of their machine code.
"""

import argparse
import ast
import json
import re
import struct
import subprocess
import sys
import tarfile
import xml.etree.ElementTree as xml
from pathlib import Path

COLUMNS, ROWS, CELL = 30, 64, 0.15
X_0, Y_0 = -4.425, 0.075


def models(worlds, number):
    """The models of a world, without those of its <state>. Worlds 300-399 end in a stray quotation mark."""
    return xml.fromstring((worlds / f"world_{number}.world").read_text().rstrip().rstrip('"')).findall("world/model")


def pose(model):
    x, y, _, _, _, yaw = (float(word) for word in model.findtext("pose").split())
    return x, y, yaw


def collision(model, shape, size):
    return model.findtext(f"link/collision/geometry/{shape}/{size}")


def cylinders(worlds, number):
    return [pose(model)[:2] for model in models(worlds, number) if collision(model, "cylinder", "radius")]


def grid(worlds, number):
    rows = [["."] * COLUMNS for _ in range(ROWS)]
    for x, y in cylinders(worlds, number):
        column, row = round((x - X_0) / CELL), round((y - Y_0) / CELL)
        if abs(X_0 + CELL * column - x) > 1e-6 or abs(Y_0 + CELL * row - y) > 1e-6:
            sys.exit(f"world {number}: the cylinder at ({x}, {y}) is not on the lattice")
        rows[row][column] = "#"
    return ["".join(row) for row in reversed(rows)]


def path_cells(file):
    """The (row, column) pairs of an .npy file, format version 1."""
    data = file.read_bytes()
    length = struct.unpack_from("<H", data, 8)[0]
    header = ast.literal_eval(data[10:10 + length].decode())
    count, width = header["shape"]
    if header["descr"] != "<i8" or width != 2:
        sys.exit(f"{file}: {header} is not a path")
    numbers = struct.unpack_from(f"<{2 * count}q", data, 10 + length)
    return list(zip(numbers[:count], numbers[count:])) if header["fortran_order"] else list(zip(numbers[::2], numbers[1::2]))


def motion(plugin):
    """x0, y0, x1, y1, yaw and period of a plugin. It is compiled without optimisation, so Load() puts each number where the next call
    finds it, the last argument first: the period, then for each of two key frames its time, z, y, x, yaw, pitch and roll."""
    data = plugin.read_bytes()
    code = subprocess.run(["objdump", "--disassemble", "--demangle", "--no-show-raw-insn", str(plugin)], check=True,
                          capture_output=True, text=True).stdout
    load = re.search(r"^[0-9a-f]+ <[^\n]*::Load\(.*?^$", code, re.M | re.S).group()
    numbers, frames, period = [], [], None
    for line in load.splitlines():
        if constant := re.search(r"mov(?:sd)? .*\(%rip\),%(?:xmm0|rax) +# ([0-9a-f]+)", line):
            numbers.append(struct.unpack_from("<d", data, int(constant.group(1), 16))[0])  # .rodata lies at its address in the file.
        elif "pxor" in line:
            numbers.append(0.0)
        elif "call" in line and "PoseAnimation::PoseAnimation(" in line:
            period, numbers = numbers[-1], []
        elif "call" in line and "CreateKeyFrame" in line:
            numbers = []
        elif "call" in line and "PoseKeyFrame::Rotation" in line:
            _, y, x, yaw, _, _ = numbers
            frames.append((x, y, yaw))
    (x0, y0, yaw0), (x1, y1, yaw1) = frames
    if yaw0 != yaw1 or period is None:
        sys.exit(f"{plugin}: expected two key frames of one heading and a period")
    return x0, y0, x1, y1, yaw0, period


def motion_lines(worlds, plugins, numbers, kind):
    yield "world,object,size_x,size_y,x0,y0,x1,y1,yaw,period_s"
    for number in numbers:
        moving = [model for model in models(worlds, number) if model.find("plugin") is not None]
        for i, model in enumerate(moving):
            name = model.find("plugin").get("filename")
            size = [float(word) for word in collision(model, "box", "size").split()[:2]]
            word = str(i) if kind == "box" else re.search("left|right", name).group()
            yield f"{number},{word}," + ",".join(f"{value:.2f}" for value in [*size, *motion(plugins / name)])


def fixed_walls(worlds):
    yield "name,size_x,size_y,x,y,yaw"
    for model in models(worlds, 300):
        if model.find("plugin") is None and collision(model, "box", "size"):
            size = [float(word) for word in collision(model, "box", "size").split()[:2]]
            yield model.get("name") + "," + ",".join(f"{value:.6g}" for value in [*size, *pose(model)])


def split(configs, file, key):
    return json.loads(re.search(rf"^ *{key}: *(\[.*?\])", (configs / file).read_text(), re.M | re.S).group(1))


def splits(configs):
    """The configs number the dynamic worlds 100 higher than their files."""
    sets = {f"static-train-{n}": split(configs, f"generalization/num_world_{n}.yaml", "worlds") for n in (5, 10, 50, 100, 250)}
    sets["static-test"] = split(configs, "generalization/num_world_50.yaml", "test_worlds")
    for kind in ("box", "wall"):
        for name, key in (("train", "worlds"), ("test", "test_worlds")):
            listed = split(configs, f"architecture_dynamic_{kind}/mlp_history_length_1.yaml", key)
            sets[f"dynamic-{kind}-{name}"] = [number - 100 for number in listed]
    return sets


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clone", type=Path, help="a clone of https://github.com/Daffan/ros_jackal")
    parser.add_argument("output", type=Path, help="the directory to make")
    options = parser.parse_args()
    worlds = options.clone / "jackal_helper/worlds/BARN"
    plugins = options.clone / "jackal_helper/plugins/build"
    for needed in (worlds, plugins):
        if not needed.is_dir():
            sys.exit(f"{needed} is not a directory; expected a clone of https://github.com/Daffan/ros_jackal")
    if options.output.exists():
        sys.exit(f"{options.output} exists; expected the name of a new directory")

    def write(name, lines):
        (options.output / name).write_text("".join(f"{line}\n" for line in lines))

    (options.output / "sample_worlds").mkdir(parents=True)
    write("static_grids.txt", (line for n in range(300) for line in [f"world {n}", *grid(worlds, n)]))
    write("static_paths.csv", ["world,i,row,col", *(f"{n},{i},{row},{column}" for n in range(300) for i, (row, column)
                                                    in enumerate(path_cells(worlds / f"path_files/path_{n}.npy")))])
    write("dynamic_box.csv", motion_lines(worlds, plugins, range(300, 400), "box"))
    write("dynamic_box_fixed.csv", fixed_walls(worlds))
    write("dynamic_wall.csv", motion_lines(worlds, plugins, range(400, 500), "wall"))
    write("dynamic_wall_fixed.csv", ["x,y", *(f"{x:.3f},{y:.3f}" for x, y in sorted(cylinders(worlds, 400)))])
    write("splits.json", [json.dumps(splits(options.clone / "configs"), indent=1)])
    for number in (0, 299, 300, 400):
        name = f"world_{number}.world"
        (options.output / "sample_worlds" / name).write_bytes((worlds / name).read_bytes())
    for number in (0, 299):
        name = f"path_{number}.npy"
        (options.output / "sample_worlds" / name).write_bytes((worlds / "path_files" / name).read_bytes())
    with tarfile.open(options.output / "barn_worlds.tar.xz", "w:xz") as archive:
        for number in range(500):
            archive.add(worlds / f"world_{number}.world", f"world_{number}.world")
        for number in range(300):
            archive.add(worlds / f"path_files/path_{number}.npy", f"path_files/path_{number}.npy")


if __name__ == "__main__":
    try:
        main()
    except OSError as error:  # A file that the clone lacks, or no objdump.
        sys.exit(f"make_barn_data.py: {error}")
