"""The real robot nearest to what a diagnosis found, under its model with the named effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.effects.vocabulary import file_kinds, held_by_file
from identifiability.estimation.estimate import estimate, find_estimator
from identifiability.estimation.prediction import predict
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.logs.prepare import Samples
from identifiability.physical.cad_prior import real_robot_dict
from identifiability.physical.feasibility import find_nearest
from identifiability.physical.fitted_model import FittedModel, LeastSquares, physical_set
from identifiability.physical.project import Projection
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import full_rung
from identifiability.regression.structure import Structure
from identifiability.workflows.analyze.fit import hold_folds, settle_robot, weigh_rows
from identifiability.workflows.diagnose.findings import Findings
from identifiability.workflows.diagnose.forward import Physical


def fit_physical(
    structure: Structure, samples: Sequence[Samples], unseen: Sequence[Samples] = ()
) -> Physical:
    """Return the real robot that explains some logs best under a model.

    How strongly it is drawn to the robot file is chosen by what it predicts of stretches of the
    logs, as of an analysis, where others are there to judge it; without any it is so weakly.

    Raises
    ------
    IdentifiabilityError
        If the solver finds none.
    """
    information = gather_information(structure.regression(samples, keep=True))
    joints, wls = structure.robot.joints, find_estimator("wls")
    information = weigh_rows(joints, samples, information, wls)[0]
    rung, fit = full_rung(structure.base), estimate(information)
    model = FittedModel(structure, rung, information, information, fit)
    found = find_nearest(model)
    if unseen:
        held, short = hold_folds(information, wls)
        found, *_ = settle_robot(model, held, None, choose=not short)
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
        return fit_physical(structure, d.samples, d.validation)
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
        nothing = real_robot_dict(structure, {}, (np.nan,) * 3)
        return {**nothing, "reason": str(error)}
    values = dict(real.values)
    # A named effect may have the columns of one in the model: these stand for both.
    names = structure.columns
    first = np.array([names.index(n) == k for k, n in enumerate(names)])
    files = [held_by_file(structure.robot, values, kind) for kind in file_kinds(structure.robot)]
    phi = np.array([[v[n] for n in names] for v in (values, *files)]).T
    regression = replace(structure.regression(d.samples, keep=True), instruments=None, echo=None)
    errors = predict(regression, structure.G @ (phi * first[:, None])).relative_error()
    held = (float(errors[0]), float(errors[1]), float(errors[2]))
    return real_robot_dict(structure, _fold(values), held, d.samples, real.cad_weight)


def _fold(values: dict[str, float]) -> dict[str, float]:
    """Return values in which no joint has a Coulomb level for both directions and one for each."""
    out = dict(values)
    for name in [n for n in values if n.endswith(".Fc") and f"{n}+" in values]:
        level = out.pop(name)
        for way in (f"{name}+", f"{name}-"):
            out[way] = out.get(way, 0.0) + level
    return out
