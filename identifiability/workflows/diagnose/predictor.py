"""`Predictor`: does the plain model predict, or the one with what was named?

Names are those that are sure; both models are fitted to the rest of each fold of the fitted logs,
and judged on it by the one judge (`HeldOut`). What is held out chooses neither.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.estimation.evidence import Evidence, Folds, HeldOut, Level, Score
from identifiability.estimation.mixed_model import MixedModel, Terms
from identifiability.estimation.noise import autocorrelation_time
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.workflows.diagnose.naming import Naming

#: Blocks of rows that folds are made of.
BLOCKS = 60


@frozen
class Predictor:
    """What predicts.

    Attributes
    ----------
    named : bool
        Whether it is the model with what was named.
    gain : float [nat]
        Of its log predictive density on folds of the fitted logs over the plain model's; nan where
        there was no choice.
    values : (b,)
        Base parameters of the plain model.
    """

    named: bool
    gain: float
    values: Array

    @property
    def statement(self) -> str:
        """What predicts, and by what it was chosen; empty where there was no choice."""
        if np.isnan(self.gain):
            return ""
        which = "with what was named" if self.named else "without it, which is surely better there"
        gain = f"{self.gain:.3g}".replace("-", "−")
        return (
            f"Predictions use the model {which}: folds of the fitted logs choose (what was named "
            f"gains {gain} nats), and what is held out only refutes."
        )


def choose_predictor(naming: Naming, values: Array) -> Predictor:
    """Return what predicts folds of the fitted logs: what was named, unless it is surely worse.

    Parameters
    ----------
    naming : Naming
    values : (b,)
        Base parameters of the plain model.
    """
    rows, parts = naming.fitted, range(len(naming.parts))
    standing = Predictor(bool(parts), float("nan"), values)
    if not parts or naming.setting.fixed:
        return standing
    left = naming.left(parts, naming.fit(parts))
    memory = float(autocorrelation_time(left).mean())
    noise = np.sum(left**2, axis=0) * memory / rows.counts
    noise = np.maximum(noise, 1e-18 * np.sum(rows.seen.y**2, axis=0) + 1e-300)
    starts = np.flatnonzero(np.diff(rows.log, prepend=-1))
    cuts = np.linspace(0, len(rows), min(BLOCKS, len(rows)) + 1).astype(int)
    edges = np.union1d(starts, cuts)
    information = replace(naming.plain(edges.tolist()), log=rows.log[edges[:-1]])
    try:
        folds = Folds.of(information, memory)
    except LogError:  # too short for folds
        return standing
    held = HeldOut(information, folds, noise, information.summed(folds.tested))
    plain, named = (_score(naming, terms, held) for terms in ((), naming.free(parts)))
    gain = float((named.density - plain.density).sum())
    return Predictor(Evidence.of(plain, named).level is not Level.BETTER, gain, values)


def _score(naming: Naming, terms: Terms, held: HeldOut) -> Score:
    """Return what a model with some terms predicts of folds, fitted to the rest of each."""
    model, p = naming.model, naming.missing.fixed
    rest = held.information.summed(held.folds.train).weigh((1.0 / held.noise)[:, None])
    values, roots = [], []
    for f in range(held.folds.count):
        own: Information = rest.take(np.array([f]))
        s = MixedModel(own, p, (), model.scale, naming.prior).solve(terms)
        unit, value = model.scale[s.columns], np.zeros(len(model.scale))
        root = np.zeros((len(value), len(s.columns)))
        value[s.columns], root[s.columns] = s.value / unit, s.root.T / unit[:, None]
        values.append(value)
        roots.append(root)
    return held.score(np.array(values), np.array(roots))
