"""Torque of which nothing is known but what it depends on: the nonparametric effects.

Smooth functions of position, speed, load, time, another joint's speed, and of two of them
together.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np
import scipy

from identifiability.effects.effect import POSTURES, SPEEDS, Along, Shaped, Span, actuated_joints
from identifiability.effects.measurement import (
    FromJoint,
    first_origin,
    is_alone,
    nominal_torque,
    other_joints,
)
from identifiability.effects.nominal import needs_masses, rigid_torque
from identifiability.effects.registry import declare
from identifiability.effects.transmission import carried_load
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.robot import Axis, Motion, Robot

# Torque along a joint of which nothing is known but what it depends on: smooth functions.
#
# A diagnosis asks for them where no name explains what is left, and says that they have none.


#: Degree of the pieces, and how many there are: alone, and of what goes with the velocity.
DEGREE, PIECES, PIECES_OF_TWO = 2, 4, 3
#: Speed that motions are taken to reach where no limit is stated [rad/s, m/s].
TYPICAL_SPEED: tuple[Tolerance, Tolerance] = (2.0, 0.3)
#: What every function contains: its splines add up to one.
CONTAINED = ("torque_offset",)


def splines(u: Array, pieces: int = PIECES) -> Array:
    """Return quadratic B-splines of u (N,) between −1 and 1, (N, pieces + 2).

    Beyond its ends, where there were no data, they return to zero.
    """
    step, beyond = 2.0 / pieces, 2 * DEGREE
    knots = -1.0 + step * np.arange(-beyond, pieces + beyond + 1)
    end = 1.0 + DEGREE * step
    every = scipy.interpolate.BSpline.design_matrix(np.clip(u, -end, end), knots, DEGREE)
    found: Array = every[:, DEGREE : DEGREE + pieces + DEGREE].toarray()
    return found


def straight_beyond(u: Array, pieces: int = PIECES) -> Array:
    """Return the same splines of u (N,), which beyond their ends go straight on, (N, pieces + 2).

    At an end the slope of a curve is the difference of its two last values over a step.
    """
    found = splines(np.clip(u, -1.0, 1.0), pieces)
    over = (np.abs(u) - 1.0).clip(min=0.0) * (pieces / 2.0)
    for end, before, here in ((-1, -2, u > 0), (0, 1, u < 0)):
        found[here, end] += over[here]
        found[here, before] -= over[here]
    return found


def fine_at_rest(speed: Array, largest: float) -> Array:
    """Return the root of speeds (N,) over the largest one: friction changes most at rest.

    Beyond the largest one it goes straight on, as splines do that are `straight_beyond`.
    """
    share = np.abs(speed) / largest
    found: Array = np.sign(speed) * np.where(share < 1.0, np.sqrt(share), 0.5 * (1.0 + share))
    return found


def largest_speed(robot: Robot, axis: Axis) -> float:
    """Return the speed that an axis is taken to reach [rad/s or m/s]."""
    if axis.row is None:
        return TYPICAL_SPEED[axis.prismatic]
    used = axis.row != 0
    limit = float(np.abs(axis.row[used]) @ robot.speed_limits[used])
    return limit if np.isfinite(limit) and limit > 0 else TYPICAL_SPEED[axis.prismatic]


class SmoothFunction(Shaped):
    """``τ = f(u)``: quadratic splines of a coordinate from −1 to 1; a constant is one of them."""

    equation = "τ = f(u), f = Σ cₖ Bₖ"
    source = "[de Boor 1978; Eilers & Marx 1996]"
    supersedes = CONTAINED
    units: tuple[tuple[str, str, str], ...] = (("f", "N·m", "N"),)
    #: Columns at each axis.
    count = PIECES + DEGREE

    @abstractmethod
    def coordinate(self, at: Along) -> Array:
        """Return the coordinate, (N,)."""

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return one for every column."""
        del robot, axis
        return tuple(f"{self.units[0][0]}{k + 1}" for k in range(self.count))

    def curves(self, at: Along) -> list[Array]:
        """Return the splines."""
        return list(splines(self.coordinate(at)).T)


