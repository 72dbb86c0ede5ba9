"""The model with the named effects, to predict with: as the data have it, and as a real robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.effects.vocabulary import file_kinds, values_in_file
from identifiability.estimation.estimate import estimate, find_estimator
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.prediction import TorqueUncertainty, measure_spread, predict
from identifiability.estimation.uncertainty import assess_uncertainty
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import Array
from identifiability.logs.prepare import Samples
from identifiability.physical.cad_prior import WEAK, real_robot_dict, share_weight
from identifiability.physical.feasibility import find_nearest
from identifiability.physical.fitted_model import FittedModel, LeastSquares, physical_set
from identifiability.physical.project import Projection
from identifiability.regression.gather import gather_information
from identifiability.regression.information import Information
from identifiability.regression.reduction import full_model
from identifiability.regression.structure import Structure
from identifiability.workflows.analyze.fit import hold_folds, settle_robot
from identifiability.workflows.diagnose.findings import Findings
from identifiability.workflows.diagnose.forward import Physical
from identifiability.workflows.predict import Fit, settled
from identifiability.workflows.session import weigh_rows


def keep_completed(d: Findings) -> Fit:
    """Return the model with the named effects, fitted as it is completed.

    With values kept (``fixed``) what is not known is that of the named effects, and the errors of
    these values where they were given.
    """
    structure = d.completed
    submodel = full_model(structure.base, "the diagnosed model")
    regression = structure.regression(d.samples, keep=True)
    regression = replace(regression, echo=None, instruments=None)
    information = gather_information(regression)
    fit = estimate(information)
    values = _kept_values(d) if d.fixed else _smooth_values(d, information, fit)
    found = predict(regression, values[:, None])
    low, raw = found.joint_rms()[:, 0], found.joint_rms(raw=True)[:, 0]
    unseen = d.gap.joint_rms()[:, -1]
    unseen_raw = np.sqrt(np.maximum(raw**2 - low**2, 0.0) + unseen**2)
    uncertainty = assess_uncertainty(
        information, fit, found.residual[:, :, 0], found.series, np.random.default_rng(d.seed), 0
    )
    spread = measure_spread(information, fit, uncertainty, (low, raw), (unseen, unseen_raw))
    if d.fixed:
        spread = _of_named(d, spread)
    return Fit(
        structure=structure,
        submodel=submodel,
        values=values,
        spread=spread,
        preparation=settled(d.preparation, d.samples),
        base_covariance=spread.covariance,
        base_unknown=spread.unknown,
    )


def _smooth_values(d: Findings, information: Information, free: Estimate) -> Array:
    """Return the base parameters of the data, functions as smooth as the diagnosis has them, (b,).

    The others are refitted beside these.
    """
    columns = d.completed.columns
    last = {name: k for k, name in enumerate(columns)}
    placed = [p for e in d.effects for p in e.placements if len(p.smooth)]
    if not placed:
        return free.value
    phi, G = np.zeros(len(columns)), d.completed.G
    at = [last[name] for p in placed for name in p.parameters]
    phi[at] = np.concatenate([p.smooth for p in placed])
    held, rest = G @ phi, np.delete(G, at, axis=1)
    F = free.estimator.loss(information, free)
    A = F[:, :-1] @ rest
    length = np.linalg.norm(A, axis=0)
    length = np.where(length > 0, length, 1.0)
    found = np.linalg.lstsq(A / length, F[:, -1] - F[:, :-1] @ held, rcond=1e-9)[0]
    values: Array = held + rest @ (found / length)
    return values


def _named(d: Findings) -> list[tuple[int, float, float]]:
    """Return the column, value and standard error of each named parameter."""
    last = {name: k for k, name in enumerate(d.completed.columns)}
    rows = [row for e in d.effects for p in e.placements for row in p.rows]
    return [(last[name], value, error) for name, value, error, _ in rows]


def _kept_values(d: Findings) -> Array:
    """Return the base parameters of the values that were kept and the named effects, (b,)."""
    phi = np.where(_first(d), d.completed.nominal, 0.0)
    if d.known is not None:
        off = d.known.values - d.structure.nominal_base
        phi[_first(d)] += _standard(d) @ off
    for k, value, _ in _named(d):
        phi[k] += value
    base: Array = d.completed.G @ phi
    return base


def _of_named(d: Findings, spread: TorqueUncertainty) -> TorqueUncertainty:
    variance = np.zeros(len(d.completed.columns))
    for k, _, error in _named(d):
        variance[k] += error**2
    G = d.completed.G
    covariance = G * variance @ G.T
    if d.known is not None:
        kept = G[:, _first(d)] @ _standard(d)
        covariance = covariance + kept @ d.known.covariance @ kept.T
    return replace(spread, covariance=covariance, unknown=np.empty((len(G), 0)))


def _first(d: Findings) -> np.ndarray:
    """Return which columns of the completed model are those of the diagnosed one, (p,) bool."""
    known, columns = {p.name for p in d.structure.parameters}, d.completed.columns
    return np.array([n in known and columns.index(n) == k for k, n in enumerate(columns)])


def _standard(d: Findings) -> Array:
    """Return standard parameters for each of the diagnosed model's base parameters, (p, b)."""
    names = [n for n, first in zip(d.completed.columns, _first(d), strict=True) if first]
    order = [d.structure.columns.index(n) for n in names]
    standard: Array = np.linalg.pinv(d.structure.G)[order]
    return standard


