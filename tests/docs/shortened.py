"""Stands in for ./slalom while a page is tried: the same command with so little to do that it ends within seconds.

    shortened.py PROGRAM PAGE ARGUMENT...

Training takes a few thousand steps, evaluations drive one episode of 10 s on a few courses (always those that the page names),
processes of a service listen on ports of this try alone. What only the wrapper knows (`./slalom test`) is looked up, not run.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import wrapper

STEPS = {False: 2048, True: 4096}  # of a run from its start; of one that is resumed
START = ["run.learning_starts=512", "actor.warmup_steps=512"]
EPISODES = ["evaluation.episodes_per_course=1", "evaluation.time_limit=10"]
COURSES = 4
ROLES = ("replay", "learner", "actor", "evaluator", "status")


def option(arguments, name):
    for index, argument in enumerate(arguments):
        if argument == name and index + 1 < len(arguments):
            return arguments[index + 1]
        if argument.startswith(name + "="):
            return argument[len(name) + 1:]
    return None


def without(arguments, name):
    kept, skip = [], False
    for argument in arguments:
        if skip:
            skip = False
        elif argument == name:
            skip = True
        elif not argument.startswith(name + "="):
            kept.append(argument)
    return kept


def few_courses(program, page, arguments):
    """Replaces the value of --courses by a file with a few of them, under the set's own name."""
    name, collection = option(arguments, "--courses"), option(arguments, "--collection")
    if name is None:
        return arguments
    directory = Path(".short")
    directory.mkdir(exist_ok=True)
    short = directory / (re.sub(r"[^\w.-]", "-", name) + ".courses")
    if short.exists() and not collection and not Path(name).exists():  # The page has named this set before.
        return without(arguments, "--courses") + ["--courses", str(short)]
    whole = directory / "whole.courses"
    whole.unlink(missing_ok=True)
    made = subprocess.run([program, "courses", "generate", "--courses", name, "--output", str(whole)] +
                          (["--collection", collection] if collection else []), capture_output=True, text=True)
    if made.returncode != 0:
        return arguments  # the command itself says what is wrong
    head, *courses = re.split(r"^(?=course )", whole.read_text(), flags=re.MULTILINE)
    courses[-1] = courses[-1][:courses[-1].index("\nend\n") + 5]
    named = [course for course in courses if re.search(r"\b" + re.escape(course.split()[1]) + r"\b", page)]
    chosen = named + [course for course in courses if course not in named][:max(0, COURSES - len(named))]
    short.write_text(head + "".join(chosen) + "checksum none\n")
    return without(arguments, "--courses") + ["--courses", str(short)]


def few_courses_of_plan(path):
    """Gives the scores of a plan, which lies in a copy of the configs, a few courses each."""
    if path.exists():
        text = re.sub(r'^courses = "static-test"', 'courses = "static-train-5"', path.read_text(), flags=re.MULTILINE)
        path.write_text(re.sub(r'^courses = "generated:(\d+):\d+"', rf'courses = "generated:\1:{COURSES}"', text, flags=re.MULTILINE))


def shortened(program, page, arguments):
    command, rest = arguments[0], arguments[1:]
    if "--help" in rest or "-h" in rest:
        return arguments
    if command == "train":
        resumes = "--resume" in rest
        return arguments + ["--set", "run.max_seconds=0", f"run.max_steps={STEPS[resumes]}", *EPISODES, *([] if resumes else START)]
    if command == "evaluate":
        return few_courses(program, page, without(arguments, "--episodes")) + ["--set", *EPISODES]
    if command == "sweep" and rest[:1] != ["import"]:  # Which has no plan.
        few_courses_of_plan(Path(rest[1]))
        return arguments + ["--set", "sweep.seeds=[1]", f"run.max_steps={STEPS[False]}", *START, *EPISODES]
    if command == "service":
        return arguments + ["--set", "run.max_seconds=0", f"run.max_steps={STEPS[False]}", *EPISODES, *START]
    if command in ROLES:
        ports = os.environ["SLALOM_PORTS"].split()
        return arguments + ["--set", f"service.replay=tcp://127.0.0.1:{ports[0]}", f"service.learner=tcp://127.0.0.1:{ports[1]}"]
    return arguments


def main():
    program, page, *arguments = sys.argv[1:]
    if arguments and arguments[0] in wrapper.COMMANDS:
        fault = wrapper.fault(arguments)
        if fault:
            sys.exit(f"slalom: {fault}")
        return
    if not arguments:
        os.execv(program, [program])
    os.execv(program, [program] + shortened(program, Path(page).read_text(encoding="utf-8"), arguments))


main()
