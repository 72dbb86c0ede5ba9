"""`Quantity`: mass, centre and inertia of a real body near what logs say, with their intervals.

The body is the possible one nearest to the estimate in the metric of its own covariance: a
projection on a convex set brings an estimate no farther from any body that can be. The centre and
the moments about it follow from the ten parameters to first order.
"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.shares import REACH
from identifiability.foundation.values import frozen
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.least_squares import LeastSquares
from identifiability.physical.project import project
from identifiability.physical.pseudo_inertia import to_matrix
from identifiability.workflows.payload.estimate import TOUCHED, TYPICAL, LoadEstimate

#: Names and units of what is said of a load.
QUANTITIES = {
    "mass": "kg",
    **dict.fromkeys(("centre x", "centre y", "centre z"), "m"),
    **dict.fromkeys(("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), "kg·m²"),
}

#: Rows and columns of these moments in a tensor.
_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))

#: The moment that bounds a product of inertia, half of it on either side.
_BOUNDS = {"Ixy": "Izz", "Ixz": "Iyy", "Iyz": "Ixx"}

#: Radius of gyration of a load of which nothing is known [m].
LENGTH = 0.1

#: Least mass beside which moments are small or large [kg].
LIGHTEST = 1e-3

#: Steps by which derivatives are taken, as a share of a body's own numbers.
STEP = 1e-4


@frozen(kw_only=True)
class Quantity:
    """One number about a load.

    Attributes
    ----------
    name, unit : str
    value : float
    low, high : float
        95 % interval, of which nothing that no body can have is part.
    told : bool
        Whether the logs tell it.
    why : str
        Why not, or what they do tell.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    told: bool
    why: str = ""

    @property
    def half(self) -> float:
        """Half the width of the interval."""
        return 0.5 * (self.high - self.low)


def nearest_body(found: LoadEstimate) -> Array:
    """Return the parameters (10,) of the real body nearest to an estimate."""
    region = PhysicalSet(
        bodies=np.arange(10)[None],
        nonnegative=np.zeros(10, bool),
        names=("load",),
        mass=np.array([max(abs(found.theta[9]), LIGHTEST)]),
        length=np.array([LENGTH]),
    )
    data = LeastSquares(found.root, found.root @ found.theta, 1.0, 1.0)
    phi: Array = project(data, region).phi
    return phi


def describe_body(theta: Array) -> Array:
    """Return mass, centre and the moments about it, (10,) in the order of `QUANTITIES`."""
    mass, centre = theta[9], theta[6:9] / theta[9]
    second = to_matrix(theta)[:3, :3] - mass * np.outer(centre, centre)
    tensor = np.trace(second) * np.eye(3) - second
    return np.array([mass, *centre, *(tensor[at] for at in _ENTRIES)])


def state_quantities(found: LoadEstimate, body: Array, length: float) -> tuple[Quantity, ...]:
    """Return what is known of a body near an estimate.

    Parameters
    ----------
    found : LoadEstimate
    body : (10,)
        The real one nearest to it.
    length : float [m]
        Size of the robot's bodies: where a centre is less certain, it is not told.
    """
    values = describe_body(body)
    steps = STEP * TYPICAL * max(body[9], LIGHTEST)
    slopes = np.array(
        [
            (describe_body(body + h) - describe_body(body - h)) / (2 * h.sum())
            for h in np.diag(steps)
        ]
    ).T
    half = REACH * np.sqrt(np.einsum("qi,ij,qj->q", slopes, found.covariance, slopes))
    along = np.abs(slopes * TYPICAL @ found.unknown).max(1, initial=0.0)
    open_ = along > TOUCHED * np.linalg.norm(slopes * TYPICAL, axis=1)
    half = np.where(open_, np.inf, half)
    names = list(QUANTITIES)
    ends = {n: (v - h, v + h) for n, v, h in zip(names, values, half, strict=True)}
    heavy = ends["mass"][0] > 0
    return tuple(
        _judge(name, float(value), ends, heavy=heavy, length=length)
        for name, value in zip(names, values, strict=True)
    )


def _judge(
    name: str, value: float, ends: dict[str, tuple[float, float]], *, heavy: bool, length: float
) -> Quantity:
    """Return one quantity, kept to what a body can have, and whether it is told."""
    low, high = ends[name]
    unit, half, why = QUANTITIES[name], 0.5 * (high - low), ""
    if name in _BOUNDS:
        most = 0.5 * ends[_BOUNDS[name]][1]
        physics, low, high = half >= most, max(low, -most), min(high, most)
        why = "no more than its moments allow by themselves" if physics and low * high < 0 else ""
    elif not name.startswith("centre"):
        why = f"at most {high:.3g} {unit}" if low <= 0 else ""
        low = max(low, 0.0)
    elif half > length:
        why = f"less certain than ± {length:.2g} m"
    if not np.isfinite(half):
        why = "this motion does not tell it"
    elif not heavy and name != "mass":
        why = "no mass is told"
    return Quantity(name=name, unit=unit, value=value, low=low, high=high, told=not why, why=why)
