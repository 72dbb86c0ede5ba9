"""Couplings of several joints: stated, with some joints held still, or led by another joint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from numpy.polynomial import Polynomial

from identifiability.robot.parts import Coupling, Term


def couple(name: str, joint: str, terms: Iterable[Term]) -> Coupling:
    """Return the coupling of a joint that is a sum of terms, as simple as it can be said."""
    constant, left = 0.0, []
    for term in terms:
        if term.weights:
            left.append(term)
        else:
            constant += float(Polynomial(term.polynomial)(0.0))
    if not left:
        return Coupling(name, joint, None, (constant,))
    if len(left) == 1 and len(left[0].weights) == 1 and joint not in left[0].weights:
        ((of, w),) = left[0].weights.items()
        poly = Polynomial(left[0].polynomial)(Polynomial([0.0, w])) + constant
        return Coupling(name, joint, of, tuple(map(float, poly.coef)))
    return Coupling(name, joint, None, (constant,), tuple(left))


def hold_still(coupling: Coupling, held: Mapping[str, float]) -> Coupling:
    """Return a coupling in which some of the joints that are followed stand still."""
    terms = []
    for term in coupling.terms:
        moving = {j: w for j, w in term.weights.items() if j not in held}
        still = sum(w * held[j] for j, w in term.weights.items() if j in held)
        poly = Polynomial(term.polynomial)(Polynomial([still, 1.0]))
        terms.append(Term(moving, tuple(map(float, poly.coef))))
    return couple(coupling.name, coupling.joint, terms)


def lead_by_another(coupling: Coupling, at: float) -> Coupling | None:
    """Return what a coupling says of another joint where its own one stands still, or None.

    The other is one that enters linearly, and once.
    """
    for k, term in enumerate(coupling.terms):
        poly = Polynomial(term.polynomial).trim()
        others = [t for i, t in enumerate(coupling.terms) if i != k]
        once = [j for j in term.weights if not any(j in t.weights for t in others)]
        if poly.degree() != 1 or not once:
            continue
        slope = float(poly.coef[1]) * term.weights[once[0]]
        rest = {j: -w / term.weights[once[0]] for j, w in term.weights.items() if j != once[0]}
        new = [Term({}, ((at - float(poly.coef[0])) / slope,)), Term(rest, (0.0, 1.0))]
        new += [Term(t.weights, tuple(-c / slope for c in t.polynomial)) for t in others]
        return couple(coupling.name, once[0], new)
    return None
