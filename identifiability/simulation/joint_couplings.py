"""Couplings of joints on the other road, joint by joint in MuJoCo's indices."""

from __future__ import annotations

from typing import Any

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Robot


@frozen
class JointCoupling:
    """A coupling in MuJoCo's terms: a joint less a sum of polynomials of sums of joints is zero.

    Attributes
    ----------
    joint : (int, int)
        Index of the joint that follows, in velocities and in positions.
    terms : tuple
        Of each polynomial: indices in velocities and in positions, weights, and the polynomial.
    """

    joint: tuple[int, int]
    terms: tuple[tuple[list[int], list[int], Array, Any], ...]

    def error(self, q: Array) -> float:
        """Return what the coupling is violated by at positions (nq,)."""
        return float(q[self.joint[1]] - sum(poly(w @ q[at]) for _, at, w, poly in self.terms))

    def gradient(self, q: Array, size: int) -> Array:
        """Return its gradient in velocities at positions (nq,), (1, size)."""
        row = np.zeros((1, size))
        row[0, self.joint[0]] = 1.0
        for dofs, at, w, poly in self.terms:
            row[0, dofs] -= poly.deriv()(w @ q[at]) * w
        return row

    def gradient_rate(self, q: Array, v: Array) -> Array:
        """Return the time derivative of the gradient at velocities (nv,), (1, nv)."""
        row = np.zeros((1, len(v)))
        for dofs, at, w, poly in self.terms:
            row[0, dofs] -= poly.deriv(2)(w @ q[at]) * (w @ v[dofs]) * w
        return row


def find_couplings(model: Any, robot: Robot) -> list[JointCoupling]:
    """Return the joint couplings of a robot."""
    out = []
    for c in robot.couplings:
        joint = model.joint(c.joint)
        terms = []
        for term in c.terms:
            joints = [model.joint(name) for name in term.weights]
            dofs = [int(j.dofadr[0]) for j in joints]
            at = [int(j.qposadr[0]) for j in joints]
            weights = np.array([*term.weights.values()], float)
            terms.append((dofs, at, weights, np.polynomial.Polynomial(term.polynomial)))
        out.append(JointCoupling((int(joint.dofadr[0]), int(joint.qposadr[0])), tuple(terms)))
    return out
