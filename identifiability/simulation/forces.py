"""Forces of the simulated robot: friction, rotor inertia, springs, and hidden effects.

Hidden effects are in the data and not in the robot file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field

import numpy as np

from identifiability.foundation.errors import IdentifiabilityError, listing, near_match
from identifiability.foundation.linalg import without_rounding
from identifiability.foundation.names import INERTIAL_KINDS, Array, NumberByName, Strings
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.robot import Axis, Robot
from identifiability.robot.closure import rest_along

from .motion import PrescribedMotion
from .mujoco_robot import MujocoRobot, RigidTorque

# Friction, rotor inertia and springs of the simulated robot.
#
# Written out as force laws of speed and position; the columns in `effects` are written apart.


#: Parameters of springs without a stated rest position.
_SPRINGS = ("k", "kq0", "ks", "kc", "F0")


def both_directions(parameters: NumberByName) -> dict[str, float]:
    """Return parameters with a Coulomb level for each direction, instead of one for both."""
    out = dict(parameters)
    for name, value in parameters.items():
        if name.endswith(".Fc"):
            out.setdefault(f"{name}+", value)
            out.setdefault(f"{name}-", value)
    return out


@frozen(kw_only=True)
class JointTerms:
    """Parameters of one joint or coupled motor.

    Attributes
    ----------
    viscous : float [N·m·s/rad or N·s/m]
    forward, backward : float [N·m or N]
        Coulomb levels.
    inertia : float [kg·m² or kg]
        Of the rotor.
    stiffness : float [N·m/rad or N/m]
    offset : float [N·m or N]
    loose : mapping
        Of springs without a stated rest position, by kind: ``k · position − kq0`` [N·m/rad or N/m,
        N·m or N], ``ks`` and ``kc`` of a gravity spring or counterweight [N·m], a constant ``F0``.
    """

    viscous: float
    forward: float
    backward: float
    inertia: float
    stiffness: float
    offset: float
    loose: NumberByName = field(default_factory=dict)

    @staticmethod
    def of(values: NumberByName, name: str, inertia_parts: Strings) -> JointTerms:
        """Return the terms of a joint from parameter values by name; missing values are zero."""

        def of(kind: str, default: float = 0.0) -> float:
            return values.get(f"{name}.{kind}", default)

        coulomb = of("Fc")
        inertia = sum(map(of, inertia_parts))
        loose = {kind: of(kind) for kind in _SPRINGS}
        return JointTerms(
            viscous=of("Fv"),
            forward=of("Fc+", coulomb),
            backward=of("Fc-", coulomb),
            inertia=inertia,
            stiffness=of("K"),
            offset=of("off"),
            loose=loose,
        )

    def friction(self, speed: Array) -> Array:
        """Return viscous and Coulomb friction at the speeds of a motion (N,), (N,).

        A joint at rest sticks. The motion does not determine its dry friction, which may have any
        value between the two levels. Friction is interpolated linearly from its value when the
        joint stops to its value when the joint breaks away. The integral part of a controller makes
        such torque. Friction is zero before the first motion and after the last one.
        """
        backward = np.where(speed < 0, -self.backward, 0.0)
        dry = np.where(speed > 0, self.forward, backward)
        rests = np.concatenate([[False], speed == 0, [False]])
        known = ~rests[1:-1] | ~(rests[:-2] | rests[2:])  # one zero alone is a reversal
        known[[0, -1]] = True
        at = np.arange(len(speed))
        return self.viscous * speed + np.interp(at, at[known], dry[known])

    def force(self, stretch: Array, speed: Array, acceleration: Array) -> Array:
        """Return the force along a joint, (N,), for a distance (N,) from its spring's rest."""
        moving = self.friction(speed) + self.inertia * acceleration
        return moving + self.stiffness * stretch + self.offset

    def springs(self, position: Array) -> Array:
        """Return the force of springs without a stated rest, at positions (N,) of the file."""
        k, pull, sine, cosine, constant = self.loose.values()
        swing = sine * np.sin(position) + cosine * np.cos(position)
        return k * position - pull + swing + constant


