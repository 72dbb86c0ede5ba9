"""Inertial parameters of a body as a 4×4 pseudo-inertia matrix, and checks of it.

The ten parameters ``[Ixx Ixy Ixz Iyy Iyz Izz mx my mz m]`` (tensor entries, ``Ixy = -∫xy dm``,
about the origin of the body frame) belong to a real mass distribution exactly when the matrix

    J = ∫ [r; 1] [r; 1]ᵀ dm = [[S, h], [hᵀ, m]],   S = ½ tr(I) 1 − I,   h = (mx, my, mz)

is positive semidefinite [Traversaro 2016; Wensing 2017].
"""

from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import ArrayLike

from identifiability.foundation.linalg import or_one
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance

#: A body whose margin is above ``-BOUNDARY`` is on or inside the cone: a thin disc has margin 0.
BOUNDARY: Tolerance = 1e-7

#: Least mean square of a nominal body's thickness, as a share of that of its size.
THIN: Tolerance = 1e-3


#: Names and units of what describes a body.
QUANTITIES = {
    "mass": "kg",
    **dict.fromkeys(("centre x", "centre y", "centre z"), "m"),
    **dict.fromkeys(("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), "kg·m²"),
}


def _basis() -> Array:
    basis = np.zeros((10, 4, 4))
    for column, (i, j) in enumerate(combinations_with_replacement(range(3), 2)):
        tensor = np.zeros((3, 3))
        tensor[i, j] = tensor[j, i] = 1.0
        basis[column, :3, :3] = 0.5 * np.trace(tensor) * np.eye(3) - tensor
    for axis in range(3):
        basis[6 + axis, axis, 3] = basis[6 + axis, 3, axis] = 1.0
    basis[9, 3, 3] = 1.0
    basis.flags.writeable = False
    return basis


#: (10, 4, 4): ``J = Σ theta[i] BASIS[i]``.
BASIS = _basis()


def to_matrix(theta: ArrayLike) -> Array:
    """Pseudo-inertia matrices of bodies.

    Parameters
    ----------
    theta : (..., 10) [kg m², kg m, kg]

    Returns
    -------
    (..., 4, 4) symmetric

    Examples
    --------
    >>> to_matrix([2.0, 0, 0, 3.0, 0, 4.0, 0, 0, 0, 1.0]).diagonal()
    array([2.5, 1.5, 0.5, 1. ])
    """
    values = np.asarray(theta, float)
    return (values @ BASIS.reshape(10, 16)).reshape(*values.shape[:-1], 4, 4)


def describe_body(theta: Array) -> Array:
    """Return the `QUANTITIES` of a body, its moments about its centre, (10,).

    Its parameters (10,) are in the order of `GROUPED_KINDS`.
    """
    mass = theta[9]
    centre = theta[6:9] / theta[9]
    second = to_matrix(theta)[:3, :3] - mass * np.outer(centre, centre)
    tensor = np.trace(second) * np.eye(3) - second
    products = tensor[np.triu_indices(3, 1)]
    return np.array([mass, *centre, *np.diag(tensor), *products])


def scale_matrix(mass: ArrayLike, length: ArrayLike) -> Array:
    """Diagonal of the congruence that makes J dimensionless: ``J[i, j] / (s[i] s[j])``.

    Parameters
    ----------
    mass : (...) [kg] > 0
    length : (...) [m] > 0

    Returns
    -------
    (..., 4), the square roots of ``mass * (length², length², length², 1)``
    """
    m, ell = np.broadcast_arrays(np.asarray(mass, float), np.asarray(length, float))
    root = np.sqrt(m)[..., None]
    lengths = np.stack((ell, ell, ell, np.ones_like(ell)), axis=-1)
    return root * lengths


def entry_scale(mass: Array, length: Array) -> Array:
    """Size of the ten parameters of bodies of some mass and length: m ℓ² six times, m ℓ, m.

    Parameters
    ----------
    mass, length : (nb,) [kg], [m]

    Returns
    -------
    (nb, 10) [kg m², kg m, kg]
    """
    power = np.array([2] * 6 + [1] * 3 + [0])
    return mass[:, None] * length[:, None] ** power


def natural_scale(theta: ArrayLike) -> tuple[Array, Array]:
    """Mass and length scales for the comparison of bodies: their mass and radius of gyration.

    A body without mass or extent falls back to 1 kg and 0.1 m, so that the scale is never zero.

    Parameters
    ----------
    theta : (..., 10) [kg m², kg m, kg]

    Returns
    -------
    mass : (...) [kg]
    length : (...) [m]
    """
    values = np.asarray(theta, float)
    mass = or_one(np.abs(values[..., 9]))
    second_moment = np.abs(values[..., [0, 3, 5]].sum(axis=-1)) / 2  # tr S [kg m²]
    length = np.sqrt(second_moment / (3 * mass))
    return mass, np.where(length > 0, length, 0.1)


def margin(theta: ArrayLike, mass: ArrayLike = 1.0, length: ArrayLike = 0.1) -> Array:
    """Smallest eigenvalue of the dimensionless pseudo-inertia; negative when no body can be so.

    Parameters
    ----------
    theta : (..., 10) [kg m², kg m, kg]
    mass, length : (...) [kg], [m], the scale; its choice never changes the sign

    Returns
    -------
    (...) dimensionless
    """
    s = scale_matrix(mass, length)
    J = to_matrix(theta) / (s[..., :, None] * s[..., None, :])
    return np.asarray(np.linalg.eigvalsh(J)[..., 0], float)


def check_body(theta: ArrayLike, name: str) -> str:
    """State why the parameters of one body belong to no mass distribution; nothing if they do.

    Parameters
    ----------
    theta : (10,) [kg m², kg m, kg]
        A body is possible if its margin in its scale (`natural_scale`) is at least −`BOUNDARY`.
    name : str
    """
    values = np.asarray(theta, float)
    if margin(values, *natural_scale(values)) >= -BOUNDARY:
        return ""
    mass = values[9]
    first = values[6:9]
    if mass <= 0:
        what = "must be positive" if mass < 0 else "cannot be zero while its moments are not"
        return f"{name}: mass {mass:.4g} kg {what}."
    S = to_matrix(values)[:3, :3] - np.outer(first, first) / mass  # about the centre of mass
    moments = np.linalg.eigvalsh(S)
    principal = moments.sum() - moments  # descending
    text = ", ".join(f"{value:.4g}" for value in principal)
    what = "none may be negative"
    if principal.min() >= 0:
        what = f"{principal[0]:.4g} is more than the other two together: no body turns like that"
    return f"{name}: the principal moments about its centre of mass are {text} kg m²; {what}."
