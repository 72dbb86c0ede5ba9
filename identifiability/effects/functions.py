"""Torque as an unknown function of known coordinates: the nonparametric effects.

Smooth functions of position, speed, load, time, another joint's speed, and of two of them
together.
"""

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any, Literal

import numpy as np

from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.robot import Axis, Motion, Robot

from .effect import POSTURES, SPEEDS, Along, Family, Shaped, Span, actuated_joints, counted
from .measurement import FromJoint, is_alone, other_joints
from .nominal import needs_masses
from .registry import declare, register
from .transmission import rigid_load

# Torque along a joint as an unknown function of a known coordinate: smooth functions.
#
# A diagnosis tries them where no named effect explains the residual, and reports them as unnamed.


#: Degree of the pieces, and their number: alone, and with the velocity.
DEGREE, PIECES, PIECES_OF_TWO = 2, 4, 3
#: Speed that motions are taken to reach where no limit is stated [rad/s, m/s].
TYPICAL_SPEED: tuple[Tolerance, Tolerance] = (2.0, 0.3)
#: Effects that every function contains: its splines add up to one.
CONTAINED = ("torque_offset",)


def splines(u: Array, pieces: int = PIECES) -> Array:
    """Return quadratic B-splines of u (N,) between −1 and 1, (N, pieces + 2).

    Beyond its ends, where there were no data, they return to zero.
    """
    step = 2.0 / pieces
    centres = -1.0 + step * (np.arange(pieces + DEGREE) - 0.5)
    distance = np.abs(u[:, None] - centres) / step
    inner = 0.75 - distance**2
    outer = 0.5 * (1.5 - distance).clip(min=0.0) ** 2
    return np.where(distance < 0.5, inner, outer)


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
    return np.sign(speed) * np.where(
        share < 1.0,
        np.sqrt(share),
        0.5 * (1.0 + share),
    )


def largest_speed(robot: Robot, axis: Axis) -> float:
    """Return the speed that an axis is taken to reach [rad/s or m/s]."""
    if axis.row is None:
        return TYPICAL_SPEED[axis.prismatic]
    used = axis.row != 0
    limit = float(np.abs(axis.row[used]) @ robot.speed_limits[used])
    if np.isfinite(limit) and limit > 0:
        return limit
    return TYPICAL_SPEED[axis.prismatic]


#: Where these functions are from.
SOURCE = "[de Boor 1978; Eilers & Marx 1996]"

#: Along an axis, (N,).
Value = Callable[[Along], Array]


@frozen
class Coordinate:
    """A coordinate on which a torque may depend.

    Attributes
    ----------
    symbol, title : str
        In equations and in words.
    against
        As of `Family`.
    value : callable(Along) -> (N,)
    shapes : callable(Span) -> shapes
        The largest value of the motions, at which a function ends; nothing where it is not asked.
    usual : (float, float)
        That where none is stated, at an axis that turns and at one that slides.
    """

    symbol: str
    title: str
    against: Literal["position", "load", "time", "session"]
    value: Value
    shapes: Callable[[Span], tuple[float, ...]]
    usual: tuple[float, float]


# Coordinates of torque without a named effect here.


def largest_load(span: Span) -> tuple[float, ...]:
    """Return the largest load of the motions at an axis [N·m or N]."""
    axis = next(a for a in span.robot.axes if a.name == span.joint)
    loads = [rigid_load(Along(span.robot, m, axis)) for m in span.motions]
    largest = [float(np.abs(x).max(initial=0.0)) for x in loads]
    return (max(largest) or 1.0,)


#: Duration where none is given [s].
TYPICAL = 4 * DEFAULTS.period


def duration(span: Span) -> tuple[float, ...]:
    """Return the duration of the longest log [s]."""
    lengths = (float(m.elapsed.max(initial=0.0)) for m in span.motions)
    return (max(lengths, default=0.0) or TYPICAL,)


#: Pieces of the session, of which each takes several logs: one that is left out leaves no hole.
SESSION_PIECES = 2
#: Logs of which one may be left out.
FEWEST = 3


