"""Errors of measurement: torque that is offset, late, scaled or leaks, and positions."""

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from identifiability.foundation.errors import ModelError
from identifiability.foundation.linalg import without_rounding
from identifiability.foundation.names import Array, NumberByName, Parameter, Strings
from identifiability.robot import Axis, Motion, Robot

from .effect import (
    POSTURES,
    RESTS,
    Along,
    AlongAxes,
    Effect,
    Shaped,
    Span,
    actuated_joints,
    in_motor,
)
from .friction import CoulombAsymmetry, CoulombFriction, ViscousFriction
from .inertia import ActuatorInertia
from .nominal import needs_masses, once, position_slopes, reference_values, rigid_torque
from .registry import declare
from .springs import FreeSpring, GravitySpring, JointStiffness


class AtMotors(AlongAxes):
    """An effect of every actuated joint: one axis each, without the motors that mix them."""

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return those of joints."""
        return robot.axes[: len(robot.motor_joints)]


# A constant torque at every actuated joint.


@declare(
    "torque offset",
    actuated_joints,
    refuse=in_motor,
    native=True,
    told_by=RESTS,
)
class TorqueOffset(AtMotors):
    """A constant torque: sensor bias or current offset."""

    name = "torque_offset"
    equation = "τ = off"
    units: tuple[tuple[str, str, str], ...] = (("off", "N·m", "N"),)
    stated_as: Strings = ("offset",)

    def curves(self, at: Along) -> list[Array]:
        """Return one everywhere."""
        return [at.ones]


# A torque that drifts with time: a sensor or an amplifier that warms up.


@declare(
    "a drift of the torque",
    actuated_joints,
    refuse=in_motor,
    against="time",
    told_by="repeat the motion later",
)
class TorqueDrift(TorqueOffset):
    """``τ = o + d t``: an offset that changes at a steady rate in every log.

    It contains `torque_offset`.
    """

    name = "torque_drift"
    equation = "τ = o + d t"
    source = "a slow change to the first order in time"
    units = (("o", "N·m", "N"), ("d", "N·m/s", "N/s"))
    stated_as = ()
    supersedes = ("torque_offset",)

    def curves(self, at: Along) -> list[Array]:
        """Return a constant and the time since the first row of the log."""
        return [at.ones, at.motion.elapsed]


# Torque that is recorded later than the motion it belongs to.


def motors(robot: Robot) -> range:
    """Return which actuated joints motors drive: those of a floating base come first."""
    return range(len(robot.joints) - len(robot.motor_joints), len(robot.joints))


@once
def nominal_torque(robot: Robot, motion: Motion) -> Array:
    """Return the torque by all values that the robot file states, (N, n)."""
    stated = any(k.endswith(".Fc+") for k in reference_values(robot))
    dry = _stated_torque(robot, motion, CoulombAsymmetry() if stated else CoulombFriction())
    return smooth_torque(robot, motion) + dry


@once
def smooth_torque(robot: Robot, motion: Motion) -> Array:
    """Return the same without dry friction, (N, n).

    A slope cannot describe how dry friction turns within a sample, least of all with a file's
    levels.
    """
    effects = ViscousFriction(), ActuatorInertia(), JointStiffness(), FreeSpring(), GravitySpring()
    return sum((_stated_torque(robot, motion, e) for e in effects), rigid_torque(robot, motion))


def _stated_torque(robot: Robot, motion: Motion, effect: Effect) -> Array:
    parameters = effect.parameters(robot)
    known = reference_values(robot)
    values = np.array([known.get(p.name, 0.0) for p in parameters])
    W = np.zeros((len(motion), len(robot.joints), len(values)))
    if values.any():
        effect.fill(robot, motion, W)
    return W @ values


@declare(
    "a delay of the torque",
    actuated_joints,
    refuse=needs_masses,
    logs="torque",
    loaded=True,
    native=True,
)
class TimeDelay(AtMotors):
    """``τ_measured(t) = τ(t − δ) ≈ τ − δ dτ/dt``: torque and motion are not sampled together.

    Linearised in the delay, which must be small relative to the period of the fastest motion. The
    torque that is differentiated is a model's, never the measured one, whose noise would enter the
    column. It looks like actuator inertia and viscous friction at one frequency of motion. A delay
    is never negative: torque that comes before its motion is a `clock_error`.
    """

    name = "time_delay"
    equation = "τ = −δ dτ/dt"
    source = "[Ljung 1999, Sec. 4.2]"
    units = (("delay", "s", "s"),)
    nonnegative = True

    anywhere = False

    def curves(self, at: Along) -> list[Array]:
        """Return minus the slope of the torque, with the scale of the measured one."""
        gain = 1.0 + reference_values(at.robot).get(f"{at.axis.name}.scale", 0.0)
        return [-gain * at.slope(smooth_torque(at.robot, at.motion)[:, at.joint])]


# Torque that is stamped before the motion it belongs to.


@declare(
    "an error of clocks (torque stamped before its motion)",
    actuated_joints,
    refuse=needs_masses,
    logs="torque",
    loaded=True,
    native=True,
)
class ClockError(TimeDelay):
    """``τ_measured(t) = τ(t + ε)``: no torque follows a motion before it happens.

    It acts as a negative `time_delay` would: the motion is stamped late, or filtered.
    """

    name = "clock_error"
    equation = "τ = ε dτ/dt"
    units = (("lead", "s", "s"),)

    def curves(self, at: Along) -> list[Array]:
        """Return the curve of a delay, with the other sign."""
        return [-column for column in super().curves(at)]


# A joint whose servo takes its commands later than those of the others.


def _needs_servos(robot: Robot, place: str) -> str:
    if robot.servo is None:
        return "the robot has no servos that take commands"
    return in_motor(robot, place) or needs_masses(robot, place)


@declare(
    "commands that act earlier or later than was found",
    actuated_joints,
    refuse=_needs_servos,
    logs="commands",
    loaded=True,
    native=True,
)
class CommandDelay(TimeDelay):
    """``τ(q_cmd(t)) = τ + δ (dτ/dt + kp q̇ + kv q̈)``: the servo of a joint acts δ later.

    Later than is taken of all joints of a log, or earlier where δ is negative. A servo makes the
    torque of a command by kp q_cmd = τ + kp q + kv q̇. So most of a delay looks like viscous
    friction and inertia; these are no longer wrong with it.
    """

    name = "command_delay"
    equation = "τ = δ (dτ/dt + kp q̇ + kv q̈)"
    units = (("late", "s", "s"),)
    nonnegative = False

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return the axes of the joints of a robot with servos."""
        if robot.servo is None:
            return ()
        return super().axes(robot)

    def curves(self, at: Along) -> list[Array]:
        """Return the change of the servo's torque by a later command."""
        servo = at.robot.servo
        j = at.joint
        assert servo is not None
        (early,) = super().curves(at)
        v = at.motion.actuated_v[:, j]
        a = at.motion.actuated_a[:, j]
        return [servo.kp[j] * v + servo.kv[j] * a - early]


