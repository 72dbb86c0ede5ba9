"""LeRobot dataset folders (v2.0, v2.1, v3.0): each episode is a log of positions and commands.

``meta/info.json`` names the joints of ``observation.state`` (positions) and ``action`` (commands);
``data`` holds Parquet with a row for each sample, ``timestamp`` [s] and ``episode_index``. The user
names one episode after a colon, ``dataset:3``, or several, ``dataset:0-4``. The folder does not
state the unit of positions: LeRobot writes degrees, shares of a joint's range or radians.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from hashlib import sha256
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array, numbered
from identifiability.foundation.quoting import path_for_shell
from identifiability.logs.form import PLAIN
from identifiability.logs.names import KINDS
from identifiability.logs.rules import RULES

from .parquet import check_parquet
from .reader import Whole, reader

if TYPE_CHECKING:
    import pandas as pd

    from identifiability.logs.conventions import Conventions

#: File that marks a folder as a dataset.
INFO = Path("meta") / "info.json"

#: Columns that are read, and the channel of their values, unless their names state another.
FEATURES = {
    "observation.state": "q",
    "observation.velocity": "dq",
    "observation.effort": "tau",
    "observation.current": "current",
    "action": "cmd",
}

_COMMANDS = {"q": "cmd", "dq": "dq_cmd", "tau": "tau_cmd", "current": "current_cmd"}

#: The file of one episode in v2.
_EPISODE_FILE = re.compile(r"episode_\d+\.parquet")

#: Numbers of episodes behind a colon.
_EPISODES = re.compile(r"(\d{1,9})(?:-(\d{1,9}))?")


def is_dataset(path: Path) -> bool:
    """Return whether a folder, with episodes behind a colon or without, is a LeRobot dataset."""
    try:
        return (split_episodes(path)[0] / INFO).is_file()
    except OSError:  # no name of a file
        return False


def split_episodes(path: str | Path) -> tuple[Path, str]:
    """Return the folder and the text after the colon in ``dataset:3``; empty if there is none."""
    folder, colon, text = str(path).rpartition(":")
    if colon and _EPISODES.fullmatch(text):
        return Path(folder), text
    return Path(path), ""


def join_episodes(paths: Iterable[str]) -> list[str]:
    """Return paths with consecutive episodes of a dataset as one.

    Example
    -------
    >>> join_episodes(["arm:0", "arm:1", "arm:2", "arm:5", "a.csv"])
    ['arm:0-2', 'arm:5', 'a.csv']
    """

    def run_of(item: tuple[int, str]) -> tuple[str, int]:
        place, path = item
        folder, text = split_episodes(path)
        return (str(folder), int(text) - place) if text.isdigit() else (path, 0)

    joined = []
    for _, run in groupby(enumerate(paths), run_of):
        every = [path for _, path in run]
        last = split_episodes(every[-1])[1]
        joined.append(f"{every[0]}-{last}" if len(every) > 1 else every[0])
    return joined


def list_episodes(path: str | Path) -> list[Path]:
    """Return the episodes that a path names, ``dataset:0``, ``dataset:1`` …, all by default.

    Raises
    ------
    LogError
        If there is no episode, or the folder has another version.
    """
    folder, text = split_episodes(path)
    info = _read_info(folder)
    count = info.get("total_episodes", 0)
    if not (isinstance(count, int) and count > 0):
        raise LogError(f"{folder} holds no episode; record one.")
    named = _EPISODES.fullmatch(text)
    first, last = (int(named[1]), int(named[2] or named[1])) if named else (0, count - 1)
    if not first <= last < count:
        raise LogError(
            f"{folder} has the episodes 0 to {count - 1}, not {text}; name one as "
            f"'{folder.name}:0', or several as '{folder.name}:0-{count - 1}'."
        )
    held = last + 1 if first == last else _count_held(folder)
    if last - first >= held:
        raise LogError(
            Finding(
                "dataset.episodes",
                folder,
                count=count,
                held=held,
                name=folder.name,
                last=max(held - 1, 0),
            )
        )
    return [Path(f"{folder}:{k}") for k in range(first, last + 1)]


def _count_held(folder: Path) -> int:
    """Return the number of episodes that the files of a dataset hold at most.

    In v2 each episode has a file. In v3 each has at least one row.
    """
    from pyarrow.parquet import read_metadata  # noqa: PLC0415 - only who reads datasets pays for it

    files = [*(folder / "data").glob("**/*.parquet")]
    if any(_EPISODE_FILE.fullmatch(file.name) for file in files):
        return len(files)
    return sum(read_metadata(file).num_rows for file in files)


def read_episode(path: str | Path) -> pd.DataFrame:
    """Return the episode that a path names as a table with the columns of a log.

    Returns
    -------
    DataFrame
        ``t`` [s], ``<joint>.q`` and ``<joint>.cmd`` in the dataset's unit, and further columns.

    Raises
    ------
    LogError
        If the path names several episodes, or the dataset lacks positions.
    """
    import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it
    import pyarrow.dataset as ds  # noqa: PLC0415

    folder = split_episodes(path)[0]
    episodes = list_episodes(path)
    if len(episodes) > 1:
        raise LogError(
            Finding(
                "dataset.several",
                path,
                count=len(episodes),
                example=path_for_shell(f"{folder.name}:0", always=True),
            )
        )
    number = int(split_episodes(episodes[0])[1])
    info = _read_info(folder)
    # In v2 each episode has a file: else a thousand files are opened a thousand times.
    files = [str(f) for f in (folder / "data").glob(f"*/episode_{number:06d}.parquet")]
    data = ds.dataset(files or folder / "data", format="parquet")
    for file in data.files:
        check_parquet(Path(file))
    wanted = [name for name in FEATURES if name in data.schema.names]
    lacking = {"timestamp", "episode_index", "observation.state"} - {*data.schema.names}
    if lacking:
        raise LogError(Finding("dataset.columns", folder, columns=[*sorted(lacking)]))
    rows = data.to_table(columns=["timestamp", *wanted], filter=ds.field("episode_index") == number)
    if not rows.num_rows:
        raise LogError(f"{folder} has no row of episode {number}; its files are not complete.")
    columns = {"t": _times(rows["timestamp"], info)}
    for feature in wanted:
        values = np.array(rows[feature].to_pylist(), float).reshape(rows.num_rows, -1)
        columns |= zip(_columns(feature, values.shape[1], info), values.T, strict=True)
    return pd.DataFrame(columns)


def _read_info(folder: Path) -> Mapping[str, Any]:
    try:
        info = json.loads((folder / INFO).read_text(encoding="utf-8"))
        version = str(info.get("codebase_version", ""))
    except (OSError, ValueError, AttributeError, RecursionError) as error:
        raise LogError(f"{folder / INFO} cannot be read as JSON: {error}.") from None
    if not version.startswith(("v2.", "v3.")):
        raise LogError(Finding("dataset.version", folder, version=version))
    return dict(info)


def _times(given: Any, info: Mapping[str, Any]) -> Array:
    """Return times [s]; those of single precision that count samples, to the last digit."""
    t = np.array(given.to_pylist(), float).reshape(-1)
    fps = info.get("fps")
    if isinstance(fps, (int, float)) and 0 < fps <= 1.0 / RULES.steps[0]:
        even = np.round(t * fps) / fps
        differences = np.abs(t - even)
        times = np.abs(t).astype(np.float32)
        if np.all(differences <= np.spacing(times)):
            return even
    return t


def _columns(feature: str, count: int, info: Mapping[str, Any]) -> list[str]:
    """Return the column names of the values of a feature in a log."""
    features = info.get("features")
    stated = features.get(feature) if isinstance(features, dict) else None
    names = stated.get("names") if isinstance(stated, dict) else None
    if isinstance(names, dict):  # {"motors": [...]}
        names = next((x for x in names.values() if isinstance(x, list)), None)
    own = FEATURES[feature]
    if not isinstance(names, list) or len(names) != count or len({*names}) < count:
        return [f"{name}.{own}" for name in numbered(count)]
    found = []
    for name in map(str, names):
        joint, _, end = name.rpartition(".")
        kind = KINDS.get(end, own) if joint and own in ("q", "cmd") else own
        kind = _COMMANDS.get(kind, kind) if own == "cmd" else kind
        found.append(f"{joint if joint and end in KINDS else name}.{kind}")
    return found


@reader(
    "a LeRobot dataset",
    sniff=is_dataset,
    place=lambda path: split_episodes(path)[0],
    parts=list_episodes,
)
def read_dataset(path: Path, _: Conventions) -> Whole:
    """Return the episode that a path names; its hash is that of the values.

    Raises
    ------
    LogError
        If the path names several episodes, or the dataset lacks positions.
    """
    frame = read_episode(path)
    content = ",".join(frame.columns).encode() + frame.to_numpy(float).tobytes()
    return frame, PLAIN, sha256(content).hexdigest()
