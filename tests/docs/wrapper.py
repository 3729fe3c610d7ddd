"""What ./slalom itself does before it calls the program: looked up in the script, never run."""

import re
import subprocess
from functools import lru_cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "slalom"
COMMANDS = re.findall(r"^  ([a-z]+)\)", SCRIPT.read_text()[SCRIPT.read_text().rindex("\ncase "):], re.MULTILINE)


@lru_cache
def test_help():
    return subprocess.run([SCRIPT, "test", "--help"], capture_output=True, text=True, check=True).stdout


def fault(arguments):
    """Why the wrapper would not take these, or None. Options that `test --help` leaves to ctest are ctest's."""
    command, *rest = arguments
    if command != "test":
        return None
    for index, argument in enumerate(rest):
        if argument.startswith("--") and argument not in ("--help", "--output-on-failure"):
            if not re.search(re.escape(argument) + r"(?![\w-])", test_help()):
                return f"./slalom test has no {argument}"
            if argument == "--part" and not re.search(rf"^ +{re.escape(rest[index + 1])} ", test_help(), re.MULTILINE):
                return f"./slalom test has no part {rest[index + 1]}"
    return None
