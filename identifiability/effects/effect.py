"""`Effect`: a block of named columns of the regressor along a motion, and its `Family`.

Diagnoses, exports and reports read the `Family` of an effect.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from functools import wraps
from typing import ClassVar, Literal
from weakref import WeakKeyDictionary

import numpy as np

from identifiability.foundation.errors import ModelError, listing
from identifiability.foundation.names import (
    Array,
    NumberByName,
    Parameter,
    Strings,
    find_named,
    is_pattern,
)
from identifiability.foundation.values import frozen
from identifiability.robot import Axis, Motion, Robot
from identifiability.robot.closure import load_by

# `Effect`: a block of named columns of the regressor as a function of the motion.
#
# Most effects are an `AlongAxes`: forces along joints and motors, in proportion to levels.


class Effect(ABC):
    """A part of a model: torque that is linear in its parameters.

    Every effect answers three questions: its name, its parameters for a robot, and their columns
    along a motion. Models are sums of effects.
    """

    #: Public name, used in reports, JSON, TOML and on the command line.
    name: str
    #: The equation in words of the literature, for reports.
    equation: str
    #: Where the equation is from.
    source: str = ""
    #: Effects whose columns these already contain; a model drops them.
    supersedes: Strings = ()

    #: How many numbers its shape is, behind the colon of a ladder file.
    shape_size: ClassVar[int] = 0

    #: Exponents that are tried, which a ladder file may state behind the shape; mostly none.
    exponents: ClassVar[tuple[float, ...]] = ()

    #: Whether it acts between motor and gear output, where no sensor behind the gear sees it.
    of_drive: bool = False

    def about(self, shape: Sequence[float]) -> Effect:
        """Return the effect with a shape of several numbers: most have none."""
        raise NotImplementedError(f"{type(self).__name__} has no shape of {len(shape)} numbers")

    def turn(self, robot: Robot) -> Robot:
        """Return the robot that a model with the effect is about: nearly always the same one."""
        return robot

    @property
    def texts(self) -> Strings:
        """How a ladder file writes the effect."""
        return (self.name,)

    def shapes(self, robot: Robot) -> NumberByName:
        """Return the shapes behind the columns, by ``<joint>.<effect>``; none for most effects."""
        del robot
        return {}

    def drawn_over(self, robot: Robot, joint: int) -> int:
        """Return the joint over whose motion the curve at a joint is drawn: nearly always that."""
        del robot
        return joint

    def reached(self, robot: Robot, span: Span) -> Collection[str] | None:
        """Return the kinds of its parameters on which a motion has information; None for all."""
        del robot, span
        return None

    @abstractmethod
    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the parameters that the columns multiply."""

    @abstractmethod
    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the columns into `out` (N, n, p), which holds zeros.

        ``out[k] @ phi`` is the torque of the n actuated joints at sample k [N·m or N].
        """


def hides(robot: Robot, effect: Effect, place: str) -> bool:
    """Return whether the torque sensor of a joint sees no effect of this kind there."""
    driven = place not in robot.passive
    return effect.of_drive and driven and robot.torque.side_of(place) == "link"


def fill_measured(effect: Effect, robot: Robot, motion: Motion, out: Array) -> None:
    """Write the columns of an effect (N, n, p) as the sensors of a log measure them.

    Where torque is measured on both sides of gears, a log is read twice (`split_sensors`). Link
    torque holds no effects of these drives. Motor torque minus link torque holds nothing else.
    """
    effect.fill(robot, motion, out)
    if not robot.torque.has_side("both"):
        return
    for k, parameter in enumerate(effect.parameters(robot)):
        both = robot.torque.side_of(parameter.owner) == "both"
        if (effect.of_drive and both) != motion.drives_alone:
            out[:, :, k] = 0.0


def list_entries(effect: Effect, robot: Robot, motion: Motion) -> Iterator[tuple[int, int, Array]]:
    """Yield joint, column and torque (N,) of an effect, as measured, where it is not zero.

    Forces along the axes of an open chain act in few joints: no others are written.
    """
    if isinstance(effect, AlongAxes) and type(effect).fill is AlongAxes.fill:
        one_sided = not robot.torque.has_side("both")
        if one_sided and motion.X is None and motion.free is None:
            yield from effect.list_forces(robot, motion)
            return
    # The samples of a column lie side by side: columns are written and read one by one.
    width = len(effect.parameters(robot))
    columns = np.zeros((len(robot.actuated), width, len(motion)))
    by_sample = columns.transpose(2, 0, 1)
    fill_measured(effect, robot, motion, by_sample)
    columns = motion.freed(by_sample).transpose(1, 2, 0)
    for joint, column in np.argwhere(columns.any(2)).tolist():
        yield joint, column, columns[joint, column]


def once_along(value: Callable[[Along], Array]) -> Callable[[Along], Array]:
    """Return a function of an axis that is computed once for its motion and cached with that.

    A dictionary asks dozens of effects, of many shapes each, about one axis.
    """
    found: WeakKeyDictionary[Motion, dict[tuple[Robot, Axis], Array]] = WeakKeyDictionary()

    @wraps(value)
    def known(at: Along) -> Array:
        values = found.setdefault(at.motion, {})
        key = at.robot, at.axis
        if key not in values:
            values[key] = value(at)
            values[key].flags.writeable = False
        return values[key]

    return known


@frozen
class Along:
    """The motion along one axis, which the forces along it are functions of."""

    robot: Robot
    motion: Motion
    axis: Axis

    @property
    @once_along
    def speed(self) -> Array:
        """Speed of the axis, (N,) [rad/s or m/s]."""
        return self.robot.along(self.axis, self.motion.v)

    @property
    @once_along
    def sign(self) -> Array:
        """Sign of its speed, (N,): the expected sign where velocity is noisy."""
        return self.motion.expected_sign(self.speed, self.load)

    @property
    @once_along
    def acceleration(self) -> Array:
        """Acceleration of the axis, (N,) [rad/s² or m/s²]."""
        return self.robot.along(self.axis, self.motion.a)

    @property
    @once_along
    def travel(self) -> Array:
        """Position of the axis from its home, (N,) [rad or m]."""
        return self.robot.travel(self.axis, self.motion.q, self.robot.home)

    @property
    @once_along
    def position(self) -> Array:
        """Position of the axis as the robot file counts it, (N,) [rad or m]."""
        return self.robot.travel(self.axis, self.motion.q)

    @property
    def joint(self) -> int:
        """Index of the actuated joint that the axis is of."""
        return self.robot.joints.index(self.axis.name)

    def slope(self, values: Array) -> Array:
        """Return the time derivatives of values (N,); not across missing samples."""
        out = np.zeros(len(values))
        for rows in split_runs(self.motion):
            if len(rows) > 2:
                out[rows] = np.gradient(values[rows], self.motion.t[rows])
        return out

    @property
    def ones(self) -> Array:
        """One at every sample, (N,)."""
        return np.ones(len(self.motion))

    @property
    def load(self) -> Array:
        """Load of the actuated joints by a unit force along the axis, (N, n) or (n,).

        A force f adds ``load · f``. It is the ratio of the joints' speeds to that of the axis
        (virtual work).
        """
        return load_by(self.robot, self.axis, self.motion)


def split_runs(motion: Motion) -> list[np.ndarray]:
    """Return the samples (…,) of each stretch of a motion without missing samples."""
    gaps = np.flatnonzero(np.diff(motion.kept) != 1) + 1
    return [rows for rows in np.split(np.arange(len(motion)), gaps) if len(rows)]


class AlongAxes(Effect):
    """Forces along joints and coupled motors, each in proportion to one parameter.

    A subclass states its `units` and its `curves`, and overrides any default that differs.
    """

    #: Each kind of parameter, with its SI unit at an axis that turns and at one that slides.
    units: tuple[tuple[str, str, str], ...]
    #: Whether physics forbids levels below zero.
    nonnegative: bool = False
    #: The number of a joint by which a robot file states each kind; see `Parameter.stated_as`.
    stated_as: Strings = ()
    #: Whether a model can place it at axes at which it is not by itself.
    anywhere: ClassVar[bool] = True

    #: Names or a pattern of the axes at which a model has placed it, instead of its own.
    elsewhere: ClassVar[str] = ""

    @property
    def placeable(self) -> bool:
        """Whether its curves allow it at other axes than its default ones."""
        return self.anywhere and type(self).curves is not AlongAxes.curves

    def placed(self, owner: str) -> AlongAxes:
        """Return the effect at axes of some names: an offset of a motor that mixes joints."""
        other = copy(self)
        object.__setattr__(other, "elsewhere", owner)
        return other

    def places(self, robot: Robot) -> Sequence[Axis]:
        """Return where it is: the axes at which a model placed it, else its default axes."""
        axes = self.axes(robot)
        if self.elsewhere:
            every = (*robot.axes, *robot.passive_axes)
            named = find_named(self.elsewhere, (axis.name for axis in every))
            axes = [axis for axis in every if axis.name in named]
        return [axis for axis in axes if not hides(robot, self, axis.name)]

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return where the effect is: by default at every actuated joint and coupled motor."""
        return robot.axes

    def kinds(self, robot: Robot, axis: Axis) -> Strings:
        """Return the kinds of parameters that an axis has."""
        del robot, axis
        return tuple(kind for kind, _, _ in self.units)

    def curves(self, at: Along) -> Sequence[Array]:
        """Return the force along an axis per unit of each kind, (N,) each."""
        raise NotImplementedError(f"{type(self).__name__} states no curves")

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return every kind of every axis."""
        known = [name for name, _, _ in self.units]
        out = []
        for axis in self.places(robot):
            for kind in self.kinds(robot, axis):
                at = known.index(kind) if kind in known else 0
                unit = self.units[at][2 if axis.prismatic else 1]
                signs = self.nonnegative, self.stated_as[at] if self.stated_as else ""
                out.append(Parameter(axis.name, kind, unit, self.name, axis.symbol, *signs))
        return tuple(out)

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write a column for every force."""
        for column, (load, force) in enumerate(self._forces(robot, motion)):
            put(out, column, load, force)

    def list_forces(self, robot: Robot, motion: Motion) -> Iterator[tuple[int, int, Array]]:
        """Yield joint, column and torque (N,) of each force in an open chain."""
        for column, (load, force) in enumerate(self._forces(robot, motion)):
            if force.any():
                for joint in np.flatnonzero(load).tolist():
                    yield joint, column, load[joint] * force

    def _forces(self, robot: Robot, motion: Motion) -> Iterator[tuple[Array, Array]]:
        """Yield the load of each axis, (n,) or (N, n), and a force along it, (N,)."""
        for axis in self.places(robot):
            at = Along(robot, motion, axis)
            load = at.load
            for force in self.curves(at):
                if np.shape(force) != motion.t.shape:
                    raise ModelError(
                        f"curves() of the effect '{self.name}' gives a curve of shape "
                        f"{np.shape(force)}; return a list of curves, one for each entry of units, "
                        f"each with a number for each sample, here of shape {motion.t.shape}."
                    )
                yield load, force