def left_out(robot: Robot) -> Strings:
    """Return nominal values of joints, motors, axes and loads that no simulation here has."""
    known = {"Fv", "Fc", "Fc+", "Fc-", "K", "off", *robot.inertia_parts, *INERTIAL_KINDS, *_SPRINGS}
    return tuple(n for n, x in robot.nominal.items() if x and n.rpartition(".")[2] not in known)


def stribeck(speed: Array, excess: float, velocity: float, shape: float = 1.0) -> Array:
    """Return the Stribeck excess ``(Fs - Fc) exp(-|q̇/vs|^δ) sign(q̇)`` [Olsson 1998], (N,).

    The paper prints the exponent without its minus sign and without sign(q̇) [Díaz 2010, Eq. 20].
    """
    decay = np.exp(-(np.abs(speed / velocity) ** shape))
    return excess * decay * np.sign(speed)


def joint_torque(
    robot: Robot, move: PrescribedMotion, rigid: RigidTorque, values: NumberByName
) -> Array:
    """Return torque of friction, rotors, springs and known curves at every joint and motor, (N, n).

    Raises
    ------
    RobotError
        If a joint moves where its known torque is not known.
    """
    tau = np.zeros_like(move.q)
    for axis in (*robot.axes, *robot.passive_axes):
        terms = JointTerms.of(values, axis.name, robot.inertia_parts)
        position, speed, acceleration, arms = _along(robot, axis, move, rigid)
        force = terms.force(position - rest_along(robot, axis), speed, acceleration)
        force += terms.springs(position)
        for known in robot.known_torque:
            if known.along == axis.name:
                force += known.force(position)
        tau += force[:, None] * arms
    return tau


def _along(robot: Robot, axis: Axis, move: PrescribedMotion, rigid: RigidTorque) -> list[Array]:
    """Return position, speed and acceleration (N,) along an axis, and its arms (N, n)."""
    own = (move.q, move.dq, move.ddq)
    passive = (rigid.passive_q, rigid.passive_v, rigid.passive_a)
    arms = np.zeros_like(move.q)
    motion = np.zeros((3, len(move.q)))
    for joint, c in axis.weights.items():
        if joint in robot.joints:
            k = robot.joints.index(joint)
            arms[:, k] += c
        else:
            k = robot.passive.index(joint)
            arms -= c * rigid.X[:, k]
        source = own if joint in robot.joints else passive
        motion += c * np.array([x[:, k] for x in source])
    return [*motion, arms]


# Effects that are in the data and not in the robot file: their names and their torque.
#
# Written as laws of the motion, apart from the columns in `effects`; size is a share of the
# joint's torque, so that one word describes a hidden effect on any robot.


#: Law of a hidden effect at one axis: (speed, position from home, load) -> force, up to a factor.
Law = Callable[[Array, Array, Array], Array]


def _typical(speed: Array) -> float:
    return float(np.sqrt(np.mean(speed**2))) or 1.0


def _from_end_to_end(position: Array) -> Array:
    """Return positions scaled to their range, from −1 to 1."""
    return 2 * (position - position.min()) / max(np.ptp(position), 1e-12) - 1


def _ripple(_speed: Array, position: Array, _load: Array) -> Array:
    phase = 16 * np.pi * (position - position.min())
    length = max(np.ptp(position), 1e-12)
    return np.sin(phase / length)


def _cable(_speed: Array, position: Array, _load: Array) -> Array:
    """Return the torque of a cable that bends at one end and pulls tight at the other."""
    along = _from_end_to_end(position)
    return np.exp(3 * (along - 1)) - 0.4 * np.tanh(3 * (along + 0.4))


