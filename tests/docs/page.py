"""What a Markdown page of the manual tells its reader to type."""

import re
import shlex
from pathlib import Path

FENCE = re.compile(r"^ {0,3}(```+|~~~+) *([\w-]*)")
NOT_RUN = re.compile(r"^<!-- not run: (\S.*) -->$")
RUNS_FIRST = re.compile(r"^<!-- runs first: (\S.*) -->$")
SPAN = re.compile(r"`([^`]+)`")
CALL = re.compile(r"^ *(?:\$ )?(\./)?slalom [a-z-]")


class Page:
    """One page. Lines are numbered from 1.

    script     the page as a shell script with one line for each line of the page, so that an error's line is the page's:
               lines of ```sh blocks and of `<!-- runs first: COMMAND -->` as they are, all others empty
    commands   (line, text) of every command that mentions the program: in blocks, run or not, and in `code spans`
    faults     (line, text) of what is written in a form that this test would pass over
    """

    def __init__(self, path: Path):
        self.path = path
        self.script = []
        self.commands = []
        self.faults = []
        fence, language, marked = None, "", False
        lines = path.read_text(encoding="utf-8").splitlines()
        for number, line in enumerate(lines, 1):
            opening = FENCE.match(line)
            run = ""
            if fence is None and opening:
                fence, language = opening.group(1), opening.group(2)
                previous = lines[number - 2] if number > 1 else ""
                marked = NOT_RUN.match(previous) is not None
                if previous.startswith("<!-- not run") and not marked:
                    self.faults.append((number - 1, "write <!-- not run: REASON -->"))
                if marked and language != "sh":
                    self.faults.append((number, "only a block of ```sh can be marked as not run"))
            elif fence is not None and line.strip() == fence:
                fence = None
            elif fence is not None and language == "sh":
                run = "" if marked else line
                if CALL.match(line):
                    self.commands.append((number, line))
            elif fence is not None or line.startswith("    "):
                if CALL.match(line):
                    self.faults.append((number, "a command belongs into a block of ```sh"))
            elif RUNS_FIRST.match(line):
                run = RUNS_FIRST.match(line).group(1)
                self.commands.append((number, run))
            else:
                self.commands += [(number, span) for span in SPAN.findall(line) if CALL.match(span)]
            self.script.append(run)
        if fence is not None:
            self.faults.append((len(lines), "the last block of code has no end"))


def words(command: str) -> list:
    """The words of the first simple command of a line: comments, pipes and what follows left out."""
    lexer = shlex.shlex(command, posix=True, punctuation_chars="|&;<>()")
    lexer.whitespace_split = True
    found = []
    try:
        for word in lexer:
            if word and word[0] in "|&;<>()":
                break
            found.append(word)
    except ValueError:
        pass
    return found
