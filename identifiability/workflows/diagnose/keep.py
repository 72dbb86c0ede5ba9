"""What a diagnosis keeps of the model with the named effects, to predict with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.estimation.estimate import estimate
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.prediction import Spread, measure_spread, predict
from identifiability.estimation.uncertainty import assess_uncertainty
from identifiability.foundation.names import Array
from identifiability.regression.gather import gather_information
from identifiability.regression.information import Information
from identifiability.regression.reduction import full_rung
from identifiability.workflows.diagnose.findings import Findings
from identifiability.workflows.predict.fit import Fit, settled


def keep_completed(d: Findings) -> Fit:
    """Return the model with the named effects, fitted as it is completed.

    With values kept (``fixed``) what is not known is that of the named effects, and the errors of
    these values where they were given.
    """
    structure = d.completed
    rung = full_rung(structure.base, "the diagnosed model")
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
        rung=rung,
        values=values,
        spread=spread,
        preparation=settled(d.preparation, d.samples),
        base_covariance=spread.covariance,
        base_unknown=spread.unknown,
    )


def _smooth_values(d: Findings, information: Information, free: Estimate) -> Array:
    """Return the base parameters of the data, functions with the prior of the diagnosis, (b,)."""
    prior = {
        name: sd
        for e in d.effects
        for p in e.placements
        for name, sd in zip(p.parameters, p.prior.tolist(), strict=False)
    }
    if not prior:
        return free.value
    last = {name: k for k, name in enumerate(d.completed.columns)}
    # In the parameters of the diagnosis: its base parameters, and those of what it named.
    added = [last[name] for e in d.effects for p in e.placements for name in p.parameters]
    standard = _standard(d)
    first = standard.shape[1]
    phi = np.zeros((len(d.completed.columns), first + len(added)))
    phi[_first(d), :first] = standard
    phi[added, range(first, phi.shape[1])] = 1.0
    base: Array = d.completed.G @ phi
    unit = float(np.sqrt(np.mean(free.variance * free.times * free.weights))) or 1.0
    F = free.estimator.loss(information, free) / unit
    at = {name: first + added.index(last[name]) for name in prior}
    ridge = np.zeros((len(prior), base.shape[1] + 1))
    for row, (name, sd) in enumerate(prior.items()):
        ridge[row, at[name]] = 1.0 / sd if sd > 0 else 0.0
    A = np.concatenate([np.column_stack([F[:, :-1] @ base, F[:, -1]]), ridge])
    length = np.linalg.norm(A[:, :-1], axis=0)
    length = np.where(length > 0, length, 1.0)
    values: Array = base @ (np.linalg.lstsq(A[:, :-1] / length, A[:, -1], rcond=1e-9)[0] / length)
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


def _of_named(d: Findings, spread: Spread) -> Spread:
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