def _dahl(_speed: Array, position: Array, _load: Array) -> Array:
    """Return friction that builds up over a fiftieth of the range after a reversal [Dahl 1968]."""
    way = max(float(np.ptp(position)) / 50, 1e-12)
    z = 0.0
    out = [0.0]
    for step in np.diff(position).tolist():
        z += (1.0 - z * np.sign(step)) * step / way
        out.append(min(max(z, -1.0), 1.0))
    return np.array(out)


def _uneven(speed: Array, position: Array, _load: Array) -> Array:
    """Return dry friction that is high at one end and low at the other, with a bump between."""
    along = _from_end_to_end(position)
    peak = np.exp(-8 * (along - 0.2) ** 2)
    return np.sign(speed) * (1.0 + along + peak)


def _play(speed: Array, position: Array, load: Array) -> Array:
    """Return the load that is not carried within 2 % of the range after each reversal."""
    since = np.zeros(len(position))
    way = 0.0
    steps = np.abs(np.diff(position, prepend=position[0]))
    for k, (step, turned) in enumerate(zip(steps, np.diff(np.sign(speed), prepend=0), strict=True)):
        way = 0.0 if turned else way + step
        since[k] = way
    # Of the range, as a belt or a cable has it.
    return -load * (since < 0.02 * np.ptp(position))


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

#: Effects that are hidden at passive joints, and at a pair of joints.
HIDDEN_PASSIVE = "passive_joint_friction"
HIDDEN_PAIR = "spring_over_two"

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


#: Pause between two motions [s]: no effect reaches from one to the next.
PAUSE: Tolerance = 10.0


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
    joints: Strings = ()
    law: Law | None = None


def hideable(laws: Iterable[str] = ()) -> list[str]:
    """Return the names of effects that can be hidden, those of further laws among them."""
    return [*HIDDEN, HIDDEN_PAIR, HIDDEN_PASSIVE, *HIDDEN_WHOLE, *laws]


