"""What the package's Python sources use of its C++. Internal: the package `slalom` is what may be relied on."""

from typing import Any

class Error(ValueError): ...

__version__: str
commit: str

def course_sets(collection: str = ...) -> list[str]:
    """The names of the course sets, built in or of a collection."""

def __getattr__(name: str) -> Any: ...
