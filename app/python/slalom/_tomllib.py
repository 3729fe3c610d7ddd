"""The TOML parser: Python's own, which came with 3.11."""

try:
    from tomllib import loads
except ImportError:
    from tomli import loads

__all__ = ["loads"]
