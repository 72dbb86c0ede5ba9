"""What a diagnosis keeps of the model with the named effects, to predict with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.estimation.estimate import estimate
from identifiability.estimation.prediction import predict
from identifiability.estimation.spread import Spread, measure_spread
from identifiability.estimation.uncertainty import assess_uncertainty
from identifiability.foundation.names import Array
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import full_rung
from identifiability.workflows.diagnose.findings import Findings
from identifiability.workflows.predict.fit import Fit, settled


def keep_completed(d: Findings) -> Fit:
    """Return the model with the named effects, fitted as it is completed.

    With the file's values kept (``fixed``) these are exact, and what is not known is that of the
    named effects.
    """
    structure = d.completed
    rung = full_rung(structure.base, "the diagnosed model")
    regression = replace(structure.regression(d.samples), echo=None, instruments=None)
    information = gather_information(regression)
    fit = estimate(information)
    values = _kept_values(d) if d.fixed else fit.value
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
        rung=rung,
        values=values,
        spread=spread,
        preparation=settled(d.preparation, d.samples),
    )


def _named(d: Findings) -> list[tuple[int, float, float]]:
    """Return the column, value and standard error of each named parameter."""
    last = {name: k for k, name in enumerate(d.completed.columns)}
    rows = [row for e in d.effects for p in e.placements for row in p.rows]
    return [(last[name], value, error) for name, value, error, _ in rows]


def _kept_values(d: Findings) -> Array:
    """Return the base parameters of the file's values and the named effects, (b,)."""
    known = {p.name for p in d.structure.parameters}
    columns = d.completed.columns
    first = [name in known and columns.index(name) == k for k, name in enumerate(columns)]
    phi = np.where(first, d.completed.nominal, 0.0)
    for k, value, _ in _named(d):
        phi[k] += value
    base: Array = d.completed.G @ phi
    return base


def _of_named(d: Findings, spread: Spread) -> Spread:
    variance = np.zeros(len(d.completed.columns))
    for k, _, error in _named(d):
        variance[k] += error**2
    G = d.completed.G
    return replace(spread, covariance=G * variance @ G.T, unknown=np.empty((len(G), 0)))
