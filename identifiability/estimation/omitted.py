"""What a reduced model's numbers stand for, and how far that is from their labels.

A parameter that is left out although it is not zero does not vanish: the survivors take it over.
With base parameters β, a rung ``β = held + M x`` and its fit ``x = P (β - held)`` of torque without
noise, P is the pseudo-inverse of M in the distance that the fit minimises, or of its instruments. A
label means ``M⁺ (β - held)`` instead; the difference ``D (β - held)``, ``D = P - M⁺``, is no noise,
so no interval of the residual holds it. How large it can be is what the robot file knows of bodies,
their masses and where these lie to ± `SHARE`, and what the logs say of the parameters that are left
out: the residual of the rung holds what they do and no kept parameter can take over. Both together
are a normal posterior. Friction, rotors and offsets are taken to be as the file says.

A file can be further from the robot than that, and the logs can leave out what no file states. The
unpruned model knows: where its own interval for a label does not reach that of the rung, σ grows
until it does, and the verdict says so.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.foundation.names import INERTIAL, Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung
from identifiability.regression.structure import Structure

#: How far a body's mass, first and second moments are taken to lie from the robot file's, relative
#: to m, m·r and m·r² with r the rms distance of its mass from its frame.
SHARE = 0.3

#: Coefficients below this share of a row's largest are rounding.
ROUNDING = 1e-9

#: Members of what a number stands for that a sentence names, and the least share of σ of one.
NAMED, LEAST = 3, 0.1

_M = INERTIAL.index("m")
_DIAGONAL = tuple(INERTIAL.index(k) for k in ("Ixx", "Iyy", "Izz"))


@frozen(kw_only=True)
class LeftOut:
    """What the parameters that a rung leaves out do to the k that it keeps.

    Attributes
    ----------
    sigma : (k,) [unit of each parameter]
        Root mean square of value less label over the robots that file and logs make likely, without
        noise. Zero where nothing is left out or known.
    projected : (k,)
        Values that the fit would find on the robot of the file.
    stands_for : tuple of str
        Each value as the combination that it is, such as ``slider1.Jr + 0.02·platform.m``; empty
        where it is its label.
    unknown : bool
        Whether something is left out of which the robot file knows nothing.
    disputed : (k,)
        What the unpruned model finds for the label, where that contradicts what file and logs make
        likely; NaN elsewhere.
    """

    sigma: Array
    projected: Array
    stands_for: tuple[str, ...]
    unknown: bool
    disputed: Array


def body_scatter(structure: Structure) -> Array:
    """Return how far the bodies' parameters may lie from the file's, (p,) [their units].

    Zero for what is no body's, and for bodies of which the file states no mass.
    """
    scatter = np.zeros(len(structure.columns))
    rows = structure.inertial
    theta = structure.nominal[rows]
    mass = np.maximum(theta[:, _M], 0.0)
    # tr I = 2 ∫ r² dm about the origin of the body's frame.
    second = np.maximum(0.5 * theta[:, _DIAGONAL].sum(1), 0.0)
    first = np.sqrt(mass * second)
    moments = (*[second] * 6, *[first] * 3, mass)  # in the order of INERTIAL
    for column, moment in zip(rows.T, moments, strict=True):
        scatter[column] = SHARE * moment
    return scatter


def find_left_out(
    structure: Structure,
    rung: Rung,
    information: Information,
    fit: Estimate,
    full: Estimate | None = None,
) -> LeftOut:
    """Return what the left-out parameters do to those that a rung keeps.

    Parameters
    ----------
    structure : Structure
    rung : Rung
    information : Information
        About all b base parameters.
    fit : Estimate
        Of the rung.
    full : Estimate, optional
        Of all base parameters, which says what the logs know of those that are left out; by default
        only the file does.
    """
    kept = list(fit.kept)
    P = fit.estimator.project(information, fit, rung.M[:, kept])
    difference = P - np.linalg.pinv(rung.M)[kept]
    difference[np.abs(difference) < ROUNDING * np.abs(P).max(1, initial=0.0, keepdims=True)] = 0.0
    stated = structure.nominal_base - rung.held
    scatter = body_scatter(structure)
    shift, spread = difference @ stated, (difference @ structure.G) * scatter
    if full is not None:
        loss = full.estimator.loss(information, full)
        R = loss[:-1, :-1]
        columns = R @ structure.G * scatter
        span = np.linalg.qr(R @ rung.M[:, kept])[0]
        left = np.column_stack([columns, loss[:-1, -1] - R @ structure.nominal_base])
        left -= span @ (span.T @ left)
        density = float(np.max(full.weights * full.variance * full.times))
        mean, root = _learn(left / np.sqrt(density))
        shift, spread = shift + spread @ mean, spread @ root
    sigma, projected = np.zeros(len(rung)), np.full(len(rung), np.nan)
    disputed = projected.copy()
    sigma[kept] = np.hypot(shift, np.linalg.norm(spread, axis=1))
    projected[kept] = P @ stated
    if full is not None:
        sigma[kept], disputed[kept] = _settle(rung, fit, full, sigma[kept])
    texts = [""] * len(rung)
    size = np.linalg.norm(structure.G * scatter, axis=1)
    for row, column in enumerate(kept):
        texts[column] = _combination(
            rung.columns[column], structure.base.names, difference[row], size
        )
    bodies = structure.inertial.ravel()
    lost = (difference @ structure.G[:, bodies]).any()
    return LeftOut(
        sigma=sigma,
        projected=projected,
        stands_for=tuple(texts),
        unknown=bool(lost and not scatter.any()),
        disputed=disputed,
    )


def _settle(rung: Rung, fit: Estimate, full: Estimate, sigma: Array) -> tuple[Array, Array]:
    """Return σ that reaches what the unpruned model finds, and that, where it had to grow, (k,).

    Parameters
    ----------
    rung : Rung
    fit, full : Estimate
        Of the rung, and of all base parameters.
    sigma : (k,)
        By file and logs, of the parameters that `fit` determines.
    """
    kept = list(fit.kept)
    meant = np.linalg.pinv(rung.M)[kept]
    meant[np.abs(meant) < ROUNDING * np.abs(meant).max(1, initial=0.0, keepdims=True)] = 0.0
    known = ~(meant[:, ~full.determined] != 0).any(1)
    value = meant @ (np.where(full.determined, full.value, 0.0) - rung.held)
    at = list(full.kept)
    own = np.einsum("ka,ab,kb->k", meant[:, at], full.covariance[np.ix_(at, at)], meant[:, at])
    reach = REACH * np.sqrt(np.maximum(own, 0.0) * float(np.max(full.times)))
    apart = np.abs(fit.value[kept] - value) - reach
    grown = known & (apart > REACH * np.hypot(sigma, fit.sigma[kept]))
    return np.where(grown, apart / REACH, sigma), np.where(grown, value, np.nan)


def _learn(left: Array) -> tuple[Array, Array]:
    """Return mean (p,) and root (p, p) of the covariance of p parameters, by file and logs.

    Parameters
    ----------
    left : (r, p + 1)
        What no kept parameter can take over, over the noise: of each parameter's column, in units
        of the standard deviation that the file leaves it, and of the torque less what the file's
        robot needs.
    """
    A = left[:, :-1]
    _, s, Vt = np.linalg.svd(A)
    narrower = np.ones(len(Vt))
    narrower[: len(s)] = 1.0 / np.hypot(1.0, s)
    root = Vt.T * narrower
    return root @ (root.T @ (A.T @ left[:, -1])), root


def _combination(name: str, members: Sequence[str], coefficients: Array, size: Array) -> str:
    """Return a parameter with the left-out ones that it stands for, the largest first."""
    share = np.abs(coefficients) * size
    order = np.argsort(-share, kind="stable")
    shown = [j for j in order[:NAMED] if share[j] > LEAST * np.linalg.norm(share)]
    if not shown:
        return ""
    text = name
    for j in shown:
        sign = "−" if coefficients[j] < 0 else "+"
        text += f" {sign} {abs(coefficients[j]):.2g}·{members[j]}"
    return f"{text} + …" if np.count_nonzero(share) > len(shown) else text