class WithVelocity(SmoothFunction):
    """``τ = f₀(u) + f₁(u) sign q̇ + f₂(u) q̇``: splines of a coordinate, each for itself."""

    count = 3 * (PIECES_OF_TWO + DEGREE)

    def curves(self, at: Along) -> list[Array]:
        """Return the splines, alone and times direction and speed."""
        columns, speed = splines(self.coordinate(at), PIECES_OF_TWO), at.speed[:, None]
        largest = largest_speed(at.robot, at.axis)
        return [*columns.T, *(columns * at.sign[:, None]).T, *(columns * speed / largest).T]


def fastest(span: Span) -> tuple[float, ...]:
    """Return the largest speed of the motions at an axis [rad/s or m/s]."""
    return (span.largest_speed,)


# Torque that depends on the position in a way that has no name here.


def farthest(span: Span) -> tuple[float, ...]:
    """Return the largest distance of the motions from home [rad or m]."""
    return (span.farthest,)


@declare(
    "an unnamed function of position",
    shapes=farthest,
    against="position",
    unnamed=True,
    flexible=True,
    told_by=POSTURES,
    rank=32,
)
class FunctionOfPosition(SmoothFunction):
    """``τ = f(q)``. Its shape is the largest distance from home [rad or m]."""

    name = "function_of_position"
    equation = "τ = f(q), f = Σ cₖ Bₖ(q)"
    units = (("fq", "N·m", "N"),)
    usual = (3.0, 0.5)

    def coordinate(self, at: Along) -> Array:
        """Return the position from home over the largest one."""
        return at.travel / self.shape(at.robot, at.axis)


# Torque that depends on the speed in a way that has no name here.


@declare(
    "an unnamed function of velocity",
    shapes=fastest,
    separate=True,
    unnamed=True,
    flexible=True,
    told_by=SPEEDS,
    rank=30,
)
class FunctionOfVelocity(SmoothFunction):
    """``τ = f(q̇)``, smooth in the root of the speed but for a step at rest.

    Viscous and Coulomb friction and an offset are among its curves, which are odd functions,
    against the motion, or even ones, or both. Its shape is the largest speed, beyond which it
    returns to a constant.
    """

    name = "function_of_velocity"
    equation = "τ = f(q̇), f = Σ cₖ (Bₖ(u) ∓ Bₖ(−u)) + c sign q̇, u = √|q̇/v| sign q̇"
    units = (("fo", "N·m", "N"), ("fe", "N·m", "N"))
    count = PIECES + DEGREE + 1

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return one for every odd column, then for every even one."""
        del robot, axis
        even = self.count // 2
        return tuple(
            f"{letter}{k + 1}"
            for (letter, _, _), count in zip(self.units, (self.count - even, even), strict=True)
            for k in range(count)
        )

    def coordinate(self, at: Along) -> Array:
        """Return the root of the speed."""
        return fine_at_rest(at.speed, self.shape(at.robot, at.axis))

    def curves(self, at: Along) -> list[Array]:
        """Return the step with differences of opposite splines, then their sums."""
        pieces = splines(self.coordinate(at)).T
        low, high = pieces[: len(pieces) // 2], pieces[: len(pieces) // 2 - 1 : -1]
        return [np.sign(at.speed), *(high - low), *(high + low)]

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return the limit of the speed [rad/s or m/s]."""
        return largest_speed(robot, axis)


# Torque that depends on the load in a way that has no name here.


def load_of(robot: Robot, motion: Motion) -> Array:
    """Return the load of the joints, (N, n): all torque of the model where its values are known.

    Of the file it is that of the masses: files seldom state friction and rotors.
    """
    return (nominal_torque if robot.reference else rigid_torque)(robot, motion)


def largest_load(span: Span) -> tuple[float, ...]:
    """Return the largest load of the motions at an axis [N·m or N]."""
    if span.robot is None:
        return ()
    axis = next(a for a in span.robot.axes if a.name == span.joint)
    loads = [carried_load(load_of(span.robot, m), Along(span.robot, m, axis)) for m in span.motions]
    return (max(float(np.abs(x).max(initial=0.0)) for x in loads) or 1.0,)