def counted(kind: str, count: int) -> Strings:
    """Return the kinds of several parameters, counted from one."""
    return tuple(f"{kind}{k + 1}" for k in range(count))


@frozen
class Shaped(AlongAxes):
    """Forces whose curve has a shape, such as a period.

    Attributes
    ----------
    given : float or None
        The shape; None takes the robot's, else a typical one for each axis.
    only : str or None
        One axis, or a pattern such as ``wrist_*``; None for all.
    """

    shape_size: ClassVar[int] = 1

    #: What its equation calls the shape.
    symbol: ClassVar[str] = ""
    #: The shape where none is stated: at an axis that turns, and at one that slides.
    usual: ClassVar[tuple[float, float]]
    #: Effects that its curve becomes as the shape goes to zero, and to infinity; empty where the
    #: curve vanishes.
    limits: ClassVar[tuple[str, str]] = ("", "")

    given: float | None = None
    only: str | None = None

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return the default shape at an axis."""
        del robot
        return self.usual[axis.prismatic]

    def shape(self, robot: Robot, axis: Axis) -> float:
        """Return the shape at an axis."""
        stated = self.given or robot.shapes.get(f"{axis.name}.{self.name}")
        return stated or self.typical(robot, axis)

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return the axes of actuated joints and coupled motors, or those that are asked for."""
        if self.only is None:
            return robot.axes
        asked = find_named(self.only, (a.name for a in robot.axes))
        return [a for a in robot.axes if a.name in asked]

    def shapes(self, robot: Robot) -> dict[str, float]:
        """Return the shape of every axis."""
        return {f"{a.name}.{self.name}": self.shape(robot, a) for a in self.axes(robot)}


