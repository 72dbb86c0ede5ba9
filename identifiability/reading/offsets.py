"""`LogOffsets`: torque offsets that differ between logs, as a group of the mixed model.

An offset is a constant, and every smooth function of the motion contains one. So offsets and
functions compete by their evidence. Rows without functions have hardly any offset.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.effects import FAMILIES, find_families
from identifiability.effects.measurement import TorqueOffset
from identifiability.estimation.groups import Missing
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.values import frozen
from identifiability.quality import MeasuredLogs
from identifiability.regression.columns import Candidate

from .fit import constant_torque


class LogOffset(TorqueOffset):
    """A constant torque of one log."""

    name = "log_offset"


#: Offsets say nothing about the memory of the noise within logs, as functions of a session.
OFFSET = replace(FAMILIES[TorqueOffset.name], effect=LogOffset(), flexible=True, against="session")


@frozen
class LogOffsets:
    """Torque offsets of each log, relative to the mean of all logs.

    Attributes
    ----------
    odds : float
        Log odds, given all effects that are found with them; minus infinity if none is found.
    values : (L, n) [N·m or N]
    """

    odds: float
    values: Array

    @staticmethod
    def find(logs: MeasuredLogs) -> LogOffsets:
        """Return the offsets that the mixed model finds, with all effects that may be missing."""
        effects = Missing.of(logs.regression, find_families(None), logs.structure.present)
        first = len(effects.scale)
        missing = with_offsets(effects, logs.joints)
        model = missing.model()
        terms = model.search()
        others = tuple(term for term in terms if term.group.family != OFFSET.name)
        groups = [group for group in model.groups if group.family == OFFSET.name]
        every_joint = max(groups, key=lambda group: len(group.members[0]))
        offsets = model.gains(others, [every_joint])
        solution = model.solve((*others, *offsets))
        values = np.zeros(len(model.scale))
        values[solution.columns] = solution.value
        by_joint = (values / model.scale)[missing.fixed + first :].reshape(len(logs.joints), -1)
        odds = sum(term.odds for term in offsets) if len(others) < len(terms) else -np.inf
        return LogOffsets(odds, by_joint.T)


def with_offsets(missing: Missing, joints: Strings) -> Missing:
    """Return candidates of a model with a torque offset of each joint in each log, at the end."""
    constant = constant_torque(missing.seen)
    constant = constant - constant.mean(2, keepdims=True)
    kinds = tuple(f"off_{log}" for log in range(constant.shape[2]))
    candidates = [*missing.candidates]
    entries = dict(missing.entries)
    column = len(missing.scale)
    for j, joint in enumerate(joints):
        columns = tuple(range(column, column + len(kinds)))
        candidates.append(Candidate(OFFSET, joint, np.nan, kinds, OFFSET.effect, columns))
        rows = missing.seen.data[:, [j]] * constant[j]
        entries |= {(j, k): x for k, x in zip(columns, rows.T, strict=True)}
        column += len(kinds)
    both = replace(missing, candidates=tuple(candidates))
    vars(both)["entries"] = entries
    return both
