"""A nominal robot as a prior on the cone: the log-det divergence of each body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.program import adjoint_inverse, body_scale, matrix
from identifiability.physical.pseudo_inertia import BASIS, check_body, to_matrix

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CadPrior:
    """Log-det divergence from a nominal robot [Lee 2020], in units of the noise variance.

    Adds ``weight Σ_k [log det J0_k − log det J_k + tr(J0_k⁻¹ J_k) − 4]`` to ``rss / σ²``. It does
    not depend on units or frames, and is infinite at the edge of the cone.

    Attributes
    ----------
    phi : (p,)
        Nominal parameters; only the inertial ones count.
    weight : float
    """

    phi: Floats
    weight: float = 1.0

    def __post_init__(self) -> None:
        if not self.weight > 0:
            raise ValueError(
                f"CAD prior: weight {self.weight:g} was given; expected a positive number; "
                "leave the prior out instead of weighing it by zero."
            )


def divergence(region: PhysicalSet, prior: CadPrior, x: Any) -> Any:
    """Sum of the divergences as an expression of scaled parameters x (p,)."""
    cones = [matrix(map_, x) for map_ in nominal_cones(region, prior)]
    atoms: Any = cp
    return sum(atoms.trace(J) - atoms.log_det(J) - 4 for J in cones)


def nominal_cones(region: PhysicalSet, prior: CadPrior) -> Floats:
    """Maps (nb, 16, p) to pseudo-inertias congruent to the nominal ones, which become the identity.

    Raises
    ------
    ValueError
        When a nominal body cannot exist or has no volume; it is named.
    """
    scale, phi = body_scale(region), np.asarray(prior.phi, float)
    maps = np.zeros((len(region.bodies), 16, region.size))
    for k, (name, columns) in enumerate(zip(region.names, region.bodies, strict=True)):
        J0 = to_matrix(phi[columns])
        s = np.sqrt(np.abs(np.diag(J0)))
        if not (s.all() and np.linalg.eigvalsh(J0 / np.outer(s, s))[0] > 1e-9):
            raise ValueError(_bad_nominal(phi[columns], name))
        inverse = np.linalg.inv(np.linalg.cholesky(J0))
        congruent = np.einsum("ai,kij,bj->kab", inverse, BASIS, inverse)
        maps[k][:, columns] = congruent.reshape(10, 16).T * scale[columns]
    return maps


def prior_gap(region: PhysicalSet, prior: CadPrior, x: Floats, slope: Floats) -> float:
    """How far the pull of the prior at x is from balancing the slope (p,) of the data.

    The conjugate of the divergence, min_J ⟨P, J⟩ + w (tr J − log det J − 4) = w log det(1 + P/w),
    is tight at P = w (J⁻¹ − 1), the optimum.
    """
    maps, w, one = nominal_cones(region, prior), prior.weight, np.eye(4)
    J = (maps @ x).reshape(-1, 4, 4)
    P = adjoint_inverse(maps, slope).reshape(-1, 4, 4)
    sign, dual = np.linalg.slogdet(one + P / w)
    if not (sign > 0).all():
        return float("inf")
    own = np.trace(J, axis1=1, axis2=2) - np.linalg.slogdet(J)[1] - 4
    return abs(float(np.sum(w * (own - dual)) + np.sum(P * J)))


def _bad_nominal(theta: Floats, name: str) -> str:
    check = check_body(theta, name)
    flat = f"{name}: the nominal body has no volume (a disc, a rod or a point)."
    return (
        f"CAD prior: {flat if check.feasible else check.reason} A log-det prior needs bodies with "
        "volume; correct the robot file or give the body thickness."
    )