class OfLoad(SmoothFunction):
    """A function of the load; its shape is the largest one [N·m or N]."""

    usual = (10.0, 100.0)

    def coordinate(self, at: Along) -> Array:
        """Return the load over the largest one."""
        load = carried_load(load_of(at.robot, at.motion), at)
        return load / self.shape(at.robot, at.axis)


@declare(
    "an unnamed function of the load",
    shapes=largest_load,
    refuse=needs_masses,
    against="load",
    loaded=True,
    unnamed=True,
    flexible=True,
    told_by="move with and without a load",
    rank=31,
)
class FunctionOfLoad(OfLoad):
    """``τ = f(τ_load)`` of the load by `load_of`. Its shape is the largest one."""

    name = "function_of_load"
    equation = "τ = f(τ_load), f = Σ cₖ Bₖ(τ_load)"
    units = (("fl", "N·m", "N"),)


# Torque that depends on the time in a way that has no name here.


#: Duration where none is given [s].
TYPICAL: Tolerance = 30.0


def duration(span: Span) -> tuple[float, ...]:
    """Return the end of the time of the longest log [s]."""
    return (max((float(m.t.max(initial=0.0)) for m in span.motions), default=0.0) or TYPICAL,)


@declare(
    "an unnamed function of time",
    shapes=duration,
    against="time",
    unnamed=True,
    flexible=True,
    told_by="repeat the motion later",
    rank=34,
)
class FunctionOfTime(SmoothFunction):
    """``τ = f(t)`` of the time of each log. Its shape is the end of the time [s]."""

    name = "function_of_time"
    equation = "τ = f(t), f = Σ cₖ Bₖ(t)"
    units = (("ft", "N·m", "N"),)
    usual = (TYPICAL, TYPICAL)

    def coordinate(self, at: Along) -> Array:
        """Return the time, from −1 to 1."""
        return 2.0 * at.motion.t / self.shape(at.robot, at.axis) - 1.0


# Torque that depends on the time of the session in a way that has no name here.


#: Pieces of the session, of which each takes several logs: one that is left out leaves no hole.
SESSION_PIECES = 2
#: Logs of which one may be left out.
FEWEST = 3
#: Duration where none is given [s].
TYPICAL_SESSION: Tolerance = 600.0


def time_of_session(motion: Motion) -> Array:
    """Return the time since the session began, (N,) [s]; that of the log where none is known."""
    return motion.t if motion.start is None else motion.t + motion.start


def has_session(motions: Sequence[Motion]) -> bool:
    """Whether motions share a clock that says more than the time within each.

    That is where logs say when they began, and so many that one may be left out: two must be left
    to say how it goes on.
    """
    starts = {m.start for m in motions}
    return len(starts) >= FEWEST and None not in starts


def end_of_session(span: Span) -> tuple[float, ...]:
    """Return the end of the time of the fitted session [s]; nothing where logs share no clock."""
    if not has_session(span.motions):
        return ()
    return (
        max(float(time_of_session(m).max(initial=0.0)) for m in span.motions) or TYPICAL_SESSION,
    )


@declare(
    "an unnamed function of the time of the session",
    shapes=end_of_session,
    against="session",
    unnamed=True,
    flexible=True,
    told_by="log the same motion later in the session",
    rank=34.5,
)
class FunctionOfSessionTime(SmoothFunction):
    """``τ = f(T)`` of the time since the first log of a session began: warming up, for one.

    Its shape is the end of that time [s]. Logs are pieces of a session with pauses between, of
    which the last is seldom fitted: so the function is held to a straight line as closely as the
    motion says, and goes straight on beyond its end.
    """

    name = "function_of_session_time"
    equation = "τ = f(T), f = Σ cₖ Bₖ(T)"
    units = (("fT", "N·m", "N"),)
    usual = (TYPICAL_SESSION, TYPICAL_SESSION)
    count = SESSION_PIECES + DEGREE

    def coordinate(self, at: Along) -> Array:
        """Return the time of the session, from −1 to 1."""
        return 2.0 * time_of_session(at.motion) / self.shape(at.robot, at.axis) - 1.0

    def curves(self, at: Along) -> list[Array]:
        """Return the splines."""
        return list(straight_beyond(self.coordinate(at), SESSION_PIECES).T)


