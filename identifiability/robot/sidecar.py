"""The sidecar: a TOML file that adds data to a robot file.

Every key is optional and described here, and ``docs/reference/sidecar.md`` is written from that.
Patterns such as ``wrist_*.Fv`` or ``leg?.my`` apply to all names that fit, also of passive
joints. ``*`` is any number of letters and ``?`` is one. Patterns are allowed in all tables of
numbers by joint, body or parameter but [home], and in the sums of [[symmetry]]. A name overrides a
pattern. A pattern with more letters overrides one with fewer.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    model_validator,
)

from identifiability.foundation.documents import Span, key, read_document, rising
from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.names import (
    BASE,
    INERTIAL_KINDS,
    Array,
    NumberByName,
    Renames,
    find_named,
    is_pattern,
    specificity,
    split_pair,
)
from identifiability.foundation.options import AngleUnit, Root, Side, TimeUnit

from .locate import LARGEST, LONGEST_NAME, find_sidecar, locate_robot


class Strict(BaseModel):
    """A table of a file: no other keys, no infinite numbers, no endless texts."""

    model_config = ConfigDict(
        extra="forbid", allow_inf_nan=False, defer_build=True, str_max_length=LONGEST_NAME
    )


# `KnownTorque`: known torque as a function of a position.
#
# Examples are a cable, a counter-spring or a gravity compensation that was measured separately. It
# is a table or a polynomial along a joint. It is subtracted from the measured torque first.


class KnownTorque(Strict):
    """Torque that the motor must give against something known; it is subtracted from the measured.

    A spring that pushes towards larger positions helps the motor: its torque is negative here.
    """

    along: str = key("A joint, passive or not, or a coupled motor.")
    table: list[tuple[float, float]] = key(
        "Points (position [rad or m], torque [N·m or N]) with lines between.", [], [[0, 0], [1, -3]]
    )
    polynomial: list[float] = key("In place of a table: c0 + c1 q + …", [])
    range: Span | None = key("Positions between which the polynomial holds.", None)

    @model_validator(mode="after")
    def _one_of_both(self) -> KnownTorque:
        if bool(self.table) == bool(self.polynomial):
            raise ValueError("give either a table or a polynomial")
        if self.table:
            if len({position for position, _ in self.table}) < max(len(self.table), 2):
                raise ValueError("a table needs two points or more, each at another position")
            if self.range is not None:
                raise ValueError("a table ends where its points end; leave out the range")
        return self

    @property
    def span(self) -> tuple[float, float]:
        """Return the range of positions in which it is known [rad or m]."""
        if self.table:
            return min(self.table)[0], max(self.table)[0]
        return self.range or (-np.inf, np.inf)

    def force(self, position: Array) -> Array:
        """Return the torque at some positions (N,) [rad or m], (N,) [N·m or N].

        Raises
        ------
        RobotError
            If a position is out of the known range: nothing is extrapolated.
        """
        low, high = self.span
        outside = np.flatnonzero((position < low) | (position > high))
        if len(outside):
            beyond = np.maximum(low - position[outside], position[outside] - high)
            worst = float(position[outside[int(np.argmax(beyond))]])
            raise RobotError(
                f"'{self.along}' is at {worst:.4g} and [[known_torque]] knows its torque only from "
                f"{low:.4g} to {high:.4g}: {len(outside)} of {len(position)} samples lie outside, "
                "and nothing is extrapolated; measure it there too, or leave these samples out."
            )
        if self.table:
            positions, forces = np.array(sorted(self.table)).T
            return np.interp(position, positions, forces)
        return np.polynomial.polynomial.polyval(position, self.polynomial)

    @property
    def text(self) -> str:
        """Return a short description of the torque."""
        of = f"polynomial of degree {len(self.polynomial) - 1}"
        how = f"table of {len(self.table)} points" if self.table else of
        return f"along {self.along} by a {how} from {self.span[0]:.4g} to {self.span[1]:.4g}"


Triple = tuple[float, float, float]
T = TypeVar("T")


def _unique(given: list[T]) -> list[T]:
    names = [getattr(x, "name", getattr(x, "frame", x)) for x in given]
    if len(set(names)) != len(names):
        raise ValueError("name each one once")
    return given


def _not_zero(value: float) -> float:
    if not value:
        raise ValueError("zero would leave nothing; give another number")
    return value


Factor = Annotated[float, AfterValidator(_not_zero)]
Names = Annotated[list[str], AfterValidator(_unique)]
Masses = Annotated[tuple[Annotated[float, Field(ge=0)], float], AfterValidator(rising)]
Length = Annotated[float, Field(gt=0)]
Gain = Annotated[float, Field(ge=0)]
Fitted = Gain | Literal["fit"]
#: No value of a robot in SI units is larger.
Value = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Powers = Annotated[list[float], Field(min_length=1)]
Delay = Annotated[float, Field(ge=0, le=1)]
Share = Annotated[float, Field(gt=0, le=1)]
Named = Annotated[str, Field(min_length=1)]
Kinds = Annotated[list[str], Field(min_length=1), AfterValidator(_unique)]
Weights = Annotated[dict[str, Factor], Field(min_length=1)]
Mounting = Literal["rotation", "place", "acc_bias", "gyro_bias"]
Locked = Names | dict[str, float | None]
Numbers = dict[str, Value]
#: One value for all joints, or one by joint.
ByJoint: TypeAlias = T | dict[str, T] | None


class ColumnEntry(Strict):
    """Positions, speeds and commands of a joint in logs, in ticks, degrees or normalised units."""

    scale: Factor = key(
        "Size of one unit [rad or m]. Where the heading has a unit: 1 / gear ratio, or -1 if the "
        "log counts the other way.",
        1.0,
    )
    offset: Value = key("Position where the log holds zero [rad or m].", 0.0)


_ColumnRule = Annotated[
    Annotated[str, Tag("name")] | Annotated[ColumnEntry, Tag("table")],
    Discriminator(lambda rule: "name" if isinstance(rule, str) else "table"),
]


def renaming(rules: Mapping[str, str | ColumnEntry]) -> dict[str, str]:
    """Return the names of ``[columns]`` alone."""
    return {key: rule for key, rule in rules.items() if isinstance(rule, str)}


def _checked(rules: dict[str, str | ColumnEntry]) -> dict[str, str | ColumnEntry]:
    Renames.of(renaming(rules))
    return rules


class LoopEntry(Strict):
    """A point of one body that coincides with a point of another: a closed chain."""

    name: str = key("Its name in reports.", "")
    body1: str = key("The one body.")
    point1: Triple = key("The point in its frame [m].", (0.0, 0.0, 0.0))
    body2: str = key("The other body.")
    point2: Triple = key("The point in its frame [m].", (0.0, 0.0, 0.0))


class _CouplingEntry(Strict):
    """A joint that moves as a polynomial of others; it adds to the robot file."""

    name: str = key("Its name in reports.", "")
    joint: str = key("The joint that follows.")
    of: str | None = key("The joint that it follows.", None)
    polynomial: Powers = key("``joint = c0 + c1 of + c2 of² + …``", [0.0, 1.0])
    terms: dict[str, Powers] = key("Further joints that are added.", {}, {"joint1": [0, 0.5, 0.1]})

    @model_validator(mode="after")
    def _two_joints(self) -> _CouplingEntry:
        if self.joint == self.of or self.joint in self.terms:
            raise ValueError("a joint cannot be coupled to itself; name another")
        return self


class _TransmissionEntry(Strict):
    """Motors that are coupled. Motor i = ratio i × (row i of coupling · (q − offset)).

    A differential has the rows [1, 1] and [1, -1]. Logs have columns of the motors, of the joints,
    or positions of the joints and torque of the motors. A motor that moves several joints has
    friction and rotor inertia of its own, beside those of its joints. Where the logs cannot
    separate them, a model file leaves one of both out: ``zero = ["j3.Fv", "j3.Fc", "j3.Ia"]``.
    """

    motors: Names = key("Their names, also more than there are joints.")
    coupling: list[list[float]] = key(
        "Motion of a motor per motion of each joint.", ..., [[1, 0], [1, 1]]
    )
    ratio: list[float] | None = key("Of the gear of each motor; it multiplies torque, too.", None)
    offset: list[float] | None = key("Joint positions where motors are at zero.", None)


class AxisEntry(Strict):
    """A combination of joints that can have effects (jaws.Fv, jaws.K …).

    Fixed tendons of an MJCF along several joints are axes, too, by their names.
    """

    name: Named = key("Its name.")
    joints: Weights = key("By how much each joint moves it.", ..., {"jaw2": 1, "jaw1": -1})
    rest: float | None = key("Where a spring on it is relaxed; without it at home.", None)


class _BaseParametersEntry(Strict):
    """How dependent columns are grouped."""

    bodies: Names = key("Bodies whose columns are kept first when columns are grouped.", [])


class LimitEntry(Strict):
    """Motion limits of an actuated joint, for motions that are designed."""

    q: Span | None = key("Position [rad or m].", None)
    v: Length | None = key("Speed [rad/s or m/s].", None)
    a: Length | None = key("Acceleration [rad/s² or m/s²].", None)
    tau: Length | None = key("Torque [N·m or N].", None)
    power: Length | None = key("Power [W].", None)


class _TimeEntry(Strict):
    """The clock of logs."""

    unit: TimeUnit | None = key("Of `t`; else the only plausible one.", None)


class MeasuredTorque(Strict):
    """The contents of torque columns: τ = sign · gain · ratio · value.

    Torque is measured at the `joint` (with its rotor), at the rotor of the `motor`, at the `link`
    behind the gear, or on `both` sides of the gear. At the `link` it contains neither rotor inertia
    nor friction of the gear. On `both` sides, `gain` and `ratio` are those of the motor's column
    (`<joint>.tau_m`). One value holds for all joints; a table gives one for each joint.
    """

    model_config = ConfigDict(frozen=True)

    side: Side | dict[str, Side] = key("Where it was measured.", "joint", {"joint1": "link"})
    gain: ByJoint[Factor] = key("Torque constants of currents [N·m/A].", None, {"joint1": 0.11})
    ratio: ByJoint[Factor] = key("Of the gears.", None, {"*_elbow": 80, "*": 100})
    sign: ByJoint[Literal[1, -1]] = key(
        "−1 where a column counts the other way.", None, {"right_*": -1}
    )
    compensated: bool | Names | None = key("Whether (where) drivers took the weight off.", None)

    def table(self, name: str) -> dict[str, Any]:
        """Return sides, gains, ratios or signs by joint; one under ``""`` is for all others."""
        said = getattr(self, name)
        if isinstance(said, dict):
            return dict(said)
        if said is None:
            return {}
        return {"": said}

    def side_of(self, joint: str) -> Side:
        """Return where the torque of a joint was measured."""
        table = self.table("side")
        return table.get(joint, table.get("", "joint"))

    def has_side(self, *sides: Side) -> bool:
        """Return whether the torque of any joint was measured at one of some sides."""
        stated = {*self.table("side").values()}
        return not stated.isdisjoint(sides)

    def at(self, name: str, joint: str) -> float | None:
        """Return the gain, ratio or sign of a joint; None if it is not stated."""
        table = self.table(name)
        return table.get(joint, table.get(""))

    def is_compensated(self, joint: str) -> bool:
        """Return whether a joint's measured torque excludes the torque that holds its weight."""
        said = self.compensated
        if isinstance(said, bool):
            return said
        return joint in (said or ())

    def factor(self, joint: str) -> float:
        """Return the factor from a log's values to torque [N·m or N per unit of the log]."""
        parts = (self.at(name, joint) for name in ("gain", "ratio", "sign"))
        return math.prod(1.0 if part is None else part for part in parts)

    def with_gains(self) -> MeasuredTorque:
        """Return the same with 1 for each gain and ratio that is not known, in the log's unit."""
        known = {name: {"": 1.0, **self.table(name)} for name in ("gain", "ratio")}
        return self.model_copy(update=known)

    def scaled_gains(self, factors: NumberByName) -> dict[str, float]:
        """Return gains for the sidecar: the stated ones of some columns, times factors.

        A gain that the sidecar states for all columns stays that of the others.
        """
        table = self.table("gain")
        others = {"*": table[""]} if "" in table else {}
        gains = {name: table.get(name, table.get("", 1.0)) * x for name, x in factors.items()}
        return others | {name: float(f"{gain:.4g}") for name, gain in gains.items()}

    @property
    def text(self) -> str:
        """Return the stated keys in one line; empty if there are none."""
        said = self.model_dump(exclude_defaults=True)
        return "; ".join(f"{key} = {value}" for key, value in said.items())


