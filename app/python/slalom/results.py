"""What trainings and evaluations have written, as tables."""

from __future__ import annotations

import csv
import io
import json
import os
from typing import Any, Literal

from . import _slalom

_FILES = {
    "episodes": "evaluation-episodes.csv",
    "courses": "evaluation-courses.csv",
    "tracks": "evaluation-tracks.jsonl",
    "metrics": "metrics.csv",
    "curve": "curve.csv",
}
_TEXT = ("course", "outcome", "agent_status")  # Columns of text, whatever it looks like.


def _cell(column, text):
    if text == "":
        return None
    if column in _TEXT:
        return text
    for kind in int, float:
        try:
            return kind(text)
        except ValueError:
            pass
    return text


def _rows(text):
    """Returns the lines of a CSV file as dictionaries, with numbers as numbers and names as text."""
    return [{key: _cell(key, value) for key, value in row.items()}
            for row in csv.DictReader(io.StringIO(text))]


def _poses(text):
    """Returns a dictionary for each pose of the recorded episodes."""
    rows = []
    for line in text.splitlines():
        drive = json.loads(line)
        rows += [{"course": drive["course"], "episode": drive["episode"], "outcome": drive["outcome"],
                  "time_s": step * drive["step_s"], "x": x, "y": y, "yaw": yaw}
                 for step, (x, y, yaw) in enumerate(drive["poses"])]
    return rows


def read(directory: str | os.PathLike,
         table: Literal["episodes", "courses", "tracks", "metrics", "curve"]) -> Any:
    """Reads a table of a run (`slalom train`) or of an evaluation (`slalom evaluate --output`,
    `Evaluation.write`): a pandas DataFrame if pandas is installed, and otherwise a list of
    dictionaries, whose empty cells are None.

    table: "episodes" and "courses", a row for each; "tracks", a row for each pose of the recorded
    episodes, x and y in metres in the course's frame, yaw in radians; of a run also "metrics", its
    curves over training, and "curve", the scores of its snapshots. docs/evaluation.md and
    docs/training.md have the columns. Raises `slalom.Error` if there is no such table.
    """
    if table not in _FILES:
        raise _slalom.Error(f"table is {table!r}, expected one of {', '.join(map(repr, _FILES))}")
    path = os.path.join(directory, _FILES[table])
    try:
        with open(path, encoding="utf-8-sig") as file:
            text = file.read()
    except OSError as error:
        raise _slalom.Error(f"{path}: cannot be read ({error.strerror})") from None
    rows = _poses(text) if table == "tracks" else _rows(text)
    try:
        import pandas
    except ImportError:
        return rows
    return pandas.DataFrame(rows)
