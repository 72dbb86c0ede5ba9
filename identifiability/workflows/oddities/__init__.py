"""What is odd: where robot file, limits and physics contradict a log, each in one sentence.

One file a family of checks, which are found by themselves (`check.check`); each gives sentences
that name the column and the remedy, and none for good logs (`studies/foreign_logs.py` counts). What
can be mended is mended when logs are read, and said there (`mends`).
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from identifiability.foundation.values import frozen
from identifiability.logs.commands import of_commands
from identifiability.workflows.oddities.check import CHECKS, Does, MeasuredLogs
from identifiability.workflows.oddities.mends import Reading, mend

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")

__all__ = ["MeasuredLogs", "Oddities", "Reading", "find_always", "find_oddities", "mend"]


@frozen
class Oddities:
    """What is odd about logs.

    Attributes
    ----------
    hints : tuple of str
    explains : bool
        Whether the first of them explains whatever else contradicts.
    misread : bool
        Whether it says that columns have the wrong sign, unit or joint, or are aliased: values
        found from them are those of another robot.
    """

    hints: tuple[str, ...] = ()
    explains: bool = False
    misread: bool = False


def find_oddities(logs: MeasuredLogs, *, explained: bool = False) -> Oddities:
    """Return what is odd about logs, a sentence each; one explanation is enough, if none is known.

    What says that columns are misread is asked for all the same.
    """
    beside = [
        text for c in CHECKS if c.does is Does.HINTS and not c.always for text in c.find(logs)
    ]
    # Torque that servos made of commands has no column that could be another one.
    commanded = any(map(of_commands, logs.recordings))
    kinds = (Does.MISREADS,) if explained else (Does.MISREADS, Does.EXPLAINS)
    asked = [] if commanded else [c for c in CHECKS if c.does in kinds]
    found = ((c, c.find(logs)) for c in asked)
    which, first = next((pair for pair in found if pair[1]), (None, ()))
    misread = which is not None and which.does is Does.MISREADS
    return Oddities((*first, *beside), bool(first), misread)


def find_always(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return what is odd about the robot file, and about all logs together, also of silent ones."""
    return tuple(text for c in CHECKS if c.always for text in c.find(logs))
