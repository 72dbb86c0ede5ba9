"""Logs without their wrong samples: none that stands alone decides what is identified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.logs.checks import COMMANDS
from identifiability.logs.log import Log
from identifiability.logs.logfile import LogFile
from identifiability.logs.spikes import Spike, find_spikes, mend_column

#: Wrong values that a hint lists.
LISTED = 3

#: What a hint says of wrong samples.
REPLACED = "replaced by what they say"


def mend_logs(logs: Sequence[Log | LogFile]) -> tuple[list[Log | LogFile], tuple[str, ...]]:
    """Return logs with their wrong samples replaced, and a hint for each log that has any.

    A log without wrong samples is returned as it is.
    """
    mended, hints = [], []
    for log in logs:
        wrong = _find(log)
        if not wrong:
            mended.append(log)
            continue
        mended.append(replace(log, mended=wrong) if isinstance(log, LogFile) else _mend(log, wrong))
        hints.append(_state(log, wrong))
    return mended, tuple(hints)


def _find(log: Log | LogFile) -> dict[str, tuple[Spike, ...]]:
    """Return the wrong samples of each column that has any."""
    commands = COMMANDS if isinstance(log, Log) and log.commanded else ()  # which jump as they like
    channels = [c for c in log.channels if c not in commands]
    columns = [(f"{j}.{c}", c, k) for c in channels for k, j in enumerate(log.joints)]
    if isinstance(log, LogFile):
        # Where an angle jumps by a turn, and back, is no wrong sample.
        found = {n: () if n in log.unwrapped else log.spikes.get(n, ()) for n, *_ in columns}
    else:
        found = {name: tuple(find_spikes(getattr(log, c)[:, k])) for name, c, k in columns}
    return {name: spikes for name, spikes in found.items() if spikes}


def _mend(log: Log, wrong: dict[str, tuple[Spike, ...]]) -> Log:
    channels: dict[str, Any] = {}
    for kind in log.channels:
        columns = zip(log.joints, getattr(log, kind).T, strict=True)
        channels[kind] = np.stack(
            [mend_column(x, wrong.get(f"{joint}.{kind}", ())) for joint, x in columns], 1
        )
    return replace(log, **channels)


def _state(log: Log | LogFile, wrong: dict[str, tuple[Spike, ...]]) -> str:
    """Return one sentence that names the wrong samples of a log."""
    found = sorted((s.row, name, s) for name, spikes in wrong.items() for s in spikes)
    shown = [
        f"data row {row + 1} (t = {float(log.rows(row, row + 1).t[0]):.6g} s): {name} = "
        f"{s.value:.4g}, where the rows beside it say {s.instead:.3g}"
        for row, name, s in found[:LISTED]
    ]
    more = f"; and {len(found) - LISTED} more" if len(found) > LISTED else ""
    one = len(found) == 1
    return (
        f"{log.name}: {'one value lies' if one else f'{len(found)} values lie'} far from those "
        f"before and after, as no motion or torque does, and {'was' if one else 'were'} {REPLACED} "
        f"({'; '.join(shown)}{more}): check the log."
    )