def parse_hidden(text: str, laws: Mapping[str, Law] | None = None) -> Hidden:
    """Return the effect hidden by ``stribeck_friction``, ``…=0.1`` or ``…@slider1+slider3``.

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
        # Root mean square of a hidden effect relative to that of the torque of its joint.
        share = float(number) if given else 0.05
    except ValueError:
        share = -1.0
    if not 0 < share < np.inf:
        raise IdentifiabilityError(
            f"The size of the hidden effect '{text}' is not understood; give its share of the "
            "joint's torque, such as stribeck_friction=0.05."
        )
    listed = tuple(j for j in joints.split("+") if j)
    return Hidden(name, share, listed, own.get(name))


def scaled(force: Array, tau: Array, share: float) -> Array:
    """Return a force (N,) or (N, n) scaled to a share of the rms of a torque of that shape."""
    size = np.sqrt(np.mean(force**2))
    if not size > 0:
        return force
    return force * (share * np.sqrt(np.mean(tau**2)) / size)


def hidden_torque(
    robot: Robot, move: PrescribedMotion, rigid: RigidTorque, tau: Array, hidden: Hidden
) -> Array:
    """Return the torque of a hidden effect, scaled to a share of the torque, (N, n).

    Raises
    ------
    IdentifiabilityError
        If the effect or the joint is not in this robot.
    """
    if hidden.name == HIDDEN_PAIR:
        return _over_two(robot, move, tau, hidden)
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
            speed = move.dq[:, k]
            position = move.q[:, k] - home[k]
            force = law(speed, position, load)
        else:
            force = _record(move, tau, k, hidden.name)
        out[:, k] = scaled(force, tau[:, k], hidden.share)
    return out


def _chosen(names: Sequence[str], hidden: Hidden, robot: Robot) -> list[int]:
    for joint in hidden.joints:
        if joint not in names:
            raise IdentifiabilityError(
                f"{hidden.name} cannot be hidden in '{joint}' of {robot.name}"
                f"{near_match(joint, names)} It can be in {listing(names, things='joints')}."
            )
    return [k for k, name in enumerate(names) if not hidden.joints or name in hidden.joints]


def _record(move: PrescribedMotion, tau: Array, k: int, name: str) -> Array:
    """Return the torque error that a delayed, leaking or drifting record adds at joint k, (N,)."""
    seams = np.flatnonzero(np.diff(move.t) > 0.5 * PAUSE) + 1
    if name in ("time_delay", "clock_error"):
        parts = np.split(tau[:, k], seams)
        slope = np.concatenate([np.gradient(part) for part in parts])
        return slope if name == "clock_error" else -slope
    if name == "torque_scale":
        return tau[:, k]
    if name in ("torque_leak", "velocity_leak"):
        source = tau if name == "torque_leak" else move.dq
        return source[:, (k + 1) % tau.shape[1]]
    if name in ("torque_drift", "friction_drift"):
        since = np.concatenate([t - t[0] for t in np.split(move.t, seams)])
        if name == "torque_drift":
            return since - 0.4 * since.max()
        return since * move.dq[:, k]
    # Warm-up about a calibration in the middle: the drift has zero mean, so that it is no offset.
    time_constant = 0.5 * np.ptp(move.t) or 1.0
    drift = 1.0 - np.exp(-(move.t - move.t[0]) / time_constant)
    return drift - drift.mean()


def _over_two(robot: Robot, move: PrescribedMotion, tau: Array, hidden: Hidden) -> Array:
    """Return the torque of a spring along the sum of two positions, by default of the first two.

    Raises
    ------
    IdentifiabilityError
        If there are no two joints.
    """
    chosen = _chosen(robot.joints, hidden, robot)
    pair = chosen if hidden.joints else chosen[:2]
    if len(pair) != 2:
        raise IdentifiabilityError(
            f"{hidden.name} acts over two joints of {robot.name}; give two, as in "
            f"{hidden.name}@{'+'.join(robot.joints[:2])}=0.1."
        )
    home = robot.actuated_positions(robot.home[None])[0]
    out = np.zeros_like(tau)
    total = (move.q - home)[:, pair].sum(axis=1, keepdims=True)
    out[:, pair] = scaled(np.repeat(total, 2, axis=1), tau[:, pair], hidden.share)
    return out


def _passive(robot: Robot, rigid: RigidTorque, tau: Array, hidden: Hidden) -> Array:
    axes = robot.passive_axes
    if not axes:
        raise IdentifiabilityError(
            f"{robot.name} has no passive joints, so {hidden.name} cannot be hidden in it."
        )
    out = np.zeros_like(tau)
    for at in _chosen([a.name for a in axes], hidden, robot):
        k = robot.passive.index(axes[at].name)
        speed = rigid.passive_v[:, k]
        signs = np.sign(speed) + speed / _typical(speed)
        column = rigid.X[:, k]
        out -= signs[:, None] * column
    return scaled(out, tau, hidden.share)


def _whole(
    robot: Robot, move: PrescribedMotion, rigid: RigidTorque, tau: Array, hidden: Hidden
) -> Array:
    """Return the difference that a tilted base or a load at the tip makes to MuJoCo's torque."""
    other = MujocoRobot(robot)
    if hidden.name == "gravity_tilt":
        g = np.array(other.model.opt.gravity)
        # Angle [rad] and mass [kg] of effects of the whole robot before they are scaled.
        across = np.cross([0.6, 0.8, 0.0], g)
        other.model.opt.gravity[:] = g + 1e-3 * across
    else:
        tip = np.flatnonzero(other.model.body_weldid)[-1]  # the last body that moves
        # Angle [rad] and mass [kg] of effects of the whole robot before they are scaled.
        other.model.body_mass[tip] += 0.1
    changed = other.inverse_dynamics(move.q, move.dq, move.ddq)
    return scaled(changed.tau - rigid.tau, tau, hidden.share)
