"""What is odd: where robot file, limits and physics contradict a log, each in one sentence.

One file a family of oddity; each gives sentences that name the column and the remedy, and none for
good logs (`studies/foreign_logs.py` counts). What can be mended is mended when logs are read, and
said there: wrong samples (`logs.mend`), wrapped angles (`logs.wraps`), repeated rows.
"""

from __future__ import annotations

from identifiability.foundation.values import frozen
from identifiability.workflows.oddities.measured_logs import MeasuredLogs
from identifiability.workflows.oddities.positions import find_beyond_limits, find_hung
from identifiability.workflows.oddities.timing import find_late, find_time_scale, find_wrong_rates
from identifiability.workflows.oddities.torque import (
    find_exchanged,
    find_gravity,
    find_other_masses,
    find_saturation,
    find_torque_scale,
    find_turned_torque,
    find_weightless,
)

__all__ = ["MeasuredLogs", "Oddities", "find_oddities"]


@frozen
class Oddities:
    """What is odd about logs.

    Attributes
    ----------
    hints : tuple of str
    explains : bool
        Whether the first of them explains whatever else contradicts.
    misread : bool
        Whether it says that columns have the wrong sign, unit or joint: values found from them are
        those of another robot.
    """

    hints: tuple[str, ...] = ()
    explains: bool = False
    misread: bool = False


#: Columns that are read as what they are not, in the order in which one explains the others, and
#: what else contradicts physics.
MISREAD = (
    find_wrong_rates,
    find_exchanged,
    find_turned_torque,
    find_time_scale,
    find_gravity,
    find_torque_scale,
)
EXPLAIN = (*MISREAD, find_other_masses, find_weightless, find_late)


def find_oddities(logs: MeasuredLogs) -> Oddities:
    """Return what is odd about logs, a sentence each; one explanation is enough."""
    raw = (*find_beyond_limits(logs), *find_hung(logs), *find_saturation(logs))
    # Torque that servos made of commands has no column that could be another one.
    commanded = any(getattr(log, "servo_delay", None) is not None for log in logs.recordings)
    found = ((find, find(logs)) for find in (() if commanded else EXPLAIN))
    which, first = next((pair for pair in found if pair[1]), (None, ()))
    return Oddities((*first, *raw), bool(first), which in MISREAD)
