"""Refuse a path at which there is no log; who looks for a file waits for nothing else."""

from __future__ import annotations

from pathlib import Path

from identifiability.foundation.errors import LogError
from identifiability.logs.bags import is_bag, split_topic


def check_there(path: Path) -> None:
    """Refuse a path at which there is no log.

    Raises
    ------
    LogError
    """
    bag = split_topic(path)[0]
    try:
        there = bag.exists()
        other = there and not bag.is_file() and not bag.is_dir()
    except OSError:  # no name of a file; its reader says why
        return
    if not there and is_bag(bag):
        raise LogError(f"There is no bag '{bag}'; give a .mcap, .db3 or .bag file or a folder.")
    if other:  # a pipe would be waited for, a device has no end
        raise LogError(f"'{path}' is no file; give a CSV or Parquet file.")
    if not there:
        raise LogError(f"There is no log file '{path}'; give a CSV or Parquet file.")
