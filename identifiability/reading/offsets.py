"""`LogOffsets`: torque offsets that differ between logs, as a group of the mixed model.

An offset is a constant, and every smooth function of the motion contains one. So offsets and
functions compete by their evidence. Rows without functions have hardly any offset. A load that one
log carries competes with them, too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.effects import FAMILIES, find_families
from identifiability.effects.measurement import TorqueOffset
from identifiability.estimation.groups import Missing
from identifiability.estimation.mixed_model import MixedModel, Term, Terms
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import INERTIAL_KINDS, Array, Strings
from identifiability.foundation.rounding import REACH, measured
from identifiability.foundation.values import frozen
from identifiability.quality import MeasuredLogs
from identifiability.regression.columns import Candidate
from identifiability.robot.robot import tool_bodies

from .fit import constant_torque


class LogOffset(TorqueOffset):
    """A constant torque of one log."""

    name = "log_offset"


#: Offsets say nothing about the memory of the noise within logs, as functions of a session.
OFFSET = replace(FAMILIES[TorqueOffset.name], effect=LogOffset(), flexible=True, against="session")
#: A load has the columns of a body.
LOAD = replace(FAMILIES["payload"], effect=FAMILIES["rigid_body"].effect)


@frozen
class LogOffsets:
    """Torque offsets of each log, relative to the mean of all logs.

    Attributes
    ----------
    odds : float
        Log odds, given all effects that are found with them; minus infinity if none is found.
    values : (L, n) [N·m or N]
    load : Finding or None
        A load of one log that explains as much as the offsets.
    """

    odds: float
    values: Array
    load: Finding | None = None

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
        if len(others) == len(terms):
            return LogOffsets(-np.inf, by_joint.T)
        odds = sum(term.odds for term in offsets)
        return LogOffsets(odds, by_joint.T, find_load(logs, missing, others, odds))


def find_load(logs: MeasuredLogs, missing: Missing, others: Terms, odds: float) -> Finding | None:
    """Return a load that one log carries, if it explains as much as offsets with log odds."""
    model = with_loads(missing, logs).model()
    groups = [group for group in model.groups if group.family == LOAD.name]
    best = max(model.gains(others, groups), key=lambda term: term.odds, default=None)
    if best is None or best.odds < odds:
        return None
    return _state_load(logs, model, others, best)


def _state_load(logs: MeasuredLogs, model: MixedModel, others: Terms, load: Term) -> Finding:
    """Return the log that carries a load, and the mass, given other missing effects."""
    solution = model.solve((*others, load))
    first = np.flatnonzero(solution.columns == load.columns[0])[0]
    unit = model.scale[load.columns[0]]
    mass = solution.value[first] / unit
    sd = np.sqrt(solution.covariance[first, first]) / unit
    log = load.member
    if mass < 0 and len(logs.samples) == 2:
        log, mass = 1 - log, -mass  # of two logs the other one carries it
    load_text = phrase("log_load", "another")
    if abs(mass) > REACH * sd:
        part = "more" if mass > 0 else "less"
        load_text = phrase("log_load", part, mass=measured(abs(mass), sd, "kg"))
    return Finding("log_load", logs.samples[log].name, load=load_text, body=load.group.place)


def with_loads(missing: Missing, logs: MeasuredLogs) -> Missing:
    """Return candidates of a model with a load on a tool body in one log each, at the end."""
    seen = missing.seen
    candidates = [*missing.candidates]
    entries = dict(missing.entries)
    width = len(INERTIAL_KINDS)
    for body in tool_bodies(logs.robot):
        rigid = Candidate(LOAD, body, np.nan, INERTIAL_KINDS, LOAD.effect, tuple(range(width)))
        torque = seen.entries([rigid])
        for log in range(len(logs.samples)):
            first = candidates[-1].columns[-1] + 1
            candidates.append(replace(rigid, columns=tuple(range(first, first + width))))
            entries |= {(j, first + k): x * (seen.log == log) for (j, k), x in torque.items()}
    both = replace(missing, candidates=tuple(candidates), given=missing.noise)
    vars(both)["entries"] = entries
    return both


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
