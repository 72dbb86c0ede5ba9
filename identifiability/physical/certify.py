"""Can base parameters belong to a real robot? The answer with its proof.

A vector ``beta`` of base parameters is feasible exactly when some full vector ``phi`` of the
physical set has ``G phi = beta``. The proof of yes is that ``phi``; the proof of no is a
combination of the base parameters that no real robot has below zero, and ``beta`` has
[Boyd 2004, §5.8].
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.engines.mapping import one_thread
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.feasible_set import ADVICE, PhysicalSet, Program, above, adjoint
from identifiability.physical.pseudo_inertia import BOUNDARY

#: Margins beyond one body scale are not pursued: the question is whether there is any.
ROOM = 1.0


@frozen
class Certificate:
    """Whether base parameters are feasible, and the proof.

    Attributes
    ----------
    margin : float
        Largest margin (dimensionless) that all bodies and signs can keep at once, at most `ROOM`.
    phi : (p,)
        Full parameters with these base parameters that attain it: a real robot when `feasible`,
        else the least impossible one.
    combination : (b,)
        Coefficients over the base parameters, zero when feasible: no real robot has
        ``combination @ beta`` below zero.
    value : float
        What was found of it.
    level : float
        Instead of zero, where masses or centres of mass are bounded.
    """

    margin: float
    phi: Array
    combination: Array
    value: float
    level: float = 0.0

    @property
    def feasible(self) -> bool:
        """Whether a real robot has these base parameters; bodies without volume have margin 0."""
        return self.margin >= -BOUNDARY

    def sentence(self, names: Sequence[str]) -> str:
        """Say the certificate in words.

        Parameters
        ----------
        names : (b,) str
            Names of the base parameters.
        """
        if self.feasible:
            return f"A real robot has these base parameters (margin {self.margin:.2g})."
        size = np.abs(self.combination)
        terms = [i for i in np.argsort(-size) if size[i] > 1e-3 * size.max()]
        text = " ".join(f"{self.combination[i]:+.3g}·[{names[i]}]" for i in terms)
        return (
            f"No real robot has these base parameters: {text} is at least {self.level:.3g} for any "
            f"real bodies{' within the bounds' if self.level else ''}, and {self.value:.3g} was "
            "found."
        )


def certify(base_map: Array, beta: Array, region: PhysicalSet) -> Certificate:
    """Decide whether base parameters can belong to a real robot.

    Parameters
    ----------
    base_map : (b, p)
        ``G`` with ``beta = G phi``.
    beta : (b,)
        Base parameters.
    region : PhysicalSet
        What is possible.

    Raises
    ------
    ValueError
        When shapes disagree, no vector at all maps to `beta`, or the solver finds no answer.
    """
    import cvxpy as cp  # noqa: PLC0415

    if base_map.shape != (beta.size, region.size):
        raise ValueError(
            f"certificate: a map {base_map.shape} and {beta.size} base parameters were given; "
            f"expected ({beta.size}, {region.size}); build the map from the model of the physical "
            "set."
        )
    with one_thread():
        scale = _column_scale(base_map, beta, region)
        G = base_map * scale
        start, null = _solutions(G, beta)
        u, t = cp.Variable(null.shape[1]), cp.Variable()
        x = start + null @ u
        signs = region.scaled_rows @ x - region.least >= t
        cones = np.concatenate([region.cones, region.ellipsoids])
        bodies = [above(map_, x, t) for map_ in cones]
        try:
            Program(-t, [signs, t <= ROOM, *bodies]).solve()
        except ValueError as error:
            raise ValueError(
                f"certificate: the solver found no answer ({error}); expected one; {ADVICE}."
            ) from error
        phi, margin = scale * (start + null @ u.value), float(t.value)
        if margin >= -BOUNDARY:
            return Certificate(margin, phi, np.zeros_like(beta), 0.0)
        held = signs.dual_value
        Z = np.array([body.dual_value.ravel() for body in bodies]).reshape(-1, 16)
        force = adjoint(cones, Z) + held @ region.scaled_rows
        combination = np.linalg.lstsq(G.T, force)[0]
        level = float(held @ region.least)
        return Certificate(margin, phi, combination, float(combination @ beta), level)


def _solutions(G: Array, beta: Array) -> tuple[Array, Array]:
    """One solution of ``G x = beta`` and a basis of its null space, of at least one column."""
    heights = np.linalg.norm(G, axis=1)
    heights = np.where(heights > 0, heights, 1.0)
    U, s, Vt = np.linalg.svd(G / heights[:, None])
    rank = int(np.sum(s > 1e-9 * s[0])) if s.size else 0
    x: Array = Vt[:rank].T @ ((U.T @ (beta / heights))[:rank] / s[:rank])
    missed = np.abs(G @ x - beta) > 1e-6 * (np.abs(G) @ np.abs(x) + np.abs(beta))
    if missed.any():
        raise ValueError(
            f"certificate: no parameter vector has the base parameters {np.flatnonzero(missed)} "
            "together; expected values of independent combinations; leave dependent ones out."
        )
    null = Vt[rank:].T if rank < G.shape[1] else np.zeros((G.shape[1], 1))
    return x, null


def _column_scale(G: Array, beta: Array, region: PhysicalSet) -> Array:
    # A column outside the bodies takes its scale from the base parameter it enters most.
    scale = region.scale.copy()
    heights = np.abs(G).max(axis=1, initial=0.0)
    for j in np.flatnonzero(~region.inertial):
        i = int(np.argmax(np.abs(G[:, j]) / np.where(heights > 0, heights, 1.0)))
        if G[i, j] != 0 and beta[i] != 0:
            scale[j] = abs(beta[i] / G[i, j])
    return scale