# A joint whose torque is measured in wrong units: a gain that is off.


def _needs_stated_gain(robot: Robot, place: str) -> str:
    """Return why logs cannot show a wrong scale of the torque; empty if they can."""
    if robot.servo is not None and place in robot.joints:
        *_, log_kp = np.split(robot.servo.doubt.reshape(-1, 3 * len(robot.joints)), 3, axis=1)
        # A change of all gains alike leaves their ratios as they are stated.
        of_one = log_kp[np.ptp(log_kp, axis=1) > 0, robot.joints.index(place)]
        if of_one.any():
            return "the logs determine the gain of its servo, and so this scale"
    return needs_masses(robot, place)


def torque_shares(robot: Robot) -> dict[str, tuple[str, Array]]:
    """Return each torque column and its weights (n,) of joint torques, by the axis that it loads.

    Columns are those of motors where these mix joints and the sidecar states gains of them, each
    with one motor a joint; else those of joints.
    """
    names, gear = robot.motor_joints, robot.transmission
    joints = np.eye(len(robot.joints))[len(robot.joints) - len(names) :]
    of_joints = {name: (name, x) for name, x in zip(names, joints, strict=True)}
    if gear is None or len(gear.motors) != len(names):
        return of_joints
    if robot.torque.table("gain").keys().isdisjoint(gear.motors):
        return of_joints
    shares = {}
    every = np.linalg.inv(gear.coupling).T @ joints
    for motor, row, weights in zip(gear.motors, gear.coupling, every, strict=True):
        moved = np.flatnonzero(row)
        if len(moved) > 1:
            shares[motor] = motor, weights
        else:
            shares[names[moved[0]]] = motor, row.sum() * weights
    return shares


