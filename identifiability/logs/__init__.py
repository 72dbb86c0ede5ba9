"""From files to `Log`: CSV, Parquet, bags of ROS, DataFrames, short and long."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .log import Log

__all__ = ["Log"]


def __getattr__(name: str) -> Any:
    """Import `Log` when it is first used; code that only needs columns does not load it."""
    if name != "Log":
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    value = import_module(f"{__name__}.log").Log
    globals()[name] = value  # where those look who read a module instead of using it
    return value