class ServoEntry(Strict):
    """Position servos, for logs with commands and no torque.

    τ = kp (q_cmd − q) + ki ∫(q_cmd − q) dt + kv (dq_cmd − dq) + τ_ff. One number holds for all
    joints; a table gives one for each joint. Gains are fitted to logs if they are `fit`; so are kp
    and kv that are not stated.
    """

    kp: ByJoint[Fitted] = key("[N·m/rad or N/m]", None, 40)
    kv: ByJoint[Fitted] = key("[N·m·s/rad or N·s/m]", None, {"*_knee": 2, "*": 1})
    ki: ByJoint[Fitted] = key("[N·m/(rad·s) or N/(m·s)]; none if not stated.", None, 80)
    limit: ByJoint[Length] = key("Torque at saturation [N·m or N]; else logs tell it.", None, 30)
    delay: Literal["auto"] | Delay = key("Of commands [s]; auto: logs tell it.", "auto")
    rate: Length | None = key("At which it measures and acts [Hz]; 1000 if nobody says it.", None)
    lag: Delay | None = key("Further age of measurements, as of a current loop [s].", None, 0.001)
    speed_lag: Delay | None = key("Further age of speeds, as of a filter [s].", None, 0.002)


class ImuEntry(Strict):
    """The mounting of an inertial sensor on a floating base.

    It reads a = R (a₀ + dω/dt × r + ω × (ω × r)) + b, with a₀ the acceleration of the base's
    origin.
    """

    rotation: Triple = key("Roll, pitch and yaw on the base [rad].", (0.0, 0.0, 0.0))
    place: Triple = key("Where it is on the base [m].", (0.0, 0.0, 0.0))
    acc_bias: Triple = key("Bias of the accelerometer [m/s²].", (0.0, 0.0, 0.0))
    gyro_bias: Triple = key("Bias of the gyroscope [rad/s].", (0.0, 0.0, 0.0))
    fit: list[Mounting] = key(
        "Those that a fit corrects freely; else all, as far as sensors are off.", []
    )