def fit_physical(
    structure: Structure,
    samples: Sequence[Samples],
    unseen: Sequence[Samples] = (),
    cad_weight: float | None = None,
) -> Physical:
    """Return the real robot that explains some logs best under a model.

    How strongly it is drawn to the robot file is chosen by what it predicts of stretches of the
    logs, as of an analysis, where others are there to judge it; without any it is so weakly.
    It is not chosen where it is given.

    Raises
    ------
    IdentifiabilityError
        If the solver finds none.
    """
    information = gather_information(structure.regression(samples, keep=True))
    joints, wls = structure.robot.joints, find_estimator("wls")
    information = weigh_rows(joints, samples, information, wls)[0]
    submodel, fit = full_model(structure.base), estimate(information)
    model = FittedModel(structure, submodel, information, information, fit)
    if unseen and cad_weight is None:
        held_out, short = hold_folds(information, wls)
        found = settle_robot(model, held_out, None, choose=not short).robot
    else:
        found = find_nearest(model, WEAK if cad_weight is None else cad_weight)
    if found.nearest is None:
        raise IdentifiabilityError(found.sentence.strip())
    return Physical(structure, found.parameters(), found.cad_weight)


def real_robot(d: Findings, structure: Structure) -> Physical:
    """Return the real robot of a diagnosis under the model without or with the named effects.

    With values kept (``fixed``) it is these, as a real robot can have them, and what the named
    effects add.

    Raises
    ------
    IdentifiabilityError
        If the solver finds none.
    """
    if not d.fixed:
        weight = None if d.near is None else share_weight(d.near.share)
        return fit_physical(structure, d.samples, d.validation, weight)
    values = dict.fromkeys(structure.columns, 0.0) | _kept(d)
    named = d.effects if structure is d.completed else ()
    for placement in (p for e in named for p in e.placements):
        for name, value, *_ in placement.rows:
            values[name] += value
    return Physical(structure, values)


def _kept(d: Findings) -> dict[str, float]:
    """Return the values that a diagnosis keeps, those of a result at the nearest real robot."""
    columns, own = d.structure.columns, d.structure
    if d.known is None or np.array_equal(d.known.values, own.nominal_base):
        return {name: d.robot.nominal.get(name, 0.0) for name in columns}
    if "rigid_body" not in own.model.names:
        standard = own.nominal + np.linalg.pinv(own.G) @ (d.known.values - own.nominal_base)
        return dict(zip(columns, standard.tolist(), strict=True))
    sd = np.sqrt(np.maximum(np.diag(d.known.covariance), 0.0))
    weight = 1.0 / np.maximum(sd, 1e-9 * (np.abs(d.known.values) + sd.max(initial=0.0)) + 1e-12)
    data = LeastSquares(weight[:, None] * own.G, weight * d.known.values, 0.0, 1.0)
    try:
        found = Projection(physical_set(own), reference=own.nominal).solve(data).phi
    except ValueError as error:
        raise IdentifiabilityError(
            f"No real robot has {d.known.words} or any near them: {error}"
        ) from None
    return dict(zip(columns, found.tolist(), strict=True))


def nearest_dict(d: Findings) -> dict[str, Any]:
    """Return the real robot with the named effects, with its errors on the fitted logs."""
    structure, known = d.completed, None if d.forward is None else d.forward.nearest
    try:
        real = real_robot(d, structure) if known is None else known
    except IdentifiabilityError as error:
        nothing = real_robot_dict(structure, {}, (np.nan,) * 3, np.empty((0, 3)))
        return {**nothing, "reason": str(error)}
    values = dict(real.values)
    # A named effect may have the columns of one in the model: these stand for both.
    names = structure.columns
    first = np.array([names.index(n) == k for k, n in enumerate(names)])
    files = [values_in_file(structure.robot, values, kind) for kind in file_kinds(structure.robot)]
    phi = np.array([[v[n] for n in names] for v in (values, *files)]).T
    regression = replace(structure.regression(d.samples, keep=True), instruments=None, echo=None)
    found = predict(regression, structure.G @ (phi * first[:, None]))
    errors, each = found.relative_error(), found.joint_error()
    held_out = (float(errors[0]), float(errors[1]), float(errors[2]))
    return real_robot_dict(structure, _fold(values), held_out, each, d.samples, real.cad_weight)


def _fold(values: dict[str, float]) -> dict[str, float]:
    """Return values in which no joint has a Coulomb level for both directions and one for each."""
    out = dict(values)
    for name in [n for n in values if n.endswith(".Fc") and f"{n}+" in values]:
        level = out.pop(name)
        for way in (f"{name}+", f"{name}-"):
            out[way] = out.get(way, 0.0) + level
    return out
