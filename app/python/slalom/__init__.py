"""Slalom's simulator and policies in Python. docs/python.md is the guide."""

from ._slalom import Error, __version__, commit, course_sets
from .actor import Actor
from .driver import Command, Driver, Guard
from .environment import Environment, VectorEnvironment, make, make_vec
from .evaluation import Evaluation, evaluate, report
from .policy import Policy
from .results import read

Error.__module__ = "slalom"

__all__ = [
    "Actor",
    "Command",
    "Driver",
    "Environment",
    "Error",
    "Evaluation",
    "Guard",
    "Policy",
    "VectorEnvironment",
    "__version__",
    "commit",
    "course_sets",
    "evaluate",
    "make",
    "make_vec",
    "read",
    "report",
]