class ContactEntry(Strict):
    """A contact of a floating robot with the ground, whose force is not measured.

    Without a flag the contact never opens.
    """

    frame: str = key("A body, or a site or geom of an MJCF.")
    kind: Literal["point", "surface"] = key("A surface transmits a moment, too.", "point")
    point: Triple = key("Its middle in that frame [m].", (0.0, 0.0, 0.0))
    radius: Gain | None = key("Of a round foot [m]; else that of the file's sphere.", None)
    flag: str = key("Column of logs that says when it is closed.", "")
    threshold: float = key("Of that column, above which it is.", 0.5)
    margin: Gain = key("How much longer on both sides it may be [s].", 0.02)


class WrenchEntry(Strict):
    """A force, and a moment, on a robot that floats which is measured."""

    frame: str = key("A body, site or geom, along whose axes it is.")
    columns: Names = key("Columns of logs: three [N], or six [N, N·m].")

    @model_validator(mode="after")
    def _three_or_six(self) -> WrenchEntry:
        if len(self.columns) not in (3, 6):
            raise ValueError("give three columns, of a force, or six, of a force and a moment")
        return self


class _SymmetryEntry(Strict):
    """Columns that equal parts let us add."""

    name: str = key("Its name in reports.", "")
    tie: dict[str, list[str]] = key("What is equal.", ..., {"leg.my": ["leg1.my", "leg2.my"]})


