"""The real robot nearest to the data with the named effects, as `export` reads it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from identifiability.effects.holding import held_by_file
from identifiability.estimation.prediction import predict
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.physical.mass import real_robot_dict
from identifiability.regression.regression import Regression
from identifiability.workflows.diagnose.forward import fit_physical

if TYPE_CHECKING:
    from identifiability.workflows.diagnose.findings import Findings


def nearest_dict(d: Findings) -> dict[str, Any]:
    """Return the real robot of a diagnosis with its errors on the fitted logs.

    With the file's values kept (``fixed``) it is these and what the named effects add.
    """
    names = [p.name for p in d.model.parameters(d.robot)]
    try:
        values = _kept_values(d) if d.fixed else dict(fit_physical(d.completed, d.samples).values)
    except IdentifiabilityError as error:
        return {**real_robot_dict(d.robot, {}, (np.nan, np.nan), {}), "reason": str(error)}
    # A named effect may have the columns of one in the model: these stand for both.
    first = np.array([names.index(n) == k for k, n in enumerate(names)])
    phi = np.array([[v[n] for n in names] for v in (values, held_by_file(d.robot, values))]).T
    regression = Regression(d.robot, d.model, tuple(d.samples))
    errors = predict(regression, phi * first[:, None]).relative_error()
    shapes = d.model.shapes(d.robot)
    return real_robot_dict(d.robot, _fold(values), (float(errors[0]), float(errors[1])), shapes)


def _kept_values(d: Findings) -> dict[str, float]:
    stated = {p.name for e in d.base_effects for p in e.parameters(d.robot)}
    values = {p.name: 0.0 for p in d.model.parameters(d.robot)}
    values |= {name: d.robot.nominal.get(name, 0.0) for name in stated}
    for placement in (p for e in d.effects for p in e.placements):
        for name, value in zip(placement.parameters, placement.values, strict=True):
            values[name] += float(value)
    return values


def _fold(values: dict[str, float]) -> dict[str, float]:
    """Return values in which no joint has a Coulomb level for both directions and one for each."""
    out = dict(values)
    for name in [n for n in values if n.endswith(".Fc") and f"{n}+" in values]:
        level = out.pop(name)
        for way in (f"{name}+", f"{name}-"):
            out[way] = out.get(way, 0.0) + level
    return out
