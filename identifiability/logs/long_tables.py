"""Convert long tables, with a row for each joint and time, to tables with a row for each time.

A long table has a column with the joint, and one column for each channel: time, joint, position,
velocity, effort. Its rows are sorted by time or by joint. The first kind is converted piece by
piece, so its length is not limited. The second kind is held in memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, pairwise
from typing import TYPE_CHECKING

import numpy as np

from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.values import Fields, frozen

from .checks import to_floats
from .columns import as_dates, is_stamp, rename
from .conventions import Conventions
from .form import Form
from .formats.reader import Whole
from .names import (
    LONGEST_NAME,
    SILENT,
    SPELLED,
    Column,
    bracketed,
    guess_column,
    split_unit,
    words_for,
    words_of,
)

if TYPE_CHECKING:
    import pandas as pd

#: Words of a column that names the joint of each row.
LABELS = frozenset(("joint", "joints", "axis", "axes", "motor", "actuator", "id", "ids"))
LABELS |= frozenset(words_for("name"))

#: Joints of a long table, and rows of one that is sorted by joint, at most; times turned at once.
MOST_LABELS, MOST_ROWS, PART = 200, 10_000_000, 50_000


@frozen
class Layout:
    """Columns of a long table.

    Attributes
    ----------
    label : str
        Column that names the joint of a row.
    time : str
        Column whose equal values are one time.
    times : tuple of str
        All columns of time.
    channels : mapping of str to str
        Columns with a value of the joint, and the name of each channel.
    """

    label: str
    time: str
    times: Strings
    channels: Mapping[str, str]

    @property
    def note(self) -> str:
        """Half a sentence on how the table was read."""
        called = [f"'{c}' as {name}" for c, name in self.channels.items()]
        by = f"by '{self.time}' and '{self.label}'"
        return f"its rows of one joint each were put side by side {by}: {listing(called, 6)}"

    def name_column(self, joint: str, channel: str) -> str:
        """Return the column that a channel of a joint has in a table with one row a time."""
        name = self.channels[channel]
        unit = f" [{bracketed(channel)}]" if bracketed(channel) else ""
        if joint.isdecimal():
            return f"{name}[{joint}]{unit}"
        return f"{joint}.{name}{unit}"


def unstack(pieces: Iterable[Whole], known: Conventions, source: str) -> Iterator[Whole]:
    """Yield the pieces of a table; those of a long table with one row a time.

    Parameters
    ----------
    pieces : iterable of (DataFrame, Form, str)
        As `identifiability.logs.tables.read_pieces` yields them.
    known : Conventions
    source : str
        Name of the table in sentences.

    Raises
    ------
    LogError
        If a joint has two rows of one time, or a table that is sorted by joint is too long.
    """
    given = iter(pieces)
    first = next(given, None)
    if first is None:
        return
    layout = find_layout(first[0], known)
    every = chain([first], given)
    if layout is None:
        yield from every
        return
    last: list[Whole] = []

    def frames() -> Iterator[pd.DataFrame]:
        for piece in every:
            last[:] = [piece]
            yield piece[0]

    joints: list[str] = []
    for block in _blocks(frames(), layout, source):
        joints = joints or find_joints(block[layout.label])
        _, form, digest = last[0]
        yield _turn(block, layout, joints, source), _form_of(form, layout, joints), digest


def find_layout(frame: pd.DataFrame, known: Conventions) -> Layout | None:
    """Return the columns of a long table by its first rows; None for any other table."""
    names = {str(c): rename(str(c).strip(), known) for c in frame.columns}
    guesses = {c: g for c, n in names.items() if (g := guess_column(c, n, ())) is not None}
    times = tuple(c for c, g in guesses.items() if g.kind == "t")
    channels = {c: g for c, g in guesses.items() if g.kind in SPELLED and g.number < 0}
    labels = [c for c, name in names.items() if c not in guesses and _is_label(name)]
    if not (times and channels and labels):
        return None
    label = _choose_label(frame, labels)
    if not _name_joints(frame[label], known):
        return None
    stated = [c for c in times if names[c] == "t"]
    time = [*stated, *filter(is_stamp, times), *times][0]
    return Layout(label, time, times, _name_channels(channels, names))


def _choose_label(frame: pd.DataFrame, labels: Sequence[str]) -> str:
    """Return the column that names joints; text is preferred to numbers."""
    texts = [c for c in labels if frame[c].dtype.kind not in "biuf"]
    return [*texts, *labels][0]


def _name_joints(labels: pd.Series, known: Conventions) -> bool:
    """Return whether labels are the names of joints: few, and each in several rows."""
    joints = find_joints(labels)
    longest = max(map(len, joints), default=0)
    few = 0 < len(joints) <= min(MOST_LABELS, len(labels) // 2)
    # A table of one joint belongs to that joint, for any label.
    single = len(known.joints) == len(joints) == 1
    other = single and rename(joints[0], known) != known.joints[0]
    return few and longest <= LONGEST_NAME and not other


def _is_label(name: str) -> bool:
    """Return whether a column names the joint of each row."""
    words = {w for w in words_of(name) if w not in SILENT or w in LABELS}
    return bool(words) and words <= LABELS


def _name_channels(channels: Mapping[str, Column], names: Mapping[str, str]) -> dict[str, str]:
    """Return the names of channels: the documented name, if only one column fits it."""
    out: dict[str, str] = {}
    for kind in dict.fromkeys(g.kind for g in channels.values()):
        columns = [c for c, g in channels.items() if g.kind == kind]
        mapped = [c for c in columns if names[c] != c.strip()]
        columns = mapped if len(mapped) == 1 else columns
        alone = len(columns) == 1
        out |= {c: kind if alone else split_unit(c.strip())[0] for c in columns}
    return out


def find_joints(labels: pd.Series) -> list[str]:
    """Return the names of joints in a column, in the order of their first rows."""
    return list(dict.fromkeys(_as_texts(labels)))


def _as_texts(labels: pd.Series) -> list[str]:
    """Return labels as texts; whole numbers have no decimals, and empty cells are omitted."""
    given = labels.dropna()
    if given.dtype.kind == "f" and (given == given.round()).all():
        given = given.astype(np.int64)
    return [str(label).strip() for label in given]


def _blocks(frames: Iterable[pd.DataFrame], layout: Layout, source: str) -> Iterator[pd.DataFrame]:
    """Yield rows in the order of time, all rows of a time in one block.

    Raises
    ------
    LogError
        If a table that is sorted by joint is too long.
    """
    import pandas as pd  # noqa: PLC0415 - heavy, and workers that read Parquet do without it

    waiting = []
    by_time = False
    for frame in frames:
        waiting.append(frame[frame[layout.label].notna()])
        by_time = by_time or not _is_sorted_by_joint(waiting[-1][layout.label])
        if by_time:
            block = pd.concat(waiting, ignore_index=True)
            starts = np.flatnonzero(_is_new(_time_keys(block[layout.time])))
            complete = starts[-1] if len(starts) else 0  # rows of the last time may go on
            waiting = [block[complete:]]
            if complete:
                yield block[:complete]
        elif sum(map(len, waiting)) > MOST_ROWS:
            raise LogError(Finding("long.sorted", source, label=layout.label, rows=MOST_ROWS))
    block = pd.concat(waiting, ignore_index=True)
    keys = _time_keys(block[layout.time])
    order = np.argsort(keys, kind="stable") if not by_time else np.arange(len(keys))
    starts = np.flatnonzero(_is_new(keys[order]))
    for start, stop in pairwise([*starts[::PART].tolist(), len(keys)]):
        yield block.iloc[order[start:stop]]


def _is_sorted_by_joint(labels: pd.Series) -> bool:
    """Return whether the rows of each joint are contiguous."""
    texts = np.array(_as_texts(labels), dtype=object)
    changes = int((texts[1:] != texts[:-1]).sum())
    return changes < len(set(texts.tolist()))


def _time_keys(times: pd.Series) -> Array:
    """Return sortable numbers for times (N,); other values become NaN."""
    dates = as_dates(times, 0)
    if dates is None:
        return to_floats(times)
    return dates.to_numpy()


def _is_new(keys: Array) -> Array:
    """Return at which rows another time begins, (N,) bool."""
    changed = keys[1:] != keys[:-1]
    return np.concatenate([[True], changed])[: len(keys)]


def _turn(block: pd.DataFrame, layout: Layout, joints: Sequence[str], source: str) -> pd.DataFrame:
    """Return rows of a long table as a table with one row a time.

    Raises
    ------
    LogError
        If a joint is new, or has two rows of one time.
    """
    import pandas as pd  # noqa: PLC0415 - heavy, and workers that read Parquet do without it

    new = _is_new(_time_keys(block[layout.time]))
    texts = _as_texts(block[layout.label])
    unknown = [text for text in dict.fromkeys(texts) if text not in joints]
    if unknown:
        raise LogError(Finding("long.late", source, joint=unknown[0], label=layout.label))
    cells = pd.MultiIndex.from_arrays([np.cumsum(new) - 1, texts])
    again = np.flatnonzero(cells.duplicated())
    if len(again):
        time = str(block[layout.time].iloc[again[0]])
        raise LogError(Finding("long.twice", source, joint=texts[again[0]], time=time))
    columns: Fields = {c: block[c].to_numpy()[new] for c in layout.times}
    for channel in layout.channels:
        given = block[channel].set_axis(cells)
        given = given.astype(float) if given.dtype.kind in "biuf" else given
        wide = given.unstack().reindex(columns=[*joints])
        columns |= {layout.name_column(j, channel): wide[j].to_numpy() for j in joints}
    return pd.DataFrame(columns)


def _form_of(form: Form, layout: Layout, joints: Sequence[str]) -> Form:
    """Return the form of a table with one row a time, with the units of its columns."""
    stated = dict(zip(form.columns, form.units, strict=False))
    times = [stated.get(c, "") for c in layout.times]
    channels = [stated.get(c, "") for c in layout.channels for _ in joints]
    units = (*times, *channels) if form.units else ()
    return replace(form, units=units, notes=(*form.notes, layout.note))