class BodyBoundsEntry(Strict):
    """Known limits of a body, or of all bodies whose names fit."""

    mass: Masses | None = key("Least and largest mass [kg].", None)
    box: tuple[Span, Span, Span] | None = key("Of its centre, along its frame's axes [m].", None)


class BoundsEntry(Strict):
    """Limits of masses that hold for any real robot of this kind."""

    total_mass: Masses | None = key("Of all moving bodies, without payload [kg].", None)
    bodies: dict[str, BodyBoundsEntry] = {}


class _PriorEntry(Strict):
    """A normal prior of a standard parameter; others are nominal ± prior_relative × their size."""

    mean: float = key("In SI units.")
    sd: Length = key("In SI units.")


class Sidecar(Strict):
    """All keys of a sidecar."""

    name: str = key("The robot's name.", "")
    description: str = key("A sentence on it.", "")
    base: Root | None = key("Whether its root was bolted down.", None)
    actuated: Names | None = key("Joints with a motor; else those of <actuator>, or all.", None)
    locked: Locked = key("Joints that stand still, or a table of where.", [], {"finger": 0.02})
    angles: AngleUnit | None = key("Unit of angles in logs; else rad.", None)
    effects: Names = key("Effects that are at some places only.", [], ["joint_stiffness@roll"])
    massless: Names = key("Links of a URDF between the axes of one joint, which are no bodies.", [])
    guessed: Names = key("Bodies whose masses in the file are guesses, compared with nothing.", [])
    inertia_parts: Kinds = key("Parts of an actuator's inertia.", ["Ia"], ["Jr", "Js"])
    home: Numbers = key(
        "Positions that select the assembly of a closed chain.", {}, {"joint1": 0.3}
    )
    loops: list[LoopEntry] | None = None
    couplings: list[_CouplingEntry] = []
    transmission: _TransmissionEntry | None = None
    axes: Annotated[list[AxisEntry], AfterValidator(_unique)] = []
    symbols: dict[str, str] = key("Short forms in labels.", {}, {"platform": "3"})
    base_parameters: _BaseParametersEntry = _BaseParametersEntry()
    nominal: Numbers = key("Values that go before the robot file's.", {}, {"joint1.Fv": 3.0})
    rest: Numbers = key(
        "Where springs are relaxed; else as the file says, or at home.", {}, {"joint2": 0.4}
    )
    shapes: dict[str, Length] = key("As of Stribeck.", {}, {"joint1.stribeck_friction": 0.05})
    reference: Numbers = key("Values by which loads are known; else nominal.", {}, {"arm1.m": 3.0})
    limits: dict[str, LimitEntry] = {}
    columns: Annotated[dict[str, _ColumnRule], AfterValidator(_checked)] = key(
        "Name or regular expression in logs = name here, or scale and offset of positions.",
        {},
        {"fer_joint(\\d)": "panda_joint\\1", "elbow": {"scale": 0.00153, "offset": -3.14}},
    )
    time: _TimeEntry = _TimeEntry()
    torque: MeasuredTorque = MeasuredTorque()
    servo: ServoEntry | None = None
    known_torque: list[KnownTorque] = []
    imu: ImuEntry | None = None
    contacts: Annotated[list[ContactEntry], AfterValidator(_unique)] = []
    wrench: list[WrenchEntry] = []
    symmetry: list[_SymmetryEntry] = []
    prior_relative: Length = key("Width of priors that [prior] does not state.", 1.0)
    prior: dict[str, _PriorEntry] = {}
    prior_share: dict[str, Share] = key("Within which bodies are the file's.", {}, {"link*": 0.1})
    bounds: BoundsEntry = BoundsEntry()
    preparation: dict[str, Any] = key("How logs become motion.", {}, {"cutoff": 10.0})
    run: dict[str, Any] = key("Where long work runs.", {}, {"workers": 4})
    fit: dict[str, Any] = key("How parameters are estimated.", {}, {"estimator": "ls"})


