"""The model with the named effects, to predict with: as the data have it, and as a real robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.effects.vocabulary import file_kinds, values_in_file
from identifiability.estimation.estimate import estimate, find_estimator
from identifiability.estimation.prediction import measure_spread, predict
from identifiability.estimation.uncertainty import assess_uncertainty
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.logs.prepare import Samples
from identifiability.physical.cad_prior import WEAK, real_robot_dict, share_weight
from identifiability.physical.feasibility import find_nearest
from identifiability.physical.fitted_model import FittedModel, LeastSquares, physical_set
from identifiability.physical.project import Projection
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import full_model
from identifiability.regression.structure import Structure
from identifiability.workflows.analyze.fit import hold_folds, settle_robot
from identifiability.workflows.diagnose.findings import Findings
from identifiability.workflows.diagnose.forward import Physical
from identifiability.workflows.predict import Fit, settled
from identifiability.workflows.session import weigh_rows


def keep_completed(d: Findings) -> Fit:
    """Return the model with the named effects, with the values that its error is stated of.

    With values kept (``fixed``) what is not known is that of the named effects, and the errors of
    these values where they have any.
    """
    structure = d.completed
    submodel = full_model(structure.base, "the diagnosed model")
    regression = structure.regression(d.samples, keep=True)
    regression = replace(regression, echo=None, instruments=None)
    information = gather_information(regression)
    fit = estimate(information)
    values: Array = structure.G @ _standard_values(d)
    found = predict(regression, values[:, None])
    low, raw = found.joint_rms()[:, 0], found.joint_rms(raw=True)[:, 0]
    unseen = d.gap.joint_rms()[:, -1]
    unseen_raw = np.sqrt(np.maximum(raw**2 - low**2, 0.0) + unseen**2)
    uncertainty = assess_uncertainty(
        information, fit, found.residual[:, :, 0], found.series, np.random.default_rng(d.seed), 0
    )
    spread = measure_spread(information, fit, uncertainty, (low, raw), (unseen, unseen_raw))
    if d.fixed:
        spread = replace(spread, covariance=_covariance(d), unknown=np.empty((len(values), 0)))
    return Fit(
        structure=structure,
        submodel=submodel,
        values=values,
        spread=spread,
        preparation=settled(d.preparation, d.samples),
        base_covariance=spread.covariance,
        base_unknown=spread.unknown,
    )


def _standard_values(d: Findings) -> Array:
    """Return values of the completed model's columns, the smallest of those that fit, (p,)."""
    phi = np.where(_first(d), d.completed.nominal, 0.0)
    phi[_first(d)] += _standard(d) @ (d.values - d.structure.nominal_base)
    last = {name: k for k, name in enumerate(d.completed.columns)}
    for p in (p for e in d.effects for p in e.placements):
        phi[[last[name] for name in p.parameters]] += p.fitted
    return phi


def _covariance(d: Findings) -> Array:
    """Return the covariance of named effects and of values that are kept, (b, b)."""
    G, last = d.completed.G, {name: k for k, name in enumerate(d.completed.columns)}
    at = {last[name]: se for e in d.effects for p in e.placements for name, _, se, _ in p.rows}
    named = G[:, list(at)] * np.array(list(at.values()))
    kept = G[:, _first(d)] @ _standard(d)[:, d.known.free] @ np.linalg.pinv(d.known.root)
    covariance: Array = named @ named.T + kept @ kept.T
    return covariance


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
        weight = share_weight(d.known.share) if d.known.share else None
        return fit_physical(structure, d.samples, d.validation, weight)
    values = dict.fromkeys(structure.columns, 0.0) | _kept(d)
    named = d.effects if structure is d.completed else ()
    for p in (p for e in named for p in e.placements):
        for name, value in zip(p.parameters, p.fitted.tolist(), strict=True):
            values[name] += value
    return Physical(structure, values)


def _kept(d: Findings) -> dict[str, float]:
    """Return the values that a diagnosis keeps, those of a result at the nearest real robot."""
    own, known, values = d.structure, d.known, d.values
    if not len(known.free):
        return {name: d.robot.nominal.get(name, 0.0) for name in own.columns}
    phi = own.nominal + np.linalg.pinv(own.G) @ (values - own.nominal_base)
    if "rigid_body" in own.model.names:
        exact = np.setdiff1d(np.arange(len(values)), known.free)
        tight = 1e9 / (np.abs(values[exact]) + ROUNDOFF)
        rows = np.concatenate([known.root @ own.G[known.free], tight[:, None] * own.G[exact]])
        try:
            data = LeastSquares(rows, rows @ phi, 0.0, 1.0)
            phi = Projection(physical_set(own), reference=own.nominal).solve(data).phi
        except ValueError as error:
            raise IdentifiabilityError(
                f"No real robot has {known.words} or any near them: {error}"
            ) from None
    return dict(zip(own.columns, phi.tolist(), strict=True))


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
