"""Logs of two sides as one question: which changes lie between them.

`Sides` holds the logs. `find_differences` and `find_changes` return the possible changes under a
model. `find_loads` returns the loads that only held-out logs have, and `report_loads` states them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from identifiability.effects import find_families
from identifiability.effects.base import GravityTilt, apply_tilt
from identifiability.effects.measurement import TorqueScale, without_scales
from identifiability.effects.nominal import reference_values
from identifiability.effects.registry import is_loaded
from identifiability.effects.springs import FreeSpring
from identifiability.estimation.differences import (
    EXCERPT,
    LACKS,
    Compared,
    Differences,
    Known,
    pooled_values,
)
from identifiability.estimation.groups import Excerpt
from identifiability.estimation.mixed_model import Terms
from identifiability.estimation.prediction import Prediction
from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding
from identifiability.foundation.linalg import ROUNDOFF, or_one, solve_least
from identifiability.foundation.names import Array, NumberByName, Strings, name_each
from identifiability.foundation.rounding import REACH, measured
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Dataset
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.regression.columns import Candidate, list_candidates
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.robot.robot import tool_bodies

from .case import Data
from .changes import Change, list_changes, list_log_changes, rows_of
from .provenance import given_paths


@frozen
class Sides:
    """Logs of two sides, prepared under one model; those of the first side come first.

    Attributes
    ----------
    count : int
        How many logs the first side has.
    regression : Regression
        Of all logs.
    """

    count: int
    regression: Regression

    @property
    def samples(self) -> tuple[Dataset, ...]:
        """The prepared logs."""
        return self.regression.samples

    @property
    def names(self) -> list[str]:
        """Names of the logs."""
        return [s.name for s in self.samples]

    @property
    def paths(self) -> tuple[Strings, Strings]:
        """Paths of the logs of each side."""
        paths = given_paths(self.samples)
        return paths[: self.count], paths[self.count :]

    def look(self, values: int) -> Excerpt:
        """Return the rows of the logs, if there are enough for so many values.

        Raises
        ------
        LogError
        """
        seen = Excerpt.of(self.regression, EXCERPT)
        rows = np.bincount(seen.log, minlength=len(self.samples))
        fewest = int(rows.min())
        if fewest < LOG_RULES.fewest or fewest * len(seen.robot.joints) <= values:
            raise LogError(Finding("sides.few", samples=fewest, values=values))
        return seen

    def fit_unchanged(self, submodel: Submodel) -> tuple[Excerpt, Array]:
        """Return the rows of all logs, and the base parameters (b,) of the second side.

        Raises
        ------
        LogError
        """
        seen = self.look(len(submodel))
        second = seen.log >= self.count
        X, y = seen.X[second], seen.y[second]
        return seen, pooled_values(X, y, submodel.M, submodel.fixed)


def list_days(samples: Sequence[Dataset], began: float | None) -> Strings:
    """Return the day on which each log began (UTC), as 2026-03-31; empty without their session."""
    if began is None:
        return ("",) * len(samples)
    starts = (began + (s.motion.start or 0.0) for s in samples)
    return tuple(str(np.datetime64(int(x), "s"))[:10] for x in starts)


def find_differences(
    structure: Structure,
    seen: Excerpt,
    bodies: Sequence[str],
    known: Known,
    patterns: Sequence[Array],
    *,
    warms: bool = False,
    springs: bool = False,
    weights: Sequence[Candidate] = (),
    load: Array | None = None,
) -> Differences:
    """Return the possible differences between logs.

    Parameters
    ----------
    structure : Structure
    seen : Excerpt
        Rows of all logs.
    bodies : sequence of str
        That may carry a load.
    known : Known
    patterns : sequence of (L,)
        Which logs may have a change.
    warms, springs : bool
        Whether friction may also change within every log, and springs may change.
    weights : sequence of Candidate
        Weights of loads without their inertia.
    load : (N, n), optional [N·m or N]
        Torque of loads that the logs carry: gains act on it, too.
    """
    stated = name_each(structure.base.names, known.base)
    # A load hangs from the base as it stands, and the model may have found that this is tilted.
    robot, _ = apply_tilt(structure.robot, stated)
    motions = [piece.motion for piece in seen.pieces]
    has = structure.present - _list_left_out(structure, known)
    lacks, _ = list_candidates(robot, find_families(LACKS), has, motions, fixed=False)
    # Torque of a wrong scale, which the model has found, is read as it should have been.
    right = without_scales(robot, stated)
    read = replace(seen, robot=robot, y=seen.y @ right, raw=seen.raw @ right)
    base = [0.0 if name.endswith(".scale") else x for name, x in stated.items()]
    known = replace(known, base=np.array(base))
    return Differences.of(
        Compared.about(read, known, load),
        list_changes(robot, bodies, *[FreeSpring.name] * springs),
        lacks,
        known,
        patterns,
        names=structure.base.names,
        warms=warms,
        weights=weights,
    )


def _list_left_out(structure: Structure, known: Known) -> set[tuple[str, str]]:
    """Return the effects that a reduced model leaves out: another motion may show them."""
    rows = zip(structure.base.names, known.directions, strict=True)
    held = {name for name, row in rows if not row.any()}
    return {(p.group, p.owner) for p in structure.parameters if p.name in held}


def list_patterns(logs: int, later: int, single: int) -> list[Array]:
    """Return all later logs, then some single logs, as amounts of a change (L,) in each log.

    Parameters
    ----------
    logs, later, single : int
        How many there are, how many of the first may have changed together, and how many alone.
    """
    asked = (np.arange(logs) < later).astype(float)
    singles = np.eye(logs)[:single]
    return [asked, *(x for x in singles if np.ptp(np.abs(x - asked)))]


def list_sessions(logs: int, later: int) -> list[Array]:
    """Return these patterns, and changes that stay since one of the later logs."""
    order = np.arange(logs)
    starts = range(1, later - 1)
    since = [((first <= order) & (order < later)).astype(float) for first in starts]
    return [*list_patterns(logs, later, logs), *since]


def find_changes(
    sides: Sides, structure: Structure, submodel: Submodel
) -> tuple[Differences, Terms]:
    """Return possible changes between the sides or in single logs, under a model, and those found.

    A wrong gain scales the torque of a load as well, and the load is known after a first search
    only. Without it a wrong gain of one joint would change the load, and name a gain of another.
    """
    seen, values = sides.fit_unchanged(submodel)
    known = Known.nothing(submodel.M, values)
    bodies = tool_bodies(structure.robot)
    patterns = list_sessions(len(sides.samples), sides.count)
    about = bodies, known, patterns
    found, terms = _search_changes(structure, seen, *about)
    load = _torque_of_loads(found, terms)
    if load.any():
        carrying = carry_loads(sides, seen, _list_loads(found, terms))
        return _search_changes(structure, carrying, *about, load)
    return found, terms


def _search_changes(
    structure: Structure,
    seen: Excerpt,
    bodies: Sequence[str],
    known: Known,
    patterns: Sequence[Array],
    load: Array | None = None,
) -> tuple[Differences, Terms]:
    """Return possible changes, and those found; no springs where all logs lack torque of positions.

    Under another motion such torque looks like a spring that changed.
    """
    given = structure, seen, bodies, known, patterns
    found = find_differences(*given, warms=True, springs=True, load=load)
    terms = found.model.search()
    kinds = [found.whose(t) for t in terms]
    lacks = {c.family.name for c in kinds if not c.pattern}
    if "function_of_position" in lacks and any(c.kind == "spring" for c in kinds):
        found = find_differences(*given, warms=True, load=load)
        terms = found.model.search()
    return found, terms


def carry_loads(sides: Sides, seen: Excerpt, loads: Sequence[NumberByName]) -> Excerpt:
    """Return rows whose load-dependent columns have the loads that logs carry.

    Friction that grows with the load of a joint would pass for a wrong gain of its torque.

    Parameters
    ----------
    sides : Sides
    seen : Excerpt
        Its rows.
    loads : sequence of mapping
        Parameters that are added to those of bodies, by name, of each log; the rest carry none.
    """
    # The weight of a load already follows gravity as the base leans.
    follow = [is_loaded([p]) and p.group != GravityTilt.name for p in sides.regression.parameters]
    X = seen.X
    for k, load in enumerate(loads):
        if load and load not in loads[:k] and any(follow):
            carry = np.isin(seen.log, [j for j, x in enumerate(loads) if x == load])
            X = np.where(carry[:, None, None] & follow, _columns_under(sides, load), X)
    return replace(seen, X=X)


def _columns_under(sides: Sides, load: NumberByName) -> Array:
    """Return the columns (N, n, b) of all rows for a robot that carries a load."""
    robot = sides.regression.robot
    values = reference_values(robot)
    carried = {name: values.get(name, 0.0) + x for name, x in load.items()}
    loaded = replace(robot, reference={**values, **carried})
    regression = replace(sides.regression, robot=loaded)
    return replace(sides, regression=regression).look(0).X


def _list_loads(found: Differences, terms: Terms) -> list[dict[str, float]]:
    """Return the parameters of the loads among terms by name, of each log.

    They are those of no other change: beside the wrong torque of effects that depend on loads,
    other changes are wrong as well.
    """
    sizes = _sizes_of_loads(found, tuple(t for t in terms if found.whose(t).kind == "load"))
    logs = range(len(found.columns[0][0].logs))
    loads = [dict[str, float]() for _ in logs]
    for k in np.flatnonzero(sizes):
        change, name, _ = found.columns[k]
        for log in np.flatnonzero(change.logs):
            size = float(sizes[k]) * change.logs[log]
            loads[log][name] = loads[log].get(name, 0.0) + size
    return loads


def _sizes_of_loads(found: Differences, terms: Terms) -> Array:
    """Return the parameters of the loads among terms, (C,)."""
    value = found.solve(terms)[0]
    sizes = np.zeros(len(found.columns))
    for k, term in enumerate(terms):
        if found.whose(term).kind == "load":
            sizes[found.at(term)] = value[rows_of(found.model, terms, k)]
    return sizes


def _torque_of_loads(found: Differences, terms: Terms) -> Array:
    """Return the torque of the loads among terms, (N, n) [N·m or N]."""
    sizes = _sizes_of_loads(found, terms)
    torque = np.zeros_like(found.missing.seen.y)
    for (joint, column), x in found.missing.entries.items():
        torque[:, joint] += sizes[column] * x
    return torque


def report_loads(
    data: Data, submodel: Submodel, error: float, unseen: Prediction
) -> Iterator[Finding]:
    """Yield findings on loads that only the held-out logs of the user carry.

    A held-out log must err much more than the fitted logs: most of its squared error is new. Only
    then are logs compared.

    Parameters
    ----------
    data : Data
    submodel : Submodel
        The model that logs are compared under.
    error : float
        Relative error of the model to use on the fitted logs.
    unseen : Prediction
        Along the held-out logs, last by the model to use.
    """
    recordings = data.recordings
    names = [sample.name for sample in data.validation]
    if not names or data.misread or recordings.set_aside or recordings.commanded:
        return
    errors = np.array([unseen.relative_error(log)[-1] for log in range(len(names))])
    if not np.nanmax(errors**2) > 2 * error**2:
        return
    for change in find_loads(data, submodel):
        k = change.names.index(f"{change.place}.m")
        mass = float(change.sizes[k])
        sd = float(change.sd[k])
        if abs(mass) <= REACH * sd:
            continue
        yield Finding(
            "held_out_load",
            logs=[change.log] if change.log else names,
            load=measured(abs(mass), sd, "kg"),
            more="more" if mass > 0 else "less",
            mass=mass,
            sd=sd,
            body=change.place,
        )


def find_loads(data: Data, submodel: Submodel) -> list[Change]:
    """Return the loads that only held-out logs surely have, without a competing hypothesis.

    They must explain most of the squared error on the held-out logs.

    Parameters
    ----------
    data : Data
        With held-out logs.
    submodel : Submodel
        The model that logs are compared under.
    """
    assert data.unseen is not None
    sides = Sides(len(data.validation), data.unseen.followed_by(data.regression))
    try:
        if not _may_explain_most(sides, data.structure, submodel):
            return []
        found, terms = find_changes(sides, data.structure, submodel)
    except LogError:  # too few samples to compare
        return []
    changes = list_log_changes(found, terms, sides.names)
    fitted = sides.names[sides.count :]
    loads = [c for c in changes if c.kind == "load" and c.log not in fitted]
    sure = [c for c in loads if c.sure and not c.alternatives]
    return sure if sure and _explains_most(found, terms, sides.count) else []


def _may_explain_most(sides: Sides, structure: Structure, submodel: Submodel) -> bool:
    """Return whether any loads of the first logs can explain most of their squared error.

    Least squares in each log explain no less than a search does, and take far less time. Loads act
    in other columns if the model has a tilt, and on other torque if it has scales.
    """
    if {GravityTilt.name, TorqueScale.name} & {family for family, _ in structure.present}:
        return True
    seen, known = sides.fit_unchanged(submodel)
    owners = [p.owner for p in structure.parameters]
    of_loads = structure.G[:, np.isin(owners, tool_bodies(structure.robot))]
    residual = seen.residual(known)
    error = remaining = 0.0
    for log in range(sides.count):
        of_log = seen.log == log
        rows = seen.data & of_log[:, None]
        columns = seen.X[rows] @ of_loads
        unit = columns / or_one(np.linalg.norm(columns, axis=0))
        target = residual[rows]
        unexplained = target - unit @ solve_least(unit, target, ROUNDOFF)
        error += float(target @ target)
        remaining += float(unexplained @ unexplained)
    return 2 * remaining < error


def _explains_most(found: Differences, terms: Terms, count: int) -> bool:
    """Return whether loads explain most of the squared error on the first logs.

    The errors are those of the values that fit the other logs.

    Parameters
    ----------
    found : Differences
    terms : tuple of Term
    count : int
        How many logs the first side has.
    """
    seen = found.missing.seen
    torque = _torque_of_loads(found, terms)
    rows = seen.data & (seen.log < count)[:, None]
    error = np.sum(seen.y[rows] ** 2)
    remaining = np.sum((seen.y - torque)[rows] ** 2)
    return bool(2 * remaining < error)