def read_sidecar(path: Path | None) -> Sidecar:
    """Read a sidecar; no path gives an empty one.

    Raises
    ------
    RobotError
        The error names the file, the key and the expected value.
    """
    if path is None:
        return Sidecar()
    return read_document(path, Sidecar, "TOML", "sidecar", RobotError)


def read_settings(
    robot: str | Path, sidecar: str | Path | None = None
) -> dict[str, dict[str, Any]]:
    """Return the tables of a robot's sidecar with settings of verbs, by their names.

    Raises
    ------
    RobotError
    """
    path = find_sidecar(locate_robot(robot)) if sidecar is None else Path(sidecar)
    read = read_sidecar(path)
    return {"preparation": read.preparation, "run": read.run, "fit": read.fit}


# Names and patterns in a sidecar's tables: ``wrist_*.Fv`` for every joint or axis that fits.


def check_known(path: Path, key: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Refuse a sidecar that names a part that the robot does not have.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    key : str
        Of the sidecar.
    given, known : iterable of str

    Raises
    ------
    RobotError
    """
    known = list(known)
    for name in given:
        if name not in known:
            raise RobotError(
                f"The sidecar of {path}: [{key}] names '{name}', which the robot does not have, or "
                f"which hangs behind a locked joint{near_match(name, known)} Known: "
                f"{listing(known)}."
            )


def by_name(
    path: Path, key: str, table: Mapping[str, T], known: Collection[str], gone: Collection[str] = ()
) -> dict[str, T]:
    """Return a table with its patterns replaced by the names that fit them.

    A name overrides a pattern. A pattern with more letters overrides one with fewer.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    key : str
        Of the table.
    table : mapping
    known : collection of str
    gone : collection of str
        Names that are allowed but not returned: locked joints, and bodies behind them.

    Raises
    ------
    RobotError
        If nothing fits a name or pattern.
    """
    out: dict[str, T] = {}
    for text in sorted(table, key=specificity):
        found = find_named(text, known)
        if not found and not find_named(text, gone):
            check_known(path, key, [text], known)
        out |= dict.fromkeys(found, table[text])
    return out


def expand_names(
    path: Path,
    extra: Sidecar,
    bodies: Collection[str],
    joints: Collection[str],
    lines: Collection[str],
    locked: Collection[str],
    welded: Collection[str],
) -> Sidecar:
    """Return a sidecar with patterns replaced by the names that fit.

    Entries about locked joints, and about bodies behind them, are left out. A sum of symmetry is
    left out if one of its parts is locked: the parts are no longer equal.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    extra : Sidecar
    bodies, joints : collection of str
        Moving bodies and joints.
    lines : collection of str
        Motors and axes.
    locked, welded : collection of str
        Locked joints, and bodies behind them.

    Raises
    ------
    RobotError
        If it names a part that the robot does not have.
    """
    moving = (*joints, *lines)
    gone = {*locked, *welded}
    known_bodies = (*bodies, *welded)
    check_known(path, "symbols", extra.symbols, (*known_bodies, *moving, *locked))
    check_known(path, "base_parameters", extra.base_parameters.bodies, known_bodies)
    check_known(path, "guessed", extra.guessed, known_bodies)

    def parameters(key: str, table: Mapping[str, T]) -> dict[str, T]:
        return _expand_parameters(path, key, table, bodies, moving, locked, gone)

    def left(names: Iterable[str]) -> list[str]:
        return [name for name in names if name not in gone]

    ties = []
    for entry in extra.symmetry:
        owners = [name.rpartition(".")[0] for names in entry.tie.values() for name in names]
        if owners == left(owners):
            tie = {k: [*parameters("symmetry", dict.fromkeys(x))] for k, x in entry.tie.items()}
            ties.append(entry.model_copy(update={"tie": tie}))
    first = left(extra.base_parameters.bodies)
    base_parameters = extra.base_parameters.model_copy(update={"bodies": first})
    limits = by_name(path, "limits", extra.limits, joints, locked)
    prior_share = by_name(path, "prior_share", extra.prior_share, bodies, gone)
    known_torque = [known for known in extra.known_torque if known.along not in gone]
    own = {
        "base_parameters": base_parameters,
        "limits": limits,
        "rest": by_name(path, "rest", extra.rest, joints, locked),
        "prior_share": prior_share,
        "symmetry": ties,
        "guessed": left(extra.guessed),
        "known_torque": known_torque,
    }
    for word in ("nominal", "prior", "shapes", "reference"):
        own[word] = parameters(word, getattr(extra, word))
    for word in ("home", "symbols"):
        table = getattr(extra, word)
        own[word] = {name: table[name] for name in left(table)}
    return extra.model_copy(update=own)


def _expand_parameters(
    path: Path,
    key: str,
    table: Mapping[str, T],
    bodies: Collection[str],
    moving: Collection[str],
    locked: Collection[str],
    gone: Collection[str],
) -> dict[str, T]:
    """Return a table of parameters with patterns replaced by the names that fit.

    Parameters of inertia belong to bodies, all others to moving joints and axes, or to two joints.
    """
    out: dict[str, T] = {}
    for text in sorted(table, key=specificity):
        owner, _, kind = text.rpartition(".")
        kinds = find_named(kind, INERTIAL_KINDS) if is_pattern(kind) else [kind]
        both = {*split_pair(owner)}
        there = [owner] if both <= {*moving, *locked} else []
        known: Collection[str] = (*bodies, *moving, BASE, *(there if both <= {*moving} else []))
        if is_pattern(text):
            inertial = is_pattern(kind) or kind in INERTIAL_KINDS or kind[:8] == "payload_"
            known = bodies if inertial else moving
        behind = gone if is_pattern(owner) else (*locked, *there)
        found = by_name(path, key, {owner if kinds else text: table[text]}, known, behind)
        out |= {f"{name}.{k}": value for name, value in found.items() for k in kinds}
    return out