# Torque that depends on the speed of another joint in a way that has no name here.


@declare(
    "an unnamed function of another joint's velocity",
    actuated_joints,
    shapes=other_joints,
    origin=first_origin,
    refuse=is_alone,
    unnamed=True,
    flexible=True,
    told_by="move one joint while the others stand still",
    rank=33,
)
class FunctionOfOtherVelocity(FromJoint):
    """``τ = f(q̇_other)``, smooth in the root of the speed up to its limit.

    Its shape is the number of the joint whose speed it is.
    """

    name = "function_of_other_velocity"
    equation = "τ = f(q̇_other), f = Σ cₖ Bₖ(√|q̇_other/v| sign q̇_other)"
    source = "[de Boor 1978; Eilers & Marx 1996]"
    units = (("f", "N·m", "N"),)
    crossed = ("N·m", "N")
    supersedes = CONTAINED

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return one for every spline, with the joint that it comes from."""
        (kind,) = super().kinds(robot, axis)
        return tuple(f"{kind}_{k + 1}" for k in range(PIECES + DEGREE))

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the splines of every joint."""
        width = PIECES + DEGREE
        for k, axis in enumerate(self.axes(robot)):
            other = self.origin(robot, axis)
            source = next(a for a in robot.axes if a.name == robot.joints[other])
            share = fine_at_rest(motion.actuated_v[:, other], largest_speed(robot, source))
            columns = splines(np.clip(share, -1.0, 1.0))  # the limit is no end of the data
            at = robot.joints.index(axis.name)
            out[:, at, k * width : (k + 1) * width] = columns


# Torque that depends on position and speed in a way that has no name here.


@declare(
    "an unnamed function of position and velocity",
    shapes=farthest,
    against="position",
    unnamed=True,
    flexible=True,
    told_by=SPEEDS,
    rank=35,
)
class FunctionOfPositionAndVelocity(WithVelocity, FunctionOfPosition):
    """``τ = f(q, q̇)``. Its shape is the largest distance from home [rad or m]."""

    name = "function_of_position_and_velocity"
    equation = "τ = f₀(q) + f₁(q) sign(q̇) + f₂(q) q̇, f = Σ cₖ Bₖ"
    units = (("fqv", "N·m", "N"),)


# Torque that depends on speed and load in a way that has no name here.


@declare(
    "an unnamed function of velocity and load",
    shapes=largest_load,
    refuse=needs_masses,
    loaded=True,
    unnamed=True,
    flexible=True,
    told_by="move with and without a load",
    rank=36,
)
class FunctionOfVelocityAndLoad(WithVelocity, OfLoad):
    """``τ = f(q̇, τ_load)``. Its shape is the largest load [N·m or N]."""

    name = "function_of_velocity_and_load"
    equation = "τ = f₀(τ_load) + f₁(τ_load) sign(q̇) + f₂(τ_load) q̇, f = Σ cₖ Bₖ"
    units = (("fvl", "N·m", "N"),)


# Torque that depends on the speed in a way that changes with time and has no name here.


@declare(
    "an unnamed function of velocity and time",
    shapes=duration,
    against="time",
    unnamed=True,
    flexible=True,
    told_by="repeat the motion later",
    rank=37,
)
class FunctionOfVelocityAndTime(WithVelocity, FunctionOfTime):
    """``τ = f(q̇, t)``, t the time of each log. Its shape is the end of the time [s]."""

    name = "function_of_velocity_and_time"
    equation = "τ = f₀(t) + f₁(t) sign(q̇) + f₂(t) q̇, f = Σ cₖ Bₖ"
    units = (("fvt", "N·m", "N"),)