def put(out: Array, column: int, load: Array, force: Array) -> None:
    """Write the column of a force (N,) along an axis that loads the joints by (n,) or (N, n)."""
    if load.ndim == 2:
        out[:, :, column] = load * force[:, None]
        return
    for joint, share in enumerate(load.tolist()):
        if share:
            out[:, joint, column] = share * force


# `Family`: facts about an effect for diagnoses, exports and reports.
#
# A family is declared before the data are seen: where it can be, which shapes it can have. It
# stands in the file of its effect.


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
    robot : Robot
        Whose axis it is.
    low, high : float [rad or m]
        Ends of that range, as the robot file counts positions.
    largest_speed, farthest : float
        Largest speed, and largest distance from home [rad/s or m/s, rad or m].
    motions : tuple of Motion
        Of the logs.
    """

    joint: str
    position_range: float
    rms_speed: float
    robot: Robot
    low: float = 0.0
    high: float = 1.0
    largest_speed: float = 1.0
    farthest: float = 1.0
    motions: tuple[Motion, ...] = ()


#: Behind the name of a shape: the exponent of that curve.
EXPONENT = "_exponent"

#: Motions that distinguish effects from similar ones.
SPEEDS = "run slow and fast passes through the same positions"
RESTS = "rest the joints, or move one joint while another stands still"
POSTURES = "move through the whole range of each joint with the others in other postures"


def joint_places(robot: Robot) -> Strings:
    """Return every actuated joint and coupled motor."""
    return tuple(a.name for a in robot.axes)


def every_axis(robot: Robot) -> Strings:
    """Return every actuated joint and coupled motor, then every passive joint."""
    return tuple(a.name for a in (*robot.axes, *robot.passive_axes))


def actuated_joints(robot: Robot) -> Strings:
    """Return every actuated joint."""
    return robot.motor_joints


def in_motor(robot: Robot, place: str) -> str:
    """Return why a passive joint cannot have effects of motors; empty for actuated joints."""
    if place in robot.passive:
        return "a passive joint has no motor"
    return ""


#: The order in which families are searched and reported; a user's own come last.
ORDER = """
viscous_friction coulomb_friction coulomb_asymmetry actuator_inertia torque_offset
stribeck_friction rising_friction sigmoid_friction hysteresis backlash position_friction
passive_joint_friction load_dependent_friction quadratic_friction joint_stiffness position_ripple
gear_ripple time_delay clock_error command_delay torque_leak velocity_leak torque_scale
imu_mounting gravity_tilt encoder_bias payload rigid_body free_spring gravity_spring
spring_over_two torque_drift constant_force friction_drift position_torque function_of_velocity
function_of_load function_of_position function_of_other_velocity function_of_time
function_of_session_time function_of_position_and_velocity function_of_velocity_and_load
function_of_velocity_and_time
"""


@frozen
class Family:
    """Effects of one kind, one for each place and shape.

    Attributes
    ----------
    effect : Effect
        The effect at all its places, with the shapes that the robot states.
    title : str
        In words: ``Stribeck friction``.
    places : callable(Robot) -> names of joints, bodies or ``base``
        By default every actuated joint and coupled motor.
    shapes : callable(Span) -> shapes, optional
        The grid that the shape is searched on; without one it is what robot file or ladder state.
    against : {"velocity", "position", "load", "time", "session"}
        Over what its curve is drawn.
    separate : bool
        Whether columns are candidates by their kinds, else they come together.
    alike : bool
        Whether all columns of a place are the same, so that one of them is enough.
    fixed_only : bool
        Whether it can differ from the model only while that is not refitted.
    needs : str
        Family that must be in the model at the same place: what this one refines.
    refuse : callable(Robot, place) -> str
        Why it makes no sense there, as a sentence; empty if it does.
    stated : callable(Robot) -> bool
        Whether the robot file states it, so that default models have it.
    logs : {"any", "torque", "commands"}
        Of what the logs are that are searched for it, where nobody names it.
    loaded : bool
        Whether its columns depend on the masses that the robot file states.
    native : bool
        Whether MuJoCo has it itself in a forward simulation, or it shifts the recorded torque.
    remembers : bool
        Whether it depends on the way that led to a state, not on that and the time alone.
    unnamed : bool
        Whether it is a function without an equation, for what no name explains.
    flexible : bool
        Whether its shape is the number of its columns: motion that was not fitted chooses it.
    continuous : bool
        Whether what lies between two shapes is one, too: tried where data tell these apart.
    refined : bool
        Whether only the likeliest shape of its grid is replaced by one between its neighbours.
    law : callable(speed, position, load) -> force, optional
        By which `simulate` hides it in a joint, up to a factor.
    told_by : str
        Motion that tells it from what it resembles.
    pairs : bool
        Whether its places are pairs of joints, see `joints_of`.
    """

    effect: Effect
    title: str
    places: Callable[[Robot], Strings] = joint_places
    shapes: Callable[[Span], tuple[float, ...]] | None = None
    against: Literal["velocity", "position", "load", "time", "session"] = "velocity"
    separate: bool = False
    alike: bool = False
    fixed_only: bool = False
    needs: str = ""
    refuse: Callable[[Robot, str], str] = lambda _robot, _place: ""
    stated: Callable[[Robot], bool] = lambda _robot: False
    logs: Literal["any", "torque", "commands"] = "any"
    loaded: bool = False
    native: bool = False
    remembers: bool = False
    unnamed: bool = False
    flexible: bool = False
    continuous: bool = False
    refined: bool = False
    law: Law | None = None
    told_by: str = ""
    pairs: bool = False

    @property
    def name(self) -> str:
        """Public name, that of its effects."""
        return self.effect.name

    @property
    def rank(self) -> int:
        """Where it stands among the families."""
        names = ORDER.split()
        if self.name in names:
            return names.index(self.name)
        return len(names)

    def at(self, shape: float | tuple[float, ...] | None, place: str) -> Effect:
        """Return the effect with a shape at a place, as the robot has it without one."""
        if isinstance(shape, tuple):
            effect = self.effect.about(shape)
            return replace(effect, only=place) if isinstance(effect, Shaped) else effect
        if shape is None or np.isnan(shape) or not isinstance(self.effect, Shaped):
            return self.effect
        return replace(self.effect, given=shape, only=place)

    @property
    def local(self) -> bool:
        """Whether it depends on the motion of its own joint, and not on another's."""
        return type(self.effect).drawn_over is Effect.drawn_over

    def grid(self, span: Span) -> tuple[float, ...]:
        """Return the shapes to try at a place; one nan where there is no shape."""
        if self.shapes is None:
            return (float("nan"),)
        return self.shapes(span)


