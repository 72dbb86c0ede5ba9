"""`Alternatives`: what may be missing beside a model, and what that does to its labels.

An effect that nobody named leaves its trace in the parameters that resemble it, and no interval of
the residual holds that. So every group that a model may lack counts by its probability: what is
named is taken off the labels, and of the others one more may be there all the same (`MixedModel`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.effects import find_families, title_of
from identifiability.effects.measurement import TorqueScale
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.groups import Excerpt, Missing
from identifiability.estimation.mixed_model import EVERYWHERE, MixedModel, Term, Terms
from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure

#: A direction of unit columns that is shorter than the root of this is none.
THIN: Tolerance = 1e-10
#: Groups that a sentence says; a table has them all.
TOLD = 2


def place_of(term: Term) -> str:
    """Return where a group is, in words."""
    return "all joints" if term.group.place == EVERYWHERE else term.group.place


def describe_term(term: Term) -> str:
    """Return what a group is and where, such as "Stribeck friction in joint_2"."""
    return f"{title_of(term.group.family)} in {place_of(term)}"


@frozen
class Share:
    """What a group does to the torque, where it is there.

    Attributes
    ----------
    term : Term
    weight : float
        Its probability; 1 of what is named.
    columns : (k,) int
        Among the u columns of all.
    value : (k,)
        Of its columns.
    covariance : (k, k)
        Of its error.
    """

    term: Term
    weight: float
    columns: np.ndarray
    value: Array
    covariance: Array


@frozen
class Alternatives:
    """Groups that may be missing beside a model, and what they say of its values.

    Attributes
    ----------
    named : tuple of Term
        That gain what names them.
    shares : tuple of Share
        Of these, and of all others.
    XX, XB : (n, k, k), (n, k, u)
        Products of model and groups at each joint, neither weighed nor whitened.
    """

    named: Terms
    shares: tuple[Share, ...]
    XX: Array
    XB: Array

    @property
    def functions(self) -> tuple[str, ...]:
        """What is named, in words."""
        return tuple(describe_term(t) for t in self.named)

    @property
    def statement(self) -> str:
        """What the model seems to miss, and how sure that is, for before ": diagnose"."""
        if not self.named:
            return ""
        order = sorted(self.named, key=lambda t: -t.odds)
        told = [f"{describe_term(t)} (log odds {t.odds:.3g})" for t in order[:TOLD]]
        more = len(order) - TOLD
        told += [f"{more} more"] if more > 0 else []
        one = len(order) == 1
        return f"{listing(told)} {'seems' if one else 'seem'} to be missing"

    def to_list(self) -> list[dict[str, Any]]:
        """Return what is named as a JSON result has it."""
        return [
            {
                "effect": t.group.family,
                "joint": place_of(t),
                "of": title_of(t.group.family),
                "log_odds": t.odds,
            }
            for t in self.named
        ]

    def of_labels(self, submodel: Submodel, fit: Estimate) -> LabelAlternatives | None:
        """Return what the groups do to the values of a model; None where there is none."""
        if not self.shares:
            return None
        kept = list(fit.kept)
        M, w = submodel.M[:, kept], fit.weights
        XX = M.T @ np.einsum("a,akl->kl", w, self.XX) @ M
        XB = M.T @ np.einsum("a,aku->ku", w, self.XB)
        size = np.sqrt(np.maximum(np.diag(XX), 1e-300))
        T = np.linalg.lstsq(XX / np.outer(size, size), XB / size[:, None], rcond=THIN)[0]
        T /= size[:, None]
        shift, variance = np.zeros(len(submodel)), np.zeros(len(submodel))
        each = np.zeros((len(self.shares), len(kept)))
        sure = np.zeros(len(self.shares), bool)
        for k, s in enumerate(self.shares):
            own = T[:, s.columns]
            moved, error = own @ s.value, np.einsum("ku,uv,kv->k", own, s.covariance, own)
            sure[k] = k < len(self.named)
            each[k] = s.weight * (moved**2 + error)
            if sure[k]:
                shift[kept] += moved
            variance[kept] += np.maximum(s.weight * (error + (0.0 if sure[k] else moved**2)), 0.0)
        names, named = [""] * len(submodel), np.zeros(len(submodel), bool)
        for row, column in enumerate(kept):
            most = int(np.argmax(each[:, row]))
            names[column], named[column] = describe_term(self.shares[most].term), sure[most]
        return LabelAlternatives(shift, np.sqrt(variance), tuple(names), named)


@frozen
class LabelAlternatives:
    """What groups that may be missing do to the k values of a model.

    Attributes
    ----------
    shift : (k,)
        Value less what the model with the named groups finds.
    sigma : (k,)
        Standard deviation of that, by what is named and by one group more.
    names : tuple of str
        The group that matters most to each,
    named : (k,) bool
        and whether it is named.
    """

    shift: Array
    sigma: Array
    names: tuple[str, ...]
    named: np.ndarray


NO_ALTERNATIVES = Alternatives((), (), np.empty((0, 0, 0)), np.empty((0, 0, 0)))


def find_alternatives(
    structure: Structure,
    regression: Regression,
    unseen: Regression | None = None,
    *,
    commanded: bool = False,
) -> Alternatives:
    """Return what may be missing beside all columns of a regression.

    Rows that were held out may only take a name away.

    Noise in the motion leaves its own functions: least squares is pulled towards zero by it, and
    they explain the rest. Where the motion has a second record, whose noise is another, a group is
    named only if both say that something is missing there.
    """
    record = regression.instruments
    plain = regression if record is None else replace(regression, instruments=None)
    # A wrong scale of one joint's torque is nearly the model itself, at any size: its prior alone
    # would widen every label. What weighs a known load tells it.
    every = find_families(None, commanded=commanded)
    families = [f for f in every if f.name != TorqueScale.name]
    missing = Missing.of(plain, families, structure.present)
    if not len(missing.seen.y) or not missing.groups:
        return NO_ALTERNATIVES
    model = missing.model()
    terms = model.search()
    if terms and record is not None:
        second = Missing.of(replace(plain, samples=record), families, structure.present)
        places = {t.group.place for t in second.model().search()}
        terms = model.settle(tuple(t for t in terms if t.group.place in places))
    if terms and unseen is not None:
        terms = model.confirm(terms, missing.products(Excerpt.of(unseen)))
    return _conclude(missing, model, terms)


def _conclude(missing: Missing, model: MixedModel, terms: Terms) -> Alternatives:
    groups = [(t, 1.0) for t in terms] + model.alternatives(terms)
    used = np.unique(np.concatenate([np.empty(0, int), *(t.columns for t, _ in groups)]))
    place, p, rows = {int(k): i for i, k in enumerate(used)}, missing.fixed, missing.seen
    shares = []
    for k, (t, weight) in enumerate(groups):
        beside = terms if k < len(terms) else (*terms, t)
        s = model.solve(beside)
        first = model.fixed + sum(x.size for x in beside[:k] if k < len(terms))
        at = np.arange(first, first + t.size) if k < len(terms) else np.arange(-t.size, 0)
        unit = model.scale[t.columns]
        value, covariance = s.value[at] / unit, s.root[:, at].T @ s.root[:, at]
        own = np.array([place[int(c)] for c in t.columns], int)
        shares.append(Share(t, weight, own, value, covariance / np.outer(unit, unit)))
    n = rows.y.shape[1]
    XX, XB = np.zeros((n, p, p)), np.zeros((n, p, len(used)))
    for j in range(n):
        X = rows.X[:, j]
        XX[j] = X.T @ X
        for (joint, column), x in missing.entries.items():
            if joint == j and column + p in place:
                XB[j][:, place[column + p]] = X.T @ x
    return Alternatives(terms, tuple(shares), XX, XB)