def time_of_session(motion: Motion) -> Array:
    """Return the time since the session began, (N,) [s]; that of the log where none is known."""
    if motion.start is None:
        return motion.elapsed
    return motion.t + motion.start


def session_of(at: Along) -> Array:
    """Return the time of the session, (N,) [s]."""
    return time_of_session(at.motion)


def has_session(motions: Sequence[Motion]) -> bool:
    """Whether motions share a session clock, in addition to the time within each.

    They do if logs state their start times, and if there are enough logs to leave one out: the
    function then still has two logs that fix its slope.
    """
    starts = {m.start for m in motions}
    return len(starts) >= FEWEST and None not in starts


def end_of_session(span: Span) -> tuple[float, ...]:
    """Return the end of the time of the fitted session [s]; nothing where logs share no clock."""
    if not has_session(span.motions):
        return ()
    ends = (float(time_of_session(m).max(initial=0.0)) for m in span.motions)
    return (max(ends) or TYPICAL,)


POSITION = Coordinate(
    "q", "position", "position", attrgetter("travel"), lambda span: (span.farthest,), (3.0, 0.5)
)
LOAD = Coordinate("τ_load", "the load", "load", rigid_load, largest_load, (10.0, 100.0))
TIME = Coordinate("t", "time", "time", attrgetter("motion.elapsed"), duration, (TYPICAL,) * 2)
SESSION = Coordinate(
    "T", "the time of the session", "session", session_of, end_of_session, (TYPICAL,) * 2
)


@frozen
class SmoothFunction(Shaped):
    """``τ = f(u)``: quadratic splines of a coordinate from −1 to 1; a constant is one of them.

    Its shape is the largest value of the coordinate, in its unit. With the velocity it is ``τ =
    f₀(u) + f₁(u) sign q̇ + f₂(u) q̇``, splines for each by itself.

    The time of a session differs from the time of a log: logs are pieces of a session with pauses
    between, and the last log is seldom fitted. So the function is held to a straight line as
    closely as the motion says, and it continues straight beyond its end.

    Attributes
    ----------
    of : Coordinate
    moving : bool
        Whether it is one of the velocity as well.
    name, equation, units
    """

    of: Coordinate = POSITION
    moving: bool = False
    name: str = ""
    equation: str = ""
    units: tuple[tuple[str, str, str], ...] = ()
    source = SOURCE
    supersedes = CONTAINED

    @property
    def pieces(self) -> int:
        """Pieces of a function of the coordinate."""
        session = self.of.against == "session"
        if session:
            return SESSION_PIECES
        if self.moving:
            return PIECES_OF_TWO
        return PIECES

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return the usual largest value."""
        del robot
        return self.of.usual[axis.prismatic]

    def kinds(self, robot: Robot, axis: Axis) -> Strings:
        """Return one for every column."""
        del robot, axis
        count = (3 if self.moving else 1) * (self.pieces + DEGREE)
        return counted(self.units[0][0], count)

    def curves(self, at: Along) -> list[Array]:
        """Return the splines, and these times direction and speed."""
        u = self.of.value(at) / self.shape(at.robot, at.axis)
        u = 2.0 * u - 1.0 if self.of.against in ("time", "session") else u  # times begin at zero
        beyond = straight_beyond if self.of.against == "session" else splines
        columns = beyond(u, self.pieces)
        if not self.moving:
            return list(columns.T)
        share = at.speed[:, None] / largest_speed(at.robot, at.axis)
        signed = columns * at.sign[:, None]
        return [*columns.T, *signed.T, *(columns * share).T]


def _declare_function(
    of: Coordinate,
    name: str,
    kind: str,
    told_by: str,
    *,
    moving: bool = False,
    **facts: Any,
) -> None:
    """Register the function of a coordinate, or of it and the velocity."""
    x = of.symbol
    load = of.against == "load"
    equation = f"τ = f({x}), f = Σ cₖ Bₖ({x})"
    if moving:
        equation = f"τ = f₀({x}) + f₁({x}) sign(q̇) + f₂({x}) q̇, f = Σ cₖ Bₖ"
    units = ((kind, "N·m", "N"),)
    effect = SmoothFunction(None, None, of, moving, f"function_of_{name}", equation, units)
    if load:
        facts["refuse"] = needs_masses
    what = f"an unnamed function of {name.replace('_', ' ') if moving else of.title}"
    own: Any = {"unnamed": True, "flexible": True, "loaded": load, "told_by": told_by}
    register(Family(effect, what, shapes=of.shapes, **own, **{"against": of.against} | facts))


LOADED, LATER = "move with and without a load", "repeat the motion later"
_declare_function(POSITION, "position", "fq", POSTURES)
_declare_function(LOAD, "load", "fl", LOADED)
_declare_function(TIME, "time", "ft", LATER)
_declare_function(SESSION, "session_time", "fT", "log the same motion later in the session")
_declare_function(POSITION, "position_and_velocity", "fqv", SPEEDS, moving=True)
_declare_function(LOAD, "velocity_and_load", "fvl", LOADED, moving=True, against="velocity")
_declare_function(TIME, "velocity_and_time", "fvt", LATER, moving=True)


# Torque that depends on the speed in a way that has no name here.


@declare(
    "an unnamed function of velocity",
    shapes=lambda span: (span.largest_speed,),
    separate=True,
    unnamed=True,
    flexible=True,
    told_by=SPEEDS,
)
class FunctionOfVelocity(Shaped):
    """``τ = f(q̇)``, smooth in the root of the speed but for a step at rest.

    Viscous and Coulomb friction and an offset are among its curves, which are odd functions,
    against the motion, or even ones, or both. Its shape is the largest speed, beyond which it
    returns to a constant.
    """

    name = "function_of_velocity"
    equation = "τ = f(q̇), f = Σ cₖ (Bₖ(u) ∓ Bₖ(−u)) + c sign q̇, u = √|q̇/v| sign q̇"
    source = SOURCE
    supersedes = CONTAINED
    units = (("fo", "N·m", "N"), ("fe", "N·m", "N"))

    def kinds(self, robot: Robot, axis: Axis) -> Strings:
        """Return one for every odd column, then for every even one."""
        del robot, axis
        pairs = (PIECES + DEGREE) // 2
        return (*counted("fo", pairs + 1), *counted("fe", pairs))

    def curves(self, at: Along) -> list[Array]:
        """Return the step with differences of opposite splines, then their sums."""
        pieces = splines(fine_at_rest(at.speed, self.shape(at.robot, at.axis))).T
        low = pieces[: len(pieces) // 2]
        high = pieces[: len(pieces) // 2 - 1 : -1]
        return [at.sign, *(high - low), *(high + low)]

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return the limit of the speed [rad/s or m/s]."""
        return largest_speed(robot, axis)