def measure_spans(robot: Robot, motions: Iterable[Motion]) -> dict[str, Span]:
    """Return the span of every joint, motor and stated axis that effects are at by themselves."""
    motions = tuple(motions)
    spans = {}
    for axis in robot.axes:
        q = np.concatenate([robot.travel(axis, m.q) for m in motions])
        v = np.concatenate([robot.along(axis, m.v) for m in motions])
        home = float(robot.travel(axis, robot.home[None])[0])
        rms_speed = float(np.sqrt(np.mean(v**2)))
        largest_speed = float(np.abs(v).max()) or 1.0
        farthest = float(np.abs(q - home).max()) or 1.0
        high = float(q.max())
        spans[axis.name] = Span(
            joint=axis.name,
            position_range=float(np.ptp(q)) or 1.0,
            rms_speed=rms_speed or 1.0,
            low=float(q.min()),
            high=high,
            largest_speed=largest_speed,
            farthest=farthest,
            robot=robot,
            motions=motions,
        )
    return spans


# `Placed`: an effect at chosen joints or bodies only, each with a shape of its own.


@frozen
class Part:
    """An effect at a joint, motor or body, or at all whose names fit a pattern.

    Attributes
    ----------
    effect : Effect
        With its shape, if it has one.
    owner : str
        A name, or a pattern such as ``wrist_*``.
    kinds : tuple of str
        Kinds of parameters that are taken; all if empty.
    """

    effect: Effect
    owner: str
    kinds: Strings = ()

    def choose(self, parameters: Sequence[Parameter]) -> dict[int, Parameter]:
        """Return the parameters of the effect that belong to the part, by column."""
        owners = set(find_named(self.owner, (p.owner for p in parameters)))
        return {
            column: p
            for column, p in enumerate(parameters)
            if p.owner in owners and (not self.kinds or p.kind in self.kinds)
        }

    def find(self, robot: Robot) -> tuple[Effect, dict[int, Parameter]]:
        """Return the effect at its place, and the parameters that match the pattern, by column.

        Raises
        ------
        ModelError
            If the effect has no parameter at its place.
        """
        effect = self.effect
        found = self.choose(effect.parameters(robot))
        if not found and isinstance(effect, AlongAxes) and effect.placeable:
            effect = effect.placed(self.owner)
            found = self.choose(effect.parameters(robot))
        if found:
            return effect, found
        effect = self.effect
        owners = dict.fromkeys(p.owner for p in effect.parameters(robot))
        raise ModelError(
            f"{effect.name} has no parameter at '{self.owner}' of {robot.name}; it acts at "
            f"{listing(owners) or 'none of its joints'}."
        )


