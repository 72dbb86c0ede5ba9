"""Effects that are in the data and not in the robot file: their names and their torque.

Written as laws of the motion, apart from the columns in `effects`; size is a share of the joint's
torque, so that one word describes a hidden effect on any robot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from identifiability.foundation.errors import IdentifiabilityError, listing, near_match
from identifiability.foundation.linalg import without_rounding
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.simulation.forces import stribeck
from identifiability.simulation.motion import PrescribedMotion
from identifiability.simulation.mujoco_robot import MujocoRobot, RigidTorque

#: Law of a hidden effect at one axis: (speed, position from home, load) -> force, up to a factor.
Law = Callable[[Array, Array, Array], Array]


def _typical(speed: Array) -> float:
    return float(np.sqrt(np.mean(speed**2))) or 1.0


def _ripple(_speed: Array, position: Array, _load: Array) -> Array:
    force: Array = np.sin(16 * np.pi * (position - position.min()) / max(np.ptp(position), 1e-12))
    return force


def _cable(_speed: Array, position: Array, _load: Array) -> Array:
    """Return what a cable does that is bent at one end and pulled tight at the other."""
    along = 2 * (position - position.min()) / max(np.ptp(position), 1e-12) - 1
    force: Array = np.exp(3 * (along - 1)) - 0.4 * np.tanh(3 * (along + 0.4))
    return force


def _dahl(_speed: Array, position: Array, _load: Array) -> Array:
    """Return friction that builds up over a fiftieth of the range after a reversal [Dahl 1968]."""
    way = max(float(np.ptp(position)) / 50, 1e-12)
    z, out = 0.0, [0.0]
    for step in np.diff(position).tolist():
        z += (1.0 - z * np.sign(step)) * step / way
        out.append(min(max(z, -1.0), 1.0))
    return np.array(out)


def _uneven(speed: Array, position: Array, _load: Array) -> Array:
    """Return dry friction that is high at one end and low at the other, with a bump between."""
    along = 2 * (position - position.min()) / max(np.ptp(position), 1e-12) - 1
    force: Array = np.sign(speed) * (1.0 + along + np.exp(-8 * (along - 0.2) ** 2))
    return force


def _play(speed: Array, position: Array, load: Array) -> Array:
    """Return the load that is not carried within a fiftieth of the range after each reversal."""
    since, way = np.zeros(len(position)), 0.0
    steps = np.abs(np.diff(position, prepend=position[0]))
    for k, (step, turned) in enumerate(zip(steps, np.diff(np.sign(speed), prepend=0), strict=True)):
        way = 0.0 if turned else way + step
        since[k] = way
    lost: Array = -load * (since < np.ptp(position) / 50)
    return lost


#: Effects that can be hidden at actuated joints.
HIDDEN: dict[str, Law] = {
    "stribeck_friction": lambda speed, _at, _load: stribeck(speed, 1.0, 0.3 * _typical(speed)),
    "coulomb_asymmetry": lambda speed, _at, _load: np.abs(np.sign(speed)),
    "torque_offset": lambda speed, _at, _load: np.ones_like(speed),
    "rising_friction": lambda speed, _at, _load: -stribeck(speed, 1.0, 0.3 * _typical(speed)),
    "sigmoid_friction": lambda speed, _at, _load: np.tanh(speed / (0.4 * _typical(speed))),
    "hysteresis": _dahl,
    "position_friction": _uneven,
    "backlash": _play,
    "quadratic_friction": lambda speed, _at, _load: np.abs(speed) * speed,
    "joint_stiffness": lambda _speed, position, _load: position,
    "load_dependent_friction": lambda speed, _at, load: np.abs(load) * np.sign(speed),
    "position_ripple": _ripple,
    "free_spring": lambda _speed, position, _load: 0.7 * position.max() - position,
    "gravity_spring": lambda _speed, position, _load: np.sin(position + 0.8),
    "position_torque": _cable,
}

#: Effects that are hidden at passive joints.
HIDDEN_PASSIVE = "passive_joint_friction"

#: Effects of records and of the whole robot; a thermal drift is in no dictionary.
HIDDEN_WHOLE = (
    "time_delay",
    "clock_error",
    "torque_leak",
    "velocity_leak",
    "torque_scale",
    "torque_drift",
    "friction_drift",
    "thermal_drift",
    "gravity_tilt",
    "payload",
)

#: Root mean square of a hidden effect relative to that of the torque of its joint.
DEFAULT_SHARE = 0.05

#: Angle [rad] and mass [kg] of effects of the whole robot before they are scaled.
SMALL_ANGLE = 1e-3
SMALL_MASS = 0.1


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


def hideable(laws: Iterable[str] = ()) -> list[str]:
    """Return the names of effects that can be hidden, those of further laws among them."""
    return [*HIDDEN, HIDDEN_PASSIVE, *HIDDEN_WHOLE, *laws]


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
    known = hideable(own)
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
    """Return a force (N,) or (N, n) scaled to a share of the rms of a torque of that shape."""
    size = np.sqrt(np.mean(force**2))
    return force * (share * np.sqrt(np.mean(tau**2)) / size) if size > 0 else force


def hidden_torque(
    robot: Robot, move: PrescribedMotion, rigid: RigidTorque, tau: Array, hidden: Hidden
) -> Array:
    """Return the torque of a hidden effect, scaled to a share of the torque, (N, n).

    Raises
    ------
    IdentifiabilityError
        If the effect or the joint is not in this robot.
    """
    if hidden.name == HIDDEN_PASSIVE:
        return _passive(robot, rigid, tau, hidden)
    if hidden.name in ("gravity_tilt", "payload"):
        return _whole(robot, move, rigid, tau, hidden)
    out = np.zeros_like(tau)
    home = robot.actuated_positions(robot.home[None])[0]
    for k in _chosen(robot.joints, hidden, robot):
        law = hidden.law or HIDDEN.get(hidden.name)
        if law is not None:
            load = without_rounding(rigid.tau, rigid.tau)[:, k]
            force = law(move.dq[:, k], move.q[:, k] - home[k], load)
        else:
            force = _record(move, tau, k, hidden.name)
        out[:, k] = scaled(force, tau[:, k], hidden.share)
    return out


def _chosen(names: Sequence[str], hidden: Hidden, robot: Robot) -> list[int]:
    for joint in hidden.joints:
        if joint not in names:
            raise IdentifiabilityError(
                f"{hidden.name} cannot be hidden in '{joint}' of {robot.name}"
                f"{near_match(joint, names)} It can be in {listing(names)}."
            )
    return [k for k, name in enumerate(names) if not hidden.joints or name in hidden.joints]


def _record(move: PrescribedMotion, tau: Array, k: int, name: str) -> Array:
    """Return what a late, leaking or drifting record adds to joint k, (N,)."""
    step = np.median(np.diff(move.t))
    seams = np.flatnonzero(np.diff(move.t) > 3 * step) + 1
    if name in ("time_delay", "clock_error"):
        slope = np.concatenate([np.gradient(part) for part in np.split(tau[:, k], seams)])
        return slope if name == "clock_error" else -slope
    if name == "torque_scale":
        return tau[:, k]
    if name in ("torque_leak", "velocity_leak"):
        source = tau if name == "torque_leak" else move.dq
        return source[:, (k + 1) % tau.shape[1]]
    if name in ("torque_drift", "friction_drift"):
        since = np.concatenate([t - t[0] for t in np.split(move.t, seams)])
        return since - 0.4 * since.max() if name == "torque_drift" else since * move.dq[:, k]
    # Warming up after a calibration in the middle: a drift about zero, or it were an offset.
    drift = 1.0 - np.exp(-(move.t - move.t[0]) / (0.5 * np.ptp(move.t) or 1.0))
    centred: Array = drift - drift.mean()
    return centred


def _passive(robot: Robot, rigid: RigidTorque, tau: Array, hidden: Hidden) -> Array:
    axes = robot.passive_axes
    if not axes:
        raise IdentifiabilityError(
            f"{robot.name} has no passive joints, so {hidden.name} cannot be hidden in it."
        )
    out = np.zeros_like(tau)
    for at in _chosen([a.name for a in axes], hidden, robot):
        k = int(np.flatnonzero(robot.dependent == axes[at].dof)[0])
        speed = rigid.passive_v[:, k]
        out -= (np.sign(speed) + speed / _typical(speed))[:, None] * rigid.X[:, k]
    return scaled(out, tau, hidden.share)


def _whole(
    robot: Robot, move: PrescribedMotion, rigid: RigidTorque, tau: Array, hidden: Hidden
) -> Array:
    """Return the difference that a tilted base or a load at the tip makes to MuJoCo's torque."""
    other = MujocoRobot(robot)
    if hidden.name == "gravity_tilt":
        g = np.array(other.model.opt.gravity)
        other.model.opt.gravity[:] = g + SMALL_ANGLE * np.cross([0.6, 0.8, 0.0], g)
    else:
        tip = np.flatnonzero(other.model.body_weldid)[-1]  # the last body that moves
        other.model.body_mass[tip] += SMALL_MASS
    changed = other.inverse_dynamics(move.q, move.dq, move.ddq)
    return scaled(changed.tau - rigid.tau, tau, hidden.share)
