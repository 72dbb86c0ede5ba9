"""Logs whose angles go on where they were written within one turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.logs.log import Log
from identifiability.logs.logfile import LogFile
from identifiability.logs.wraps import WrapFinder, Wraps


def unwrap_logs(logs: Sequence[Log | LogFile]) -> tuple[list[Log | LogFile], tuple[str, ...]]:
    """Return logs with the jumps of wrapped angles undone, and a hint for each that has any."""
    out: list[Log | LogFile] = []
    hints = []
    for log in logs:
        found = _find(log)
        if not found:
            out.append(log)
            continue
        out.append(_undo(log, found))
        columns = listing([f"'{j}.q' {_times(len(w.rows))}" for j, w in found.items()], 4)
        hints.append(
            f"{log.name}: angles jump by a whole turn ({columns}); they were written within one "
            "turn and are read as going on (unwrapped)."
        )
    return out, tuple(hints)


def _find(log: Log | LogFile) -> dict[str, Wraps]:
    """Return the jumps of every joint that has any."""
    if isinstance(log, LogFile):
        return {j: log.wraps[f"{j}.q"] for j in log.joints if f"{j}.q" in log.wraps}
    found = {}
    for joint, column in zip(log.joints, log.q.T, strict=True):
        finder = WrapFinder()
        finder.add(column)
        wraps = finder.finish()
        if wraps is not None:
            found[joint] = wraps
    return found


def _undo(log: Log | LogFile, found: dict[str, Wraps]) -> Log | LogFile:
    if isinstance(log, LogFile):
        return replace(log, unwrapped={f"{j}.q": w for j, w in found.items()})
    columns = [
        found[j].undo(x) if j in found else x for j, x in zip(log.joints, log.q.T, strict=True)
    ]
    return replace(log, q=np.stack(columns, 1))


def _times(count: int) -> str:
    return "once" if count == 1 else "twice" if count == 2 else f"{count} times"
