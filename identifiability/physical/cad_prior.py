"""A nominal robot as a prior on the cone: the log-det divergence of each body."""

from __future__ import annotations

from typing import Any

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.program import adjoint_inverse, square
from identifiability.physical.pseudo_inertia import BASIS, BOUNDARY, check_body, to_matrix

#: Weights [σ²] of the path on which predictions choose, the heaviest first. At 10 a body three
#: times as heavy as the file's costs what a 3 σ deviation does, at 0.01 what 0.1 σ does: it breaks
#: ties and no more. Without any, bodies of which the logs say nothing weigh anything.
WEIGHTS = tuple(10.0**k for k in range(5, -3, -1))

#: The one where nothing chooses.
WEAK = 1.0

#: Least mean square of a nominal body's thickness, as a share of that of its size.
THIN = 1e-3


@frozen
class CadPrior:
    """Log-det divergence from a nominal robot [Lee 2020], in units of the noise variance.

    Adds ``weight Σ_k [log det J0_k − log det J_k + tr(J0_k⁻¹ J_k) − 4]`` to ``rss / σ²``. It does
    not depend on units or frames, and is infinite at the edge of the cone. A nominal body that is
    flat or a rod counts as one of a little thickness, `THIN`.

    Attributes
    ----------
    phi : (p,)
        Nominal parameters; only the inertial ones count.
    weight : float
    """

    phi: Array
    weight: float = 1.0

    def __post_init__(self) -> None:
        if not self.weight > 0:
            raise ValueError(
                f"CAD prior: weight {self.weight:g} was given; expected a positive number; "
                "leave the prior out instead of weighing it by zero."
            )


def divergence(map_: Array, x: Any) -> Any:
    """Return the divergence of a body as cvxpy knows it: ``tr J − log det J − 4``.

    Parameters
    ----------
    map_ : (16, p)
        Of `nominal_cones`: ``J = map_ x``.
    x : cvxpy expression, (p,)
    """
    import cvxpy as cp  # noqa: PLC0415

    J = square(map_, x)
    return cp.trace(J) - cp.log_det(J) - 4


def nominal_cones(region: PhysicalSet, prior: CadPrior) -> Array:
    """Maps (nb, 16, p) to pseudo-inertias congruent to the nominal ones, which become the identity.

    Raises
    ------
    ValueError
        When a nominal body cannot exist or is a point; it is named.
    """
    maps = np.zeros((len(region.bodies), 16, region.size))
    for k, (name, columns) in enumerate(zip(region.names, region.bodies, strict=True)):
        inverse = np.linalg.inv(np.linalg.cholesky(thick_inertia(prior.phi[columns], name)))
        congruent = np.einsum("ai,kij,bj->kab", inverse, BASIS, inverse)
        maps[k][:, columns] = congruent.reshape(10, 16).T * region.scale[columns]
    return maps


def prior_gap(maps: Array, weight: float, x: Array, slope: Array) -> float:
    """How far the pull of a prior at x is from balancing the slope (p,) of the data.

    The conjugate of the divergence, min_J ⟨P, J⟩ + w (tr J − log det J − 4) = w log det(1 + P/w),
    is tight at P = w (J⁻¹ − 1), the optimum. `maps` are those of `nominal_cones`.
    """
    w, one = weight, np.eye(4)
    J = (maps @ x).reshape(-1, 4, 4)
    P = adjoint_inverse(maps, slope).reshape(-1, 4, 4)
    sign, dual = np.linalg.slogdet(one + P / w)
    if not (sign > 0).all():
        return float("inf")
    own = np.trace(J, axis1=1, axis2=2) - np.linalg.slogdet(J)[1] - 4
    return abs(float(np.sum(w * (own - dual)) + np.sum(P * J)))


def thick_inertia(theta: Array, name: str) -> Array:
    """Return the pseudo-inertia (4, 4) of a nominal body, with some thickness where it has none.

    Parameters
    ----------
    theta : (10,) [kg m², kg m, kg]
    name : str

    Raises
    ------
    ValueError
        When the body cannot exist or is a point; it is named.
    """
    J, check = to_matrix(theta), check_body(theta, name)
    if not check.feasible:
        raise ValueError(
            f"CAD prior: {check.reason} A log-det prior needs bodies that can exist; correct the "
            "robot file."
        )
    mass, first = J[3, 3], J[:3, 3]
    spread, axes = np.linalg.eigh(J[:3, :3] - np.outer(first, first) / (mass or 1.0))
    size = spread.sum()
    if not (mass > 0 and size > BOUNDARY * (size + first @ first / mass)):
        raise ValueError(
            f"CAD prior: {name}: the nominal body is a point or has no mass. A log-det prior needs "
            "bodies with extent; correct the robot file."
        )
    J[:3, :3] += (axes * np.maximum(THIN * size - spread, 0.0)) @ axes.T
    return J
