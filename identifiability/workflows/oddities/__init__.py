"""What is odd: where robot file, limits and physics contradict a log, each in one sentence.

One file a family of oddity; each gives sentences that name the column and the remedy, and none for
good logs (`studies/foreign_logs.py` counts). What can be mended is mended when logs are read, and
said there: wrong samples (`logs.mend`), wrapped angles (`logs.wraps`), repeated rows.
"""

from __future__ import annotations

from identifiability.foundation.values import frozen
from identifiability.workflows.oddities.effort import find_weightless
from identifiability.workflows.oddities.evidence import Evidence
from identifiability.workflows.oddities.exchanged import find_exchanged
from identifiability.workflows.oddities.gravity import find_gravity
from identifiability.workflows.oddities.hung import find_hung
from identifiability.workflows.oddities.late import find_late
from identifiability.workflows.oddities.limits import find_beyond_limits
from identifiability.workflows.oddities.rates import find_wrong_rates
from identifiability.workflows.oddities.saturation import find_saturation
from identifiability.workflows.oddities.time_scale import find_time_scale
from identifiability.workflows.oddities.torque_scale import find_torque_scale
from identifiability.workflows.oddities.turned import find_turned_torque

__all__ = ["Evidence", "Oddities", "find_oddities"]


@frozen
class Oddities:
    """What is odd about logs.

    Attributes
    ----------
    hints : tuple of str
    decisive : bool
        Whether the first of them explains whatever else contradicts.
    misread : bool
        Whether it says that columns have the wrong sign, unit or joint: values found from them are
        those of another robot.
    """

    hints: tuple[str, ...] = ()
    decisive: bool = False
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
EXPLAIN = (*MISREAD, find_weightless, find_late)


def find_oddities(evidence: Evidence) -> Oddities:
    """Return what is odd about logs, a sentence each; one explanation is enough."""
    raw = (*find_beyond_limits(evidence), *find_hung(evidence), *find_saturation(evidence))
    found = ((find, find(evidence)) for find in EXPLAIN)
    which, first = next((pair for pair in found if pair[1]), (None, ()))
    return Oddities((*first, *raw), bool(first), which in MISREAD)
