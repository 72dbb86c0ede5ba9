"""The sidecar: a TOML file beside the robot file with what the robot file cannot say.

Docstrings show every key as a file writes it, and docs/reference/sidecar.md is written from them.
In [nominal], [prior], [shapes], [reference], [limits] and the sums of [[symmetry]] a pattern such
as ``wrist_*.Fv`` or ``leg?.my`` stands for all names that fit (passive joints too), ``*`` being any
letters and ``?`` one. A name goes before a pattern, and of two patterns the one that stands last.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    model_validator,
)

from identifiability.foundation.documents import read_document
from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.names import BASE, INERTIAL_KINDS, Renames, find_named, is_pattern
from identifiability.foundation.values import frozen
from identifiability.robot.markup import LARGEST, LONGEST_NAME
from identifiability.robot.measured_torque import Side

Triple = tuple[float, float, float]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, defer_build=True)


def _unique(names: list[str]) -> list[str]:
    if len(set(names)) != len(names):
        raise ValueError("name each one once")
    return names


def _rising(span: tuple[float, float]) -> tuple[float, float]:
    if not span[0] < span[1]:
        raise ValueError("the lower limit must be below the upper one")
    return span


def _not_zero(value: float) -> float:
    if not value:
        raise ValueError("zero would leave nothing; give another number")
    return value


Factor = Annotated[float, AfterValidator(_not_zero)]
Names = Annotated[list[str], AfterValidator(_unique)]
Span = Annotated[tuple[float, float], AfterValidator(_rising)]
Masses = Annotated[tuple[Annotated[float, Field(ge=0)], float], AfterValidator(_rising)]
Length = Annotated[float, Field(gt=0)]
Gain = Annotated[float, Field(ge=0)]
Fitted = Gain | Literal["fit"]
#: No value of a robot in SI units is larger.
Value = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
#: Coefficients of a polynomial.
DEGREE = 50


class ColumnEntry(_Strict):
    """Positions and commands of a joint in the logs, in ticks, degrees or normalised units.

    Keys
    ----
    name = "elbow"
        The joint here, where the key is what logs call it.
    scale = 0.00153
        What one is [rad or m].
    offset = -3.14
        Position where the log holds zero [rad or m].
    """

    name: str | None = None
    scale: Factor = 1.0
    offset: float = Field(default=0.0, ge=-LARGEST, le=LARGEST)


_ColumnRule = Annotated[
    Annotated[str, Tag("name")] | Annotated[ColumnEntry, Tag("table")],
    Discriminator(lambda rule: "name" if isinstance(rule, str) else "table"),
]


def renaming(rules: Mapping[str, str | ColumnEntry]) -> dict[str, str]:
    """Return the names of ``[columns]`` alone."""
    named = {k: r if isinstance(r, str) else r.name for k, r in rules.items()}
    return {key: name for key, name in named.items() if name is not None}


def _checked(rules: dict[str, str | ColumnEntry]) -> dict[str, str | ColumnEntry]:
    Renames.of(renaming(rules))
    return rules


class LoopEntry(_Strict):
    """A point of one body that coincides with a point of another: a closed chain.

    Keys
    ----
    name = "tip"
        Its name in reports.
    body1 = "left_tip"
        The one body.
    point1 = [0.3, 0, 0]
        The point in its frame [m].
    body2 = "right_tip"
        The other body.
    point2 = [0.3, 0, 0]
        The point in its frame [m].
    axes = ["x", "z"]
        Directions in which it is demanded; a planar loop may have all, at any yaw.
    frame = "table"
        The body whose axes they are, as a slot turns with its body; without it the world's.
    """

    name: str = ""
    body1: str
    point1: Triple = (0.0, 0.0, 0.0)
    body2: str
    point2: Triple = (0.0, 0.0, 0.0)
    axes: list[Literal["x", "y", "z"]] = Field(default=["x", "y", "z"], min_length=1)
    frame: str | None = None


class _CouplingEntry(_Strict):
    """A joint that moves as a polynomial of others, beside what the robot file says.

    Keys
    ----
    name = "parallelogram"
        Its name in reports.
    joint = "joint3"
        The joint that follows.
    of = "joint2"
        The joint that it follows.
    polynomial = [0, -1]
        ``joint = c0 + c1 of + c2 of² + …``
    terms = {joint1 = [0, 0.5, 0.1]}
        Further joints that are added, a polynomial each.
    """

    name: str = ""
    joint: str
    of: str | None = None
    polynomial: list[float] = Field(default=[0.0, 1.0], min_length=1, max_length=DEGREE)
    terms: dict[str, Annotated[list[float], Field(min_length=1, max_length=DEGREE)]] = {}

    @model_validator(mode="after")
    def _two_joints(self) -> _CouplingEntry:
        if self.joint == self.of or self.joint in self.terms:
            raise ValueError("a joint cannot be coupled to itself; name another")
        return self


class _TransmissionEntry(_Strict):
    """Motors that are coupled: motor = ratio ∘ (coupling · (q − offset)).

    Keys
    ----
    motors = ["m1", "m2"]
        Their names, also more than there are joints.
    coupling = [[1, 0], [1, 1]]
        What each motor turns by per joint, before its gear.
    ratio = [45, 32]
        Ratios of the gears.
    offset = [0, 0]
        Joint positions where motors are at zero.
    """

    motors: Names
    coupling: list[list[float]]
    ratio: list[float] | None = None
    offset: list[float] | None = None


class AxisEntry(_Strict):
    """A combination of joints on which effects can be (jaws.Fv, jaws.K …).

    Fixed tendons of an MJCF along several joints are axes by their own names.

    Keys
    ----
    name = "jaws"
        Its name.
    joints = {jaw2 = 1, jaw1 = -1}
        By how much each joint moves it.
    rest = 0.1
        Where a spring on it is relaxed; without it at home.
    """

    name: str = Field(min_length=1)
    joints: dict[str, Factor] = Field(min_length=1)
    rest: float | None = None


class _BaseParametersEntry(_Strict):
    """How dependent columns are grouped.

    Keys
    ----
    bodies = ["arm2", "arm1"]
        Bodies whose columns are kept first when columns are grouped.
    """

    bodies: Names = []


class LimitEntry(_Strict):
    """Motion limits of an actuated joint, for motions that are designed.

    Keys
    ----
    q = [-1, 1]
        Position [rad or m].
    v = 2
        Speed [rad/s or m/s].
    a = 10
        Acceleration [rad/s² or m/s²].
    tau = 40
        Torque [N·m or N].
    power = 200
        Power [W].
    """

    q: Span | None = None
    v: float | None = Field(default=None, gt=0)
    a: float | None = Field(default=None, gt=0)
    tau: float | None = Field(default=None, gt=0)
    power: float | None = Field(default=None, gt=0)


class _TimeEntry(_Strict):
    """The clock of logs.

    Keys
    ----
    unit = "ms"
        Unit of `t`; without it s, or what can only be meant.
    """

    unit: Literal["s", "ms", "us", "ns"] | None = None


class _TorqueEntry(_Strict):
    """What torque columns hold: τ = sign · gain · ratio · value.

    Keys
    ----
    side = "motor"
        Where it was measured: at the joint with all of its rotor, at the `motor`'s rotor, or at
        the `link` behind the gear, where no rotor inertia is seen.
    gain = {joint1 = 0.11}
        Torque constants of currents [N·m/A]; one number, or by joint.
    ratio = {joint1 = 100}
        Of the gears.
    sign = {joint1 = -1}
        −1 where a column counts the other way.
    compensated = true
        Whether the driver took off what holds the weight (or of which joints): the file's is added
        again.
    """

    side: Side = "joint"
    gain: Factor | dict[str, Factor] | None = None
    ratio: Factor | dict[str, Factor] | None = None
    sign: Literal[1, -1] | dict[str, Literal[1, -1]] | None = None
    compensated: bool | Names | None = None


class _KnownTorqueEntry(_Strict):
    """Torque that is supplied beside the motor's, and taken off the measured one.

    Keys
    ----
    along = "joint2"
        A joint, passive or not, or a coupled motor.
    table = [[-1, 0.2], [0, 0], [1, -3]]
        Points (position [rad or m], torque [N·m or N]), and straight lines between them.
    polynomial = [0, -2.5]
        In place of a table: c0 + c1 q + …
    range = [-1, 1]
        Positions between which the polynomial holds.
    """

    along: str
    table: list[tuple[float, float]] = []
    polynomial: list[float] = Field(default=[], max_length=DEGREE)
    range: Span | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> _KnownTorqueEntry:
        if bool(self.table) == bool(self.polynomial):
            raise ValueError("give either a table or a polynomial")
        if self.table:
            positions = {position for position, _ in self.table}
            if len(positions) < max(len(self.table), 2):
                raise ValueError("a table needs two points or more, each at another position")
            if self.range is not None:
                raise ValueError("a table ends where its points end; leave out the range")
        return self


class ServoEntry(_Strict):
    """Position servos, where logs hold commands and no torque.

    τ = kp (q_cmd − q) + kv (dq_cmd − dq) + τ_ff

    Keys
    ----
    kp = 40
        [N·m/rad or N/m]; one number, or by joint; "fit" where logs shall tell it, as they do where
        nobody states any gain.
    kv = {"*_knee" = 2, "*" = 1}
        [N·m·s/rad or N·s/m]; one number, or by joint, or "fit".
    limit = 30
        Torque beyond which it is saturated [N·m or N]; where none is stated logs tell it.
    delay = 0.004
        Of commands [s]; auto: logs tell it.
    rate = 500
        At which the servo measures and acts [Hz]; 1000 where nobody says it.
    """

    kp: Fitted | dict[str, Fitted] | None = None
    kv: Fitted | dict[str, Fitted] | None = None
    limit: Length | dict[str, Length] | None = None
    delay: Literal["auto"] | Annotated[float, Field(ge=0, le=1)] = "auto"
    rate: Length | None = None


class ImuEntry(_Strict):
    """How an inertial sensor is mounted on a base that floats.

    It reads a = R (a₀ + dω/dt × r + ω × (ω × r)) + b where the base's origin accelerates by a₀.

    Keys
    ----
    rotation = [0, 0, 1.57]
        Roll, pitch and yaw of the sensor on the base [rad].
    place = [0, 0, 0.05]
        Where it is on the base [m].
    acc_bias = [0.1, 0, -0.05]
        What the accelerometer reads too much [m/s²].
    gyro_bias = [0.002, 0, 0]
        What the gyroscope reads too much [rad/s].
    fit = ["place", "acc_bias"]
        Those of these that are known roughly: corrections of them are fitted (the effect
        `imu_mounting`).
    """

    rotation: Triple = (0.0, 0.0, 0.0)
    place: Triple = (0.0, 0.0, 0.0)
    acc_bias: Triple = (0.0, 0.0, 0.0)
    gyro_bias: Triple = (0.0, 0.0, 0.0)
    fit: list[Literal["rotation", "place", "acc_bias", "gyro_bias"]] = []


class ContactEntry(_Strict):
    """Where the ground presses on a robot that floats, with a force that nobody measures.

    Without flag and schedule the contact never opens.

    Keys
    ----
    frame = "FL_foot"
        A body, or a site or geom of an MJCF.
    kind = "point"
        Whether it transmits a force alone, or a moment, too.
    point = [0, 0, -0.2]
        Its middle in that frame [m].
    radius = 0.02
        Of a round foot [m]; without it that of a sphere of the file is its own.
    flag = "FL_contact"
        Column of logs that says when it is closed.
    threshold = 10
        Of that column, above which it is.
    schedule = [[0, 1.5], [2, 4]]
        Or between which times it is closed [s].
    margin = 0.02
        How much longer on both sides it may be [s].
    """

    frame: str
    kind: Literal["point", "surface"] = "point"
    point: Triple = (0.0, 0.0, 0.0)
    radius: Gain | None = None
    flag: str = ""
    threshold: float = 0.5
    schedule: list[Span] | None = None
    margin: Gain = 0.02

    @model_validator(mode="after")
    def _one_of_both(self) -> ContactEntry:
        if self.flag and self.schedule is not None:
            raise ValueError("give either the column of a flag or a schedule")
        return self


class WrenchEntry(_Strict):
    """A force, and a moment, on a robot that floats which is measured.

    Keys
    ----
    frame = "FL_foot"
        A body, site or geom, along whose axes it is.
    columns = ["FL_fx", "FL_fy", "FL_fz"]
        Columns of logs: three [N], or six [N, N·m].
    """

    frame: str
    columns: Names

    @model_validator(mode="after")
    def _three_or_six(self) -> WrenchEntry:
        if len(self.columns) not in (3, 6):
            raise ValueError("give three columns, of a force, or six, of a force and a moment")
        return self


class _SymmetryEntry(_Strict):
    """Columns that equal parts let us add.

    Keys
    ----
    name = "equal legs"
        Its name in reports.
    tie = {"leg.my" = ["leg1.my", "leg2.my"]}
        The parameter, and those that are equal to it.
    """

    name: str = ""
    tie: dict[str, list[str]]


class _EllipsoidEntry(_Strict):
    """Where a centre of mass is.

    Keys
    ----
    centre = [0, 0, 0.2]
        In the body's frame [m].
    radii = [0.1, 0.1, 0.3]
        Along its axes [m].
    """

    centre: Triple = (0.0, 0.0, 0.0)
    radii: tuple[Length, Length, Length]


class BodyBoundsEntry(_Strict):
    """What is known of a body, or of all whose names fit.

    Keys
    ----
    mass = [0.5, 2.0]
        Least and largest mass [kg].
    box = [[-0.1, 0.1], [-0.1, 0.1], [0.0, 0.4]]
        Where its centre of mass is, along the axes of the body's frame in the robot file [m].
    """

    mass: Masses | None = None
    box: tuple[Span, Span, Span] | None = None
    ellipsoid: _EllipsoidEntry | None = None


class BoundsEntry(_Strict):
    """What a real robot of this kind can have.

    Keys
    ----
    total_mass = [8.0, 12.0]
        Least and largest mass of all moving bodies, without payload [kg].
    """

    total_mass: Masses | None = None
    bodies: dict[str, BodyBoundsEntry] = {}


class _PriorEntry(_Strict):
    """A normal prior of a standard parameter; others are nominal ± prior_relative × their size.

    Keys
    ----
    mean = 3.0
        In SI units.
    sd = 0.3
        In SI units.
    """

    mean: float
    sd: float = Field(gt=0)


class Sidecar(_Strict):
    r"""What the robot file cannot say.

    Keys
    ----
    name = "3-RPS parallel robot"
        The robot's name.
    description = "Three legs carry a platform."
        A sentence on it.
    base = "fixed"
        Whether the root of a legged robot, or of one that floats in its file, was bolted down
        (`fixed`), or nothing held it (`floating`).
    stand = [0, 1.57, 0]
        Roll, pitch and yaw [rad] at which the root stood in the world where it was bolted down or
        hung up; without it as the file draws it.
    actuated = ["joint1", "joint2"]
        Which joints have a motor; without it those of <actuator>, or all.
    locked = {finger = 0.02}
        Joints that do not move, or a table with where they stand.
    angles = "deg"
        Unit of angles in logs; without it rad, and what looks like degrees is refused.
    effects = ["joint_stiffness@roll"]
        Effects of default models that are at some places only, as a ladder writes them.
    massless = ["cross"]
        Links of a URDF between the axes of one joint (universal, ball), each carrying one joint:
        they are no bodies.
    guessed = ["forearm"]
        Bodies whose masses and inertias in the file are guesses, as those that a table leaves out:
        no torque is compared with what they ask for.
    inertia_parts = ["Jr", "Js"]
        What an actuator's inertia is made of.
    home = {joint1 = 0.3}
        Joint positions; they select the assembly of a closed chain.
    symbols = {platform = "3"}
        Short forms of bodies and joints in labels.
    nominal = {"joint1.Fv" = 3.0}
        Values of parameters beside those of the robot file.
    rest = {joint2 = 0.4}
        Where the spring of a joint (joint2.K) is relaxed [rad or m]; without it as the robot file
        says, or at home.
    shapes = {"joint1.stribeck_friction" = 0.05}
        Shapes by joint and effect: a Stribeck velocity [rad/s or m/s], the period of a ripple.
    reference = {"arm1.m" = 3.0}
        Values by which the loads of load-dependent friction, a tilted base and a delay are known;
        without them nominal ones.
    columns = {"fer_joint(\\d)" = "panda_joint\\1", elbow = {scale = 0.00153, offset = -3.14}}
        Column or joint in the logs = column or joint here; or a regular expression for the whole
        name. Or joint (or pattern) = scale and offset of its positions and commands.
    prior_relative = 0.5
        Width of the priors that [prior] does not state, as a share of their size.
    prior_share = {hand = 0.02, "link*" = 0.1}
        Bodies (or patterns) to the share within which each is the robot file's; of the others
        --prior is.
    """

    name: str = Field(default="", max_length=LONGEST_NAME)
    description: str = Field(default="", max_length=20 * LONGEST_NAME)
    base: Literal["fixed", "floating"] | None = None
    stand: Triple | None = None
    actuated: list[str] | None = None
    locked: Names | dict[str, float | None] = []
    angles: Literal["rad", "deg"] | None = None
    effects: Names = []
    massless: Names = []
    guessed: Names = []
    inertia_parts: Names = Field(default=["Ia"], min_length=1)
    home: dict[str, float] = {}
    loops: list[LoopEntry] | None = None
    couplings: list[_CouplingEntry] = []
    transmission: _TransmissionEntry | None = None
    axes: list[AxisEntry] = []
    symbols: dict[str, str] = {}
    base_parameters: _BaseParametersEntry = _BaseParametersEntry()
    nominal: dict[str, Value] = {}
    rest: dict[str, float] = {}
    shapes: dict[str, Annotated[float, Field(gt=0)]] = {}
    reference: dict[str, float] = {}
    limits: dict[str, LimitEntry] = {}
    columns: Annotated[dict[str, _ColumnRule], AfterValidator(_checked)] = {}
    time: _TimeEntry = _TimeEntry()
    torque: _TorqueEntry = _TorqueEntry()
    servo: ServoEntry | None = None
    known_torque: list[_KnownTorqueEntry] = []
    imu: ImuEntry | None = None
    contacts: list[ContactEntry] = []
    wrench: list[WrenchEntry] = []
    symmetry: list[_SymmetryEntry] = []
    prior_relative: float = Field(default=1.0, gt=0)
    prior: dict[str, _PriorEntry] = {}
    prior_share: dict[str, Annotated[float, Field(gt=0, le=1)]] = {}
    bounds: BoundsEntry = BoundsEntry()


def read_sidecar(path: Path | None) -> Sidecar:
    """Read a sidecar; no path gives an empty one.

    Raises
    ------
    RobotError
        With the file, the key and what was expected.
    """
    if path is None:
        return Sidecar()
    return read_document(path, Sidecar, "TOML", "sidecar", RobotError)


# Names and patterns in a sidecar's tables: ``wrist_*.Fv`` for every joint or axis that fits.


V = TypeVar("V")


def check_known(path: Path, key: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Refuse a sidecar that names what the robot does not have.

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
    path: Path, key: str, table: Mapping[str, V], known: Collection[str], gone: Collection[str] = ()
) -> dict[str, V]:
    """Return what a table says of every name that its names and patterns stand for.

    A name goes before a pattern, and of two patterns the one that stands last.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    key : str
        Of the table.
    table : mapping
    known : collection of str
    gone : collection of str
        What may be named, too, and is not returned: what is locked, and bodies behind it.

    Raises
    ------
    RobotError
        If nothing fits a name or pattern.
    """
    out: dict[str, V] = {}
    for text in sorted(table, key=is_pattern, reverse=True):
        found = find_named(text, known)
        if not found and not find_named(text, gone):
            check_known(path, key, [text], known)
        out |= dict.fromkeys(found, table[text])
    return out


@frozen
class Owners:
    """What parameters can be named after.

    Attributes
    ----------
    bodies : tuple of str
    joints : tuple of str
    lines : tuple of str
        Motors and axes.
    locked, welded : tuple of str
        Locked joints, and bodies behind them.
    """

    bodies: tuple[str, ...]
    joints: tuple[str, ...]
    lines: tuple[str, ...]
    locked: tuple[str, ...] = ()
    welded: tuple[str, ...] = ()

    def parameters(self, path: Path, key: str, table: Mapping[str, V]) -> dict[str, V]:
        """Return a table of parameters by name; kinds of inertia are bodies'.

        Raises
        ------
        RobotError
            If the robot has no such body, joint, motor or axis.
        """
        out: dict[str, V] = {}
        for text in sorted(table, key=is_pattern, reverse=True):
            owner, _, kind = text.rpartition(".")
            kinds = find_named(kind, INERTIAL_KINDS) if is_pattern(kind) else [kind]
            known = (*self.bodies, *self.joints, *self.lines)
            if is_pattern(text):
                inertial = is_pattern(kind) or kind in INERTIAL_KINDS or kind[:8] == "payload_"
                known = self.bodies if inertial else (*self.joints, *self.lines)
            gone = (*self.locked, *self.welded) if is_pattern(owner) else self.locked
            known = (*known, *(() if is_pattern(text) else (BASE, *self.locked)))
            found = by_name(path, key, {owner if kinds else text: table[text]}, known, gone)
            out |= {f"{name}.{k}": value for name, value in found.items() for k in kinds}
        return out


def settle_names(path: Path, extra: Sidecar, owners: Owners) -> Sidecar:
    """Return a sidecar in which every name that a pattern stands for is written out.

    Sums of symmetry of which a part is locked are no longer equal, and left out.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    extra : Sidecar
    owners : Owners

    Raises
    ------
    RobotError
        If it names what the robot does not have.
    """
    bodies, joints = (*owners.bodies, *owners.welded), (*owners.joints, *owners.locked)
    check_known(path, "symbols", extra.symbols, (*bodies, *joints, *owners.lines))
    check_known(path, "base_parameters", extra.base_parameters.bodies, bodies)
    check_known(path, "guessed", extra.guessed, bodies)
    check_known(path, "rest", extra.rest, joints)
    gone = {*owners.locked, *owners.welded}
    ties = []
    for entry in extra.symmetry:
        if any(name.rpartition(".")[0] in gone for names in entry.tie.values() for name in names):
            continue
        tie = {
            whole: [*owners.parameters(path, "symmetry", dict.fromkeys(names, True))]
            for whole, names in entry.tie.items()
        }
        ties.append(entry.model_copy(update={"tie": tie}))
    tables = {
        key: owners.parameters(path, key, getattr(extra, key))
        for key in ("nominal", "prior", "shapes", "reference")
    }
    own = {
        "limits": by_name(path, "limits", extra.limits, owners.joints, owners.locked),
        "prior_share": by_name(path, "prior_share", extra.prior_share, owners.bodies, gone),
        "symmetry": ties,
    }
    return extra.model_copy(update={**tables, **own})