@declare(
    "a wrong scale of the torque",
    lambda robot: tuple(torque_shares(robot)),
    refuse=_needs_stated_gain,
    against="load",
    loaded=True,
    told_by=POSTURES,
)
class TorqueScale(AlongAxes):
    """``τ = s τ``: the torque of one motor is s too large, as by a wrong constant.

    The torque is that of the fitted values. One scale of all joints is a scale of all masses; only
    differences between joints are identifiable. A motor that mixes joints has a scale where the
    sidecar states its gain.
    """

    name = "torque_scale"
    equation = "τ_measured = (1 + s) τ"
    source = "[Gautier & Briot 2014]"
    units = (("scale", "1", "1"),)

    anywhere = False

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return those of torque columns."""
        shares = torque_shares(robot)
        return [axis for axis in robot.axes if axis.name in shares]

    def curves(self, at: Along) -> list[Array]:
        """Return the torque of the joint or motor."""
        _, weights = torque_shares(at.robot)[at.axis.name]
        return [nominal_torque(at.robot, at.motion) @ weights]


def without_scales(robot: Robot, values: NumberByName) -> Array:
    """Return the factors (n, n) that torque of wrong scales, (N, n), is right by."""
    measured = np.eye(len(robot.joints))
    for axis in robot.axes:
        scale = values.get(f"{axis.name}.scale")
        if scale and axis.row is not None:
            measured += scale * np.outer(axis.row, torque_shares(robot)[axis.name][1])
    return np.linalg.inv(measured).T


# Torque of another joint that leaks into the measured torque of this one.


def other_joints(span: Span) -> tuple[float, ...]:
    """Return the numbers of all joints but this one, from one on."""
    every = span.robot.joints
    driven = {*span.robot.motor_joints} - {span.joint}
    return tuple(float(k) for k, name in enumerate(every, 1) if name in driven)


def is_alone(robot: Robot, _place: str) -> str:
    """Return that there is no other joint, if so."""
    if len(robot.motor_joints) > 1:
        return ""
    return "there is no other joint"


def _refuse(robot: Robot, place: str) -> str:
    return is_alone(robot, place) or needs_masses(robot, place)


class FromJoint(Shaped):
    """An effect of another joint on this one.

    The shape is the number of that joint, counted from one.
    """

    #: Units at an axis that turns from one that slides, and the other way round.
    crossed: ClassVar[tuple[str, str]] = ("m", "1/m")
    anywhere = False

    def axes(self, robot: Robot) -> list[Axis]:
        """Return the axes of joints, without the motors that mix them."""
        own = robot.motor_joints if len(robot.motor_joints) > 1 else ()
        return [a for a in super().axes(robot) if a.name in own]

    def kinds(self, robot: Robot, axis: Axis) -> Strings:
        """Return one kind, whose name states the other joint."""
        return (f"{self.units[0][0]}_{robot.joints[self.origin(robot, axis)]}",)

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return one for every joint, in the unit between the two."""
        crossed = {}
        for axis in self.axes(robot):
            if axis.prismatic != robot.slides[self.origin(robot, axis)]:
                crossed[axis.name] = self.crossed[axis.prismatic]
        every = super().parameters(robot)
        return tuple(replace(p, unit=crossed[p.owner]) if p.owner in crossed else p for p in every)

    def origin(self, robot: Robot, axis: Axis) -> int:
        """Return the index of the joint that it comes from.

        Raises
        ------
        ModelError
            If there is none of that number, or it is this one.
        """
        number = self.shape(robot, axis)
        names = robot.joints
        first = motors(robot).start + 1
        last = len(names)
        if number not in range(first, last + 1) or names[int(number) - 1] == axis.name:
            raise ModelError(
                f"{self.name} at '{axis.name}' comes from joint {number:g}; give the number of "
                f"another joint, from {first} to {last}."
            )
        return int(number) - 1

    def drawn_over(self, robot: Robot, joint: int) -> int:
        """Return the joint that an effect at one joint comes from."""
        del joint
        return self.origin(robot, self.axes(robot)[0])

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return the number of the joint before, of the second one at the first."""
        own = robot.joints.index(axis.name)
        first = motors(robot).start
        return float(own if own > first else first + 2)


@declare(
    "torque leaking from another joint",
    actuated_joints,
    shapes=other_joints,
    refuse=_refuse,
    against="load",
    needs="coulomb_friction",
    loaded=True,
    told_by="move both joints at once, and each while the other stands still",
)
class TorqueLeak(FromJoint):
    """``τ = c τ_other``: cross-talk of sensors and currents, cables that run through a joint.

    The leaking torque is computed from the robot file's values, because a measured one would bring
    its noise into the column. So it lacks friction and rotor of the other joint's motor. While that
    joint stands, its weight is constant, and the leak looks like a torque offset. A screw, belt or
    gear that couples two joints is no leak: state it as ``[transmission]``. Its shape is the number
    of the joint that it comes from.
    """

    name = "torque_leak"
    equation = "τ = c τ_other"
    source = "drive gains [Gautier & Briot 2014] off the diagonal"
    units = (("from", "1", "1"),)

    def curves(self, at: Along) -> list[Array]:
        """Return the torque of the other joint."""
        return [nominal_torque(at.robot, at.motion)[:, self.origin(at.robot, at.axis)]]


# Torque in proportion to the speed of another joint.


@declare(
    "drag by the speed of another joint",
    actuated_joints,
    shapes=other_joints,
    refuse=is_alone,
    needs="viscous_friction",
    told_by="move one joint while the others stand still",
)
class VelocityLeak(FromJoint):
    """``τ = c q̇_other``: coupled drives, hoses, induced voltage.

    Its shape is the number of the joint whose speed it is.
    """

    name = "velocity_leak"
    equation = "τ = c q̇_other"
    source = "viscous friction [Khalil 2002, Sec. 9.3.4] between joints"
    units = (("by", "N·m·s/rad", "N·s/m"),)
    crossed = ("N·s", "N·s/rad")

    def curves(self, at: Along) -> list[Array]:
        """Return the speed of the other joint."""
        return [at.motion.actuated_v[:, self.origin(at.robot, at.axis)]]


# Positions that are counted from elsewhere than the robot file counts them.


def _stands_in_a_tree(robot: Robot, place: str) -> str:
    if robot.closed:
        return "a loop moves with it, so that a wrong zero is its geometry's: calibrate finds it"
    return in_motor(robot, place) or needs_masses(robot, place)


@declare(
    "a wrong zero of an encoder",
    actuated_joints,
    against="position",
    refuse=_stands_in_a_tree,
    loaded=True,
    told_by=POSTURES,
)
class EncoderBias(AtMotors):
    """``τ = −b ∂τ/∂q``: both the position of a joint and its command are measured b too large.

    The servo holds the measured position, so its torque is right. The torque of every other joint
    is assigned to a wrong configuration. Linear in b; where the bias is known, the column follows
    it over its whole size, with the fitted masses. It has no effect where the joint's axis is along
    gravity and the first of its tree; of any other first joint it is a tilt of the base about its
    axis; at the last body it looks like first moments that are turned about its axis. The sidecar
    states it as an offset of ``[columns]``.
    """

    name = "encoder_bias"
    equation = "τ = −b ∂τ/∂q"
    source = "derivatives of inverse dynamics [Carpentier & Mansard 2018]"
    units = (("bias", "rad", "m"),)

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return the axes of the joints of a tree."""
        return () if robot.closed else super().axes(robot)

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write minus the derivative of torque with respect to each position."""
        if not out.shape[2]:
            return
        rigid = rigid_torque(robot, motion)
        slopes = dict(enumerate(position_slopes(robot, motion)))
        for k, joint in enumerate(motors(robot)):
            at = robot.actuated[joint]
            slope = slopes.get(at, np.zeros(rigid.shape))  # a tendon carries no body
            way = robot.reference.get(f"{robot.joints[joint]}.bias", 0.0)
            if way:  # along the whole of it, which need not be small
                q = motion.q - way * (np.arange(motion.q.shape[1]) == at)
                slope = (rigid - rigid_torque(robot, replace(motion, q=q))) / way
            out[:, :, k] = -without_rounding(slope, rigid)