# Torque that depends on the speed of another joint in a way that has no name here.


@declare(
    "an unnamed function of another joint's velocity",
    actuated_joints,
    shapes=other_joints,
    refuse=is_alone,
    unnamed=True,
    flexible=True,
    told_by="move one joint while the others stand still",
)
class FunctionOfOtherVelocity(FromJoint):
    """``τ = f(q̇_other)``, smooth in the root of the speed up to its limit.

    Its shape is the number of the joint whose speed it is.
    """

    name = "function_of_other_velocity"
    equation = "τ = f(q̇_other), f = Σ cₖ Bₖ(√|q̇_other/v| sign q̇_other)"
    source = SOURCE
    units = (("f", "N·m", "N"),)
    crossed = ("N·m", "N")
    supersedes = CONTAINED

    def kinds(self, robot: Robot, axis: Axis) -> Strings:
        """Return one for every spline, with the joint that it comes from."""
        (kind,) = super().kinds(robot, axis)
        return counted(f"{kind}_", PIECES + DEGREE)

    def curves(self, at: Along) -> list[Array]:
        """Return the splines of the speed of the other joint."""
        other = self.origin(at.robot, at.axis)
        axis = at.robot.joints[other]
        source = next(a for a in at.robot.axes if a.name == axis)
        u = fine_at_rest(at.motion.actuated_v[:, other], largest_speed(at.robot, source))
        return list(splines(np.clip(u, -1.0, 1.0)).T)  # the limit is no end of the data
