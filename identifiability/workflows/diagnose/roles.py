"""`Roles`: which motion is fitted, which chooses the names, which verifies them.

An error that was minimised, be it by a fit or by the choice of a name, is no evidence. The motion
on which the gap is quoted therefore does neither. Whole logs are kept apart where there are
enough; else a log is divided into stretches of time, with a pause between that nobody looks at.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.logfile import LogFile

Recording = Log | LogFile

#: Stretches that a held-out log is divided into, in turn to choose and to verify.
TURNS = 4
#: Share of a log that verifies where there is no other.
LAST = 0.25
#: Share of a stretch that is left out at each of its inner ends.
PAUSE = 0.05
#: Samples that a stretch must have.
LEAST = 100


@frozen
class Roles:
    """Logs by what they are for.

    Attributes
    ----------
    fit : tuple of Log
        What the model is fitted to and the evidence is from.
    choose : tuple of Log
        What judges during the search; none where fitted motion is left out in turn.
    verify : tuple of Log
        What the gap is measured on, and nothing else.
    chosen_by, verified_on : str
        Both in words, to follow "chosen" and "on".
    """

    fit: tuple[Recording, ...]
    choose: tuple[Recording, ...]
    verify: tuple[Recording, ...]
    chosen_by: str
    verified_on: str


def assign_roles(logs: Sequence[Recording], validate: Sequence[Recording]) -> Roles:
    """Return the roles of fitted and held-out logs.

    Several fitted logs choose by leaving one out in turn, and every held-out log verifies. A
    single fitted log needs help to choose: of several held-out logs the first one chooses, a
    single one is divided. Without held-out logs the last log is set aside, or the last part of
    the only one.

    Parameters
    ----------
    logs : sequence of Log
    validate : sequence of Log

    Raises
    ------
    LogError
        If the only log is too short to be divided.
    """
    logs, validate = list(logs), list(validate)
    aside = ""
    if not validate and len(logs) > 1:
        *logs, last = logs
        validate, aside = [last], ", which was set aside"
    if not validate:
        return _one_log(logs[0])
    if len(logs) > 1:
        return Roles(
            tuple(logs), (), tuple(validate), "by leaving out one fitted log at a time",
            f"{_list(validate)}{aside}",
        )  # fmt: skip
    if len(validate) > 1:
        first, *rest = validate
        return Roles(tuple(logs), (first,), tuple(rest), f"on {first.name}", _list(rest))
    (held,) = validate
    if len(held) < TURNS * LEAST:
        return Roles(
            tuple(logs), (), (held,), "by leaving out one stretch of the fitted log at a time",
            f"{held.name}{aside}",
        )  # fmt: skip
    parts = divide(held, np.linspace(0, 1, TURNS + 1))
    mine = " and ".join(str(k) for k in range(1, TURNS + 1, 2))
    rest_of = " and ".join(str(k) for k in range(2, TURNS + 1, 2))
    return Roles(
        tuple(logs), tuple(parts[::2]), tuple(parts[1::2]),
        f"on quarters {mine} of {held.name}", f"quarters {rest_of} of {held.name}{aside}",
    )  # fmt: skip


def _one_log(log: Recording) -> Roles:
    if len(log) < LEAST / LAST:
        raise LogError(
            f"{log.name} has {len(log)} samples, too few to name effects from one part and verify "
            f"them on another; give a log of at least {LEAST / LAST:.0f} samples, or a second one."
        )
    fit, verify = divide(log, [0, 1 - LAST, 1])
    return Roles(
        (fit,), (), (verify,), "by leaving out one stretch of the fitted motion at a time",
        f"the last {100 * LAST:.0f} % of {log.name}, set aside",
    )  # fmt: skip


def divide(log: Recording, edges: Sequence[float] | np.ndarray) -> list[Recording]:
    """Return stretches of a log between edges (k + 1,) in shares of its samples.

    A pause of `PAUSE` of a stretch is left out on both sides of every inner edge.
    """
    n, out = len(log), []
    cuts = np.asarray(edges, float) * n
    for k, (low, high) in enumerate(pairwise(cuts.tolist())):
        pause = PAUSE * (high - low)
        first = int(np.ceil(low + (pause if low > 0 else 0)))
        last = int(high - (pause if high < n else 0))
        out.append(log.cut(first, last, f"{log.name}, part {k + 1}"))
    return out


def _list(logs: Sequence[Recording]) -> str:
    names = [log.name for log in logs]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
