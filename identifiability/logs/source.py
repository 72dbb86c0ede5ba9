"""Where logs come from: CSV, Parquet, bags and DataFrames, short and long, are read alike."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from identifiability.foundation.errors import LogError
from identifiability.logs.bags import MixedJointsError, hash_files, is_bag, read_bag, split_topic
from identifiability.logs.containers import CONTAINERS, check_suffix, read_container
from identifiability.logs.conventions import Conventions
from identifiability.logs.form import PLAIN, Form
from identifiability.logs.reading import with_index
from identifiability.logs.scan import scan_table
from identifiability.logs.tables import Table, is_parquet, open_parquet, parsing

if TYPE_CHECKING:
    import pandas as pd

#: Tables with more values are read piece by piece; a value of a CSV takes about so many bytes.
LONG, BYTES_PER_VALUE = 2_000_000, 12

#: Tables with more values are never held in memory.
MOST = 50_000_000


def scan_file(
    path: Path, each: Callable[[pd.DataFrame, Form], None], known: Conventions | None = None
) -> tuple[str, Table | None]:
    """Read a file once from its first row to its last.

    Parameters
    ----------
    path : Path
        A CSV or Parquet file, a container of arrays, or a bag (``bag:/topic``).
    each : callable(DataFrame, Form)
        Called with every piece, at least once, and how it was written.
    known : Conventions, optional
        Which joints are asked for where messages of a bag tell of different ones.

    Returns
    -------
    sha256 : str
    table : Table or None
        None for a bag or a container of arrays, which are no files of rows.

    Raises
    ------
    LogError
        If the file is missing, is no table, or damaged.
    """
    bag = split_topic(path)[0]
    if is_bag(bag):
        digest = hash_files(bag) if bag.exists() else ""
        frame, form = _read_joints(path, known)
        if hash_files(bag) != digest:
            raise LogError(f"{bag} changed while it was read; wait until it is complete.")
        each(frame, form)
        return digest, None
    with parsing(path):
        if not path.is_file():
            raise LogError(f"There is no log file '{path}'; give a CSV or Parquet file.")
        check_suffix(path)
        if path.suffix.lower() in CONTAINERS:
            content = path.read_bytes()
            each(*read_container(path, content))
            return hashlib.sha256(content).hexdigest(), None
        return scan_table(path, each)


def _read_joints(path: Path, known: Conventions | None) -> tuple[pd.DataFrame, Form]:
    """Return the joint states of a bag; where messages differ, those of the robot's joints."""
    known = known or Conventions()
    try:
        return read_bag(path), PLAIN
    except MixedJointsError as mixed:
        called = {known.columns.apply(name): name for name in sorted(mixed.joints)}
        for joints in (known.motors, known.joints):
            if joints and set(joints) <= set(called):
                note = "messages that do not tell of the robot's joints were passed over"
                frame = read_bag(path, joints=[called[j] for j in joints])
                return frame, replace(PLAIN, notes=(note,))
        raise


def read_table(path: str | Path) -> pd.DataFrame:
    """Read a CSV or Parquet file, or the joint states of a bag, as it is.

    Raises
    ------
    LogError
        If the file is missing, is no table, or damaged.
    """
    import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

    pieces: list[pd.DataFrame] = []
    scan_file(Path(path), lambda frame, _: pieces.append(with_index(frame)))
    return pd.concat(pieces, ignore_index=True)


def is_long(path: Path, limit: int | None = None) -> bool:
    """Whether a CSV or Parquet file has too many values to be held in memory without a thought.

    Parameters
    ----------
    path : Path
    limit : int, optional
        How many that is; `LONG` by default.

    Raises
    ------
    LogError
        If it is no table.
    """
    most = LONG if limit is None else limit
    with parsing(path):
        kind = path.suffix.lower()
        if kind in CONTAINERS or is_bag(split_topic(path)[0]) or not path.is_file():
            return False
        if is_parquet(path):
            table = open_parquet(path)
            return table.rows * len(table.columns) > most
        return path.stat().st_size > most * BYTES_PER_VALUE
