"""Friction, rotor inertia and hidden effects of the simulated robot.

Written out as force laws of speed, position and load; the columns in `effects` are written apart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from identifiability.foundation.errors import IdentifiabilityError, near_match
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: Law of a hidden effect at one axis: (speed, position from home, load) -> force, up to a factor.
Law = Callable[[Array, Array, Array], Array]


def both_directions(parameters: Mapping[str, float]) -> dict[str, float]:
    """Return parameters with a Coulomb level for each direction where one stands for both."""
    out = dict(parameters)
    for name, value in parameters.items():
        if name.endswith(".Fc"):
            out.setdefault(f"{name}+", value)
            out.setdefault(f"{name}-", value)
    return out


def nominal_force(values: Mapping[str, float], name: str, speed: Array) -> Array:
    """Return viscous and Coulomb friction of a joint from its parameter values, (N,)."""
    coulomb = values.get(f"{name}.Fc", 0.0)
    forward = values.get(f"{name}.Fc+", coulomb)
    backward = values.get(f"{name}.Fc-", coulomb)
    dry = np.where(speed > 0, forward, np.where(speed < 0, -backward, 0.0))
    return values.get(f"{name}.Fv", 0.0) * speed + dry


def stribeck(speed: Array, excess: float, velocity: float, shape: float = 1.0) -> Array:
    """Return the Stribeck excess ``(Fs - Fc) exp(-|q̇/vs|^δ) sign(q̇)`` [Olsson 1998], (N,).

    The paper prints the exponent without its minus sign and without sign(q̇) [Díaz 2010, Eq. 20].
    """
    decay = np.exp(-(np.abs(speed / velocity) ** shape))
    force: Array = excess * decay * np.sign(speed)
    return force


def _typical(speed: Array) -> float:
    return float(np.sqrt(np.mean(speed**2))) or 1.0


def _stribeck(speed: Array, _position: Array, _load: Array) -> Array:
    return stribeck(speed, 1.0, 0.3 * _typical(speed))


def _asymmetry(speed: Array, _position: Array, _load: Array) -> Array:
    return np.abs(np.sign(speed))


def _offset(speed: Array, _position: Array, _load: Array) -> Array:
    return np.ones_like(speed)


def _quadratic(speed: Array, _position: Array, _load: Array) -> Array:
    return np.abs(speed) * speed


def _spring(_speed: Array, position: Array, _load: Array) -> Array:
    return position


def _load(speed: Array, _position: Array, load: Array) -> Array:
    force: Array = np.abs(load) * np.sign(speed)
    return force


def _ripple(_speed: Array, position: Array, _load: Array) -> Array:
    force: Array = np.sin(16 * np.pi * (position - position.min()) / max(np.ptp(position), 1e-12))
    return force


#: Effects that can be hidden at actuated joints.
HIDDEN: dict[str, Law] = {
    "stribeck_friction": _stribeck,
    "coulomb_asymmetry": _asymmetry,
    "torque_offset": _offset,
    "quadratic_friction": _quadratic,
    "joint_stiffness": _spring,
    "load_dependent_friction": _load,
    "position_ripple": _ripple,
}

#: Effects that are hidden at passive joints.
HIDDEN_PASSIVE = "passive_joint_friction"

#: Effects of the whole robot: a delay of the torque, torque that leaks from joint to joint, a
#: thermal drift. The last two are in no dictionary.
HIDDEN_WHOLE = ("time_delay", "torque_leak", "thermal_drift", "gravity_tilt", "payload")

#: Root mean square of a hidden effect relative to that of the torque of its joint.
DEFAULT_SHARE = 0.05


@frozen
class Hidden:
    """An effect that is in the data and not in the robot file.

    Attributes
    ----------
    name : str
    share : float
        Its rms as a share of that of the joint's torque.
    joints : tuple of str
        Where it is; everywhere if empty.
    law : callable(speed, position from home, load) -> force, optional
        Of an effect of the user's own.
    """

    name: str
    share: float
    joints: tuple[str, ...] = ()
    law: Law | None = None


def parse_hidden(text: str, laws: Mapping[str, Law] | None = None) -> Hidden:
    """Return what ``stribeck_friction``, ``stribeck_friction=0.1`` or ``…@slider1+slider3`` hides.

    Parameters
    ----------
    text : str
    laws : mapping of name to law, optional
        Of effects that are not known here.

    Raises
    ------
    IdentifiabilityError
    """
    left, given, number = text.partition("=")
    name, _, joints = left.partition("@")
    own = laws or {}
    known = [*HIDDEN, HIDDEN_PASSIVE, *HIDDEN_WHOLE, *own]
    if name not in known:
        raise IdentifiabilityError(
            f"The effect '{name}' cannot be hidden{near_match(name, known)} Those that can are "
            f"{', '.join(known)}."
        )
    try:
        share = float(number) if given else DEFAULT_SHARE
    except ValueError:
        share = -1.0
    if not 0 < share < 10:
        raise IdentifiabilityError(
            f"The size of the hidden effect '{text}' is not understood; give its share of the "
            "joint's torque, such as stribeck_friction=0.05."
        )
    return Hidden(name, share, tuple(j for j in joints.split("+") if j), own.get(name))


def scaled(force: Array, tau: Array, share: float) -> Array:
    """Return a force (N,) scaled to a share of the rms of a torque (N,)."""
    size = np.sqrt(np.mean(force**2))
    return force * (share * np.sqrt(np.mean(tau**2)) / size) if size > 0 else force