class Placed(Effect):
    """Parts of one family as one effect, so that a model can have it in some joints.

    Example
    -------
    >>> from identifiability.effects.friction import StribeckFriction
    >>> effect = Placed([Part(StribeckFriction(0.02), "slider1")])
    >>> effect.name
    'stribeck_friction'

    Parameters
    ----------
    parts : sequence of Part
        At least one.
    texts : sequence of str, optional
        How a ladder file writes it.
    """

    def __init__(self, parts: Sequence[Part], texts: Sequence[str] = ()) -> None:
        self.parts = tuple(parts)
        self._texts = tuple(texts)
        first = self.parts[0].effect
        self.of_drive = first.of_drive
        self.name = first.name
        self.equation = first.equation
        self.source = first.source
        self.supersedes = ()

    @property
    def texts(self) -> Strings:
        """How a ladder file writes the effect."""
        return self._texts or super().texts

    @property
    def stage_key(self) -> tuple[object, ...]:
        """Key that is the same for equal effects: their text, or nothing without one."""
        if self._texts:
            return type(self.parts[0].effect), self._texts
        return (id(self),)

    def turn(self, robot: Robot) -> Robot:
        """Return the robot that the effect of its parts is about."""
        return self.parts[0].effect.turn(robot)

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the parameters of all parts, part by part.

        Raises
        ------
        ModelError
            If an effect has no parameter at its place.
        """
        return tuple(p for _, taken in self._taken(robot) for p in taken.values())

    def shapes(self, robot: Robot) -> dict[str, float]:
        """Return the shapes of all parts."""
        shapes = dict[str, float]()
        for effect, taken in self._taken(robot):
            owners = {p.owner for p in taken.values()}
            every = effect.shapes(robot)
            shapes |= {name: x for name, x in every.items() if name.rpartition(".")[0] in owners}
        return shapes

    def _taken(self, robot: Robot) -> list[tuple[Effect, dict[int, Parameter]]]:
        """Return the effect of each part with the parameters that are the part's, by column.

        Parts with an exact name take their parameters before parts with a pattern, and earlier
        patterns before later ones.
        """
        parts = [part.find(robot) for part in self.parts]
        wide = [is_pattern(part.owner) for part in self.parts]
        pairs = list(zip(parts, wide, strict=True))
        gone = {p.name for (_, taken), w in pairs if not w for p in taken.values()}
        out = []
        for (effect, taken), w in pairs:
            left = {k: p for k, p in taken.items() if not w or p.name not in gone}
            gone |= {p.name for p in left.values()}
            out.append((effect, left))
        return out

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the columns of all parts; each effect is computed once."""
        start = 0
        done = dict[int, Array]()
        for effect, taken in self._taken(robot):
            if id(effect) not in done:
                W = np.zeros((len(motion), out.shape[1], len(effect.parameters(robot))))
                effect.fill(robot, motion, W)
                done[id(effect)] = W
            out[:, :, start : start + len(taken)] = done[id(effect)][:, :, [*taken]]
            start += len(taken)
