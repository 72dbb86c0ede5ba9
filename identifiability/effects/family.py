"""`Family`: what a diagnosis, an export and a report must know of an effect.

A family is declared before the data are seen: where it can be, which shapes it can have. It stands
in the file of its effect.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Literal

import numpy as np

from identifiability.effects.effect import Effect, Shaped
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot

#: Law of an effect at one joint: (speed, position from home, load) -> force, up to a factor;
#: arrays (N,).
Law = Callable[[Array, Array, Array], Array]


@frozen
class Span:
    """Where an axis was in the logs: shapes are chosen from it.

    Attributes
    ----------
    joint : str
    position_range : float [rad or m]
    rms_speed : float [rad/s or m/s]
    low, high : float [rad or m]
        Ends of that range, as the robot file counts positions.
    largest_speed, farthest : float
        Largest speed, and largest distance from home [rad/s or m/s, rad or m].
    robot : Robot, optional
        Whose axis it is.
    motions : tuple of Motion
        Of the logs.
    """

    joint: str
    position_range: float
    rms_speed: float
    low: float = 0.0
    high: float = 1.0
    largest_speed: float = 1.0
    farthest: float = 1.0
    robot: Robot | None = None
    motions: tuple[Motion, ...] = ()


#: Motions that tell effects from what they resemble.
SPEEDS = "run slow and fast passes through the same positions"
RESTS = "rest the joints, or move one joint while another stands still,"
POSTURES = "move through the whole range of each joint with the others in other postures"


def joint_places(robot: Robot) -> tuple[str, ...]:
    """Return every actuated joint and coupled motor."""
    return tuple(a.name for a in robot.axes)


def every_axis(robot: Robot) -> tuple[str, ...]:
    """Return every actuated joint and coupled motor, then every passive joint."""
    return tuple(a.name for a in (*robot.axes, *robot.passive_axes))


def actuated_joints(robot: Robot) -> tuple[str, ...]:
    """Return every actuated joint."""
    return robot.joints


def in_motor(robot: Robot, place: str) -> str:
    """Return why a passive joint cannot have what motors have."""
    return "a passive joint has no motor" if place in robot.passive else ""


def _nowhere_refused(_robot: Robot, _place: str) -> str:
    return ""


def _not_stated(_robot: Robot) -> bool:
    return False


@frozen
class Family:
    """Effects of one kind, one for each place and shape.

    Attributes
    ----------
    effect : Effect
        As it is everywhere, with the shapes that the robot states.
    title : str
        In words: ``Stribeck friction``.
    places : callable(Robot) -> names of joints, bodies or ``base``
        By default every actuated joint and coupled motor.
    shapes : callable(Span) -> shapes, optional
        The grid that the shape is searched on; without one it is what robot file or ladder state.
    against : {"velocity", "position", "load", "time", "session"}
        Over what its curve is drawn.
    separate : bool
        Whether each column is a candidate of its own, else they come together.
    alike : bool
        Whether all columns of a place are the same, so that one stands for them.
    fixed_only : bool
        Whether it can differ from the model only while that is not refitted.
    basic : bool
        Whether every joint has it, so that it goes before what only some joints have.
    needs : str
        Family that must be in the model at the same place: what this one refines.
    refuse : callable(Robot, place) -> str
        Why it makes no sense there, as a sentence; empty if it does.
    stated : callable(Robot) -> bool
        Whether the robot file states it, so that default models have it.
    loaded : bool
        Whether its columns depend on the masses that the robot file states.
    native : bool
        Whether MuJoCo has it itself in a forward simulation, or it shifts the recorded torque.
    dry : bool
        Whether joints stick by it, as by Coulomb friction.
    remembers : bool
        Whether it depends on the way that led to a state, not on that and the time alone.
    late : bool
        Whether a diagnosis asks for it only in a second pass, where something depends on position.
    unnamed : bool
        Whether it is a function without an equation, for what no name explains.
    flexible : bool
        Whether its shape is how many columns it has: motion that was not fitted chooses it.
    continuous : bool
        Whether what lies between two shapes is one, too: tried where data tell these apart.
    reached : callable(Effect, Robot, Span) -> kinds, optional
        Of which of its parameters a motion says anything; of all by default.
    origin : callable(Effect, Robot) -> int, optional
        Index of the joint whose motion its curve is drawn over, where it is not its own.
    law : callable(speed, position, load) -> force, optional
        By which `simulate` hides it in a joint, up to a factor.
    told_by : str
        Motion that tells it from what it resembles.
    rank : int
        Where it stands among the families; a user's own come last.
    """

    effect: Effect
    title: str
    places: Callable[[Robot], tuple[str, ...]] = joint_places
    shapes: Callable[[Span], tuple[float, ...]] | None = None
    against: Literal["velocity", "position", "load", "time", "session"] = "velocity"
    separate: bool = False
    alike: bool = False
    fixed_only: bool = False
    basic: bool = False
    needs: str = ""
    refuse: Callable[[Robot, str], str] = _nowhere_refused
    stated: Callable[[Robot], bool] = _not_stated
    loaded: bool = False
    native: bool = False
    dry: bool = False
    remembers: bool = False
    late: bool = False
    unnamed: bool = False
    flexible: bool = False
    continuous: bool = False
    reached: Callable[[Effect, Robot, Span], tuple[str, ...]] | None = None
    origin: Callable[[Effect, Robot], int] | None = None
    law: Law | None = None
    told_by: str = ""
    rank: int = 100

    @property
    def name(self) -> str:
        """Public name, that of its effects."""
        return self.effect.name

    def at(self, shape: float | tuple[float, ...] | None, place: str) -> Effect:
        """Return the effect with a shape at a place, as the robot has it without one."""
        if isinstance(shape, tuple):
            return self.effect.about(shape)
        if shape is None or np.isnan(shape) or not isinstance(self.effect, Shaped):
            return self.effect
        return type(self.effect)(shape, place)

    def drawn_over(self, effect: Effect, robot: Robot, joint: int) -> int:
        """Return the joint whose motion its curve at a joint is drawn over."""
        return joint if self.origin is None else self.origin(effect, robot)

    def grid(self, span: Span) -> tuple[float, ...]:
        """Return the shapes to try at a place; one nan where there is no shape."""
        if self.shapes is None:
            return (float("nan"),)
        return self.shapes(span)


def measure_spans(robot: Robot, motions: Iterable[Motion]) -> dict[str, Span]:
    """Return the span of every joint, motor and stated axis that effects are at by themselves."""
    motions, spans = tuple(motions), {}
    for axis in robot.axes:
        q = np.concatenate([robot.travel(axis, m.q) for m in motions])
        v = np.concatenate([robot.along(axis, m.v) for m in motions])
        home = float(robot.travel(axis, robot.home[None])[0])
        spans[axis.name] = Span(
            joint=axis.name,
            position_range=float(np.ptp(q)) or 1.0,
            rms_speed=float(np.sqrt(np.mean(v**2))) or 1.0,
            low=float(q.min()),
            high=float(q.max()),
            largest_speed=float(np.abs(v).max()) or 1.0,
            farthest=float(np.abs(q - home).max()) or 1.0,
            robot=robot,
            motions=motions,
        )
    return spans
