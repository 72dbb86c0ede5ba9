"""The sidecar: a TOML file beside the robot file with what the robot file cannot say.

Every key is optional; each says here what it is, for the reader of this file and for
``docs/reference/sidecar.md``, which is written from it. In [nominal], [prior], [shapes],
[reference], [limits] and the sums of [[symmetry]] a pattern such as ``wrist_*.Fv`` or ``leg?.my``
stands for all names that fit (passive joints too), ``*`` being any letters and ``?`` one. A name
goes before a pattern, and of two patterns the one that stands last.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    model_validator,
)

from identifiability.foundation.documents import described, read_document
from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.names import BASE, INERTIAL_KINDS, Renames, find_named, is_pattern
from identifiability.foundation.values import frozen
from identifiability.robot.locate import find_sidecar, locate_robot
from identifiability.robot.markup import LARGEST, LONGEST_NAME
from identifiability.robot.measured_torque import Interpolation, Side

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
    """Positions and commands of a joint in the logs, in ticks, degrees or normalised units."""

    name: str | None = described(
        "The joint here, where the key is what logs call it.", "elbow", None
    )
    scale: Factor = described("What one is [rad or m].", 0.00153, 1.0)
    offset: float = described(
        "Position where the log holds zero [rad or m].", -3.14, 0.0, ge=-LARGEST, le=LARGEST
    )


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
    """A point of one body that coincides with a point of another: a closed chain."""

    name: str = described("Its name in reports.", "tip", "")
    body1: str = described("The one body.", "left_tip")
    point1: Triple = described("The point in its frame [m].", [0.3, 0, 0], (0.0, 0.0, 0.0))
    body2: str = described("The other body.", "right_tip")
    point2: Triple = described("The point in its frame [m].", [0.3, 0, 0], (0.0, 0.0, 0.0))
    axes: list[Literal["x", "y", "z"]] = described(
        "Directions in which it is demanded; a planar loop may have all, at any yaw.",
        ["x", "z"],
        lambda: ["x", "y", "z"],
        min_length=1,
    )
    frame: str | None = described(
        "The body whose axes they are, as a slot turns with its body; without it the world's.",
        "table",
        None,
    )


class _CouplingEntry(_Strict):
    """A joint that moves as a polynomial of others, beside what the robot file says."""

    name: str = described("Its name in reports.", "parallelogram", "")
    joint: str = described("The joint that follows.", "joint3")
    of: str | None = described("The joint that it follows.", "joint2", None)
    polynomial: list[float] = described(
        "``joint = c0 + c1 of + c2 of² + …``",
        [0, -1],
        lambda: [0.0, 1.0],
        min_length=1,
        max_length=DEGREE,
    )
    terms: dict[str, Annotated[list[float], Field(min_length=1, max_length=DEGREE)]] = described(
        "Further joints that are added, a polynomial each.", {"joint1": [0, 0.5, 0.1]}, dict
    )

    @model_validator(mode="after")
    def _two_joints(self) -> _CouplingEntry:
        if self.joint == self.of or self.joint in self.terms:
            raise ValueError("a joint cannot be coupled to itself; name another")
        return self


class _TransmissionEntry(_Strict):
    """Motors that are coupled: motor = ratio ∘ (coupling · (q − offset))."""

    motors: Names = described("Their names, also more than there are joints.", ["m1", "m2"])
    coupling: list[list[float]] = described(
        "What each motor turns by per joint, before its gear.", [[1, 0], [1, 1]]
    )
    ratio: list[float] | None = described("Ratios of the gears.", [45, 32], None)
    offset: list[float] | None = described(
        "Joint positions where motors are at zero.", [0, 0], None
    )


class AxisEntry(_Strict):
    """A combination of joints on which effects can be (jaws.Fv, jaws.K …).

    Fixed tendons of an MJCF along several joints are axes by their own names.
    """

    name: str = described("Its name.", "jaws", min_length=1)
    joints: dict[str, Factor] = described(
        "By how much each joint moves it.", {"jaw2": 1, "jaw1": -1}, min_length=1
    )
    rest: float | None = described(
        "Where a spring on it is relaxed; without it at home.", 0.1, None
    )


class _BaseParametersEntry(_Strict):
    """How dependent columns are grouped."""

    bodies: Names = described(
        "Bodies whose columns are kept first when columns are grouped.", ["arm2", "arm1"], list
    )


class LimitEntry(_Strict):
    """Motion limits of an actuated joint, for motions that are designed."""

    q: Span | None = described("Position [rad or m].", [-1, 1], None)
    v: float | None = described("Speed [rad/s or m/s].", 2, None, gt=0)
    a: float | None = described("Acceleration [rad/s² or m/s²].", 10, None, gt=0)
    tau: float | None = described("Torque [N·m or N].", 40, None, gt=0)
    power: float | None = described("Power [W].", 200, None, gt=0)


class _TimeEntry(_Strict):
    """The clock of logs."""

    unit: Literal["s", "ms", "us", "ns"] | None = described(
        "Unit of `t`; without it s, or what can only be meant.", "ms", None
    )


class _TorqueEntry(_Strict):
    """What torque columns hold: τ = sign · gain · ratio · value."""

    side: Side = described(
        "Where it was measured: at the joint with all of its rotor, at the `motor`'s rotor, or at "
        "the `link` behind the gear, where no rotor inertia is seen.",
        "motor",
        "joint",
    )
    gain: Factor | dict[str, Factor] | None = described(
        "Torque constants of currents [N·m/A]; one number, or by joint.", {"joint1": 0.11}, None
    )
    ratio: Factor | dict[str, Factor] | None = described("Of the gears.", {"joint1": 100}, None)
    sign: Literal[1, -1] | dict[str, Literal[1, -1]] | None = described(
        "−1 where a column counts the other way.", {"joint1": -1}, None
    )
    compensated: bool | Names | None = described(
        "Whether the driver took off what holds the weight (or of which joints): the file's is "
        "added again.",
        True,
        None,
    )


class _KnownTorqueEntry(_Strict):
    """Torque that is supplied beside the motor's, and taken off the measured one."""

    along: str = described("A joint, passive or not, or a coupled motor.", "joint2")
    table: list[tuple[float, float]] = described(
        "Points (position [rad or m], torque [N·m or N]).", [[-1, 0.2], [0, 0], [1, -3]], list
    )
    interpolation: Interpolation | None = described(
        "Between points: linear, monotone or cubic, and never beyond the ends.", "linear", None
    )
    polynomial: list[float] = described(
        "In place of a table: c0 + c1 q + …", [0, -2.5], list, max_length=DEGREE
    )
    range: Span | None = described("Positions between which the polynomial holds.", [-1, 1], None)

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
        elif self.interpolation is not None:
            raise ValueError("a polynomial needs no interpolation; leave it out")
        return self


class ServoEntry(_Strict):
    """Position servos, where logs hold commands and no torque.

    τ = kp (q_cmd − q) + kv (dq_cmd − dq) + τ_ff
    """

    kp: Fitted | dict[str, Fitted] | None = described(
        '[N·m/rad or N/m]; one number, or by joint; "fit" where logs shall tell it, as they do '
        "where nobody states any gain.",
        40,
        None,
    )
    kv: Fitted | dict[str, Fitted] | None = described(
        '[N·m·s/rad or N·s/m]; one number, or by joint, or "fit".', {"*_knee": 2, "*": 1}, None
    )
    limit: Length | dict[str, Length] | None = described(
        "Torque beyond which it is saturated [N·m or N]; where none is stated logs tell it.",
        30,
        None,
    )
    delay: Literal["auto"] | Annotated[float, Field(ge=0, le=1)] = described(
        "Of commands [s]; auto: logs tell it.", 0.004, "auto"
    )
    rate: Length | None = described(
        "At which the servo measures and acts [Hz]; 1000 where nobody says it.", 500, None
    )


class ImuEntry(_Strict):
    """How an inertial sensor is mounted on a base that floats.

    It reads a = R (a₀ + dω/dt × r + ω × (ω × r)) + b where the base's origin accelerates by a₀.
    """

    rotation: Triple = described(
        "Roll, pitch and yaw of the sensor on the base [rad].", [0, 0, 1.57], (0.0, 0.0, 0.0)
    )
    place: Triple = described("Where it is on the base [m].", [0, 0, 0.05], (0.0, 0.0, 0.0))
    acc_bias: Triple = described(
        "What the accelerometer reads too much [m/s²].", [0.1, 0, -0.05], (0.0, 0.0, 0.0)
    )
    gyro_bias: Triple = described(
        "What the gyroscope reads too much [rad/s].", [0.002, 0, 0], (0.0, 0.0, 0.0)
    )
    fit: list[Literal["rotation", "place", "acc_bias", "gyro_bias"]] = described(
        "Those of these that are known roughly: corrections of them are fitted (the effect "
        "`imu_mounting`).",
        ["place", "acc_bias"],
        list,
    )


class ContactEntry(_Strict):
    """Where the ground presses on a robot that floats, with a force that nobody measures.

    Without flag and schedule the contact never opens.
    """

    frame: str = described("A body, or a site or geom of an MJCF.", "FL_foot")
    kind: Literal["point", "surface"] = described(
        "Whether it transmits a force alone, or a moment, too.", "point", "point"
    )
    point: Triple = described("Its middle in that frame [m].", [0, 0, -0.2], (0.0, 0.0, 0.0))
    radius: Gain | None = described(
        "Of a round foot [m]; without it that of a sphere of the file is its own.", 0.02, None
    )
    flag: str = described("Column of logs that says when it is closed.", "FL_contact", "")
    threshold: float = described("Of that column, above which it is.", 10, 0.5)
    schedule: list[Span] | None = described(
        "Or between which times it is closed [s].", [[0, 1.5], [2, 4]], None
    )
    margin: Gain = described("How much longer on both sides it may be [s].", 0.02, 0.02)

    @model_validator(mode="after")
    def _one_of_both(self) -> ContactEntry:
        if self.flag and self.schedule is not None:
            raise ValueError("give either the column of a flag or a schedule")
        return self


class WrenchEntry(_Strict):
    """A force, and a moment, on a robot that floats which is measured."""

    frame: str = described("A body, site or geom, along whose axes it is.", "FL_foot")
    columns: Names = described(
        "Columns of logs: three [N], or six [N, N·m].", ["FL_fx", "FL_fy", "FL_fz"]
    )

    @model_validator(mode="after")
    def _three_or_six(self) -> WrenchEntry:
        if len(self.columns) not in (3, 6):
            raise ValueError("give three columns, of a force, or six, of a force and a moment")
        return self


class _SymmetryEntry(_Strict):
    """Columns that equal parts let us add."""

    name: str = described("Its name in reports.", "equal legs", "")
    tie: dict[str, list[str]] = described(
        "The parameter, and those that are equal to it.", {"leg.my": ["leg1.my", "leg2.my"]}
    )


class _EllipsoidEntry(_Strict):
    """Where a centre of mass is."""

    centre: Triple = described("In the body's frame [m].", [0, 0, 0.2], (0.0, 0.0, 0.0))
    radii: tuple[Length, Length, Length] = described("Along its axes [m].", [0.1, 0.1, 0.3])


class BodyBoundsEntry(_Strict):
    """What is known of a body, or of all whose names fit."""

    mass: Masses | None = described("Least and largest mass [kg].", [0.5, 2.0], None)
    box: tuple[Span, Span, Span] | None = described(
        "Where its centre of mass is, along the axes of the body's frame in the robot file [m].",
        [[-0.1, 0.1], [-0.1, 0.1], [0.0, 0.4]],
        None,
    )
    ellipsoid: _EllipsoidEntry | None = None


class BoundsEntry(_Strict):
    """What a real robot of this kind can have."""

    total_mass: Masses | None = described(
        "Least and largest mass of all moving bodies, without payload [kg].", [8.0, 12.0], None
    )
    bodies: dict[str, BodyBoundsEntry] = {}


class _PriorEntry(_Strict):
    """A normal prior of a standard parameter; others are nominal ± prior_relative × their size."""

    mean: float = described("In SI units.", 3.0)
    sd: float = described("In SI units.", 0.3, gt=0)


class Sidecar(_Strict):
    """What the robot file cannot say."""

    name: str = described("The robot's name.", "3-RPS parallel robot", "", max_length=LONGEST_NAME)
    description: str = described(
        "A sentence on it.", "Three legs carry a platform.", "", max_length=20 * LONGEST_NAME
    )
    base: Literal["fixed", "floating"] | None = described(
        "Whether the root of a legged robot, or of one that floats in its file, was bolted down "
        "(`fixed`), or nothing held it (`floating`).",
        "fixed",
        None,
    )
    stand: Triple | None = described(
        "Roll, pitch and yaw [rad] at which the root stood in the world where it was bolted down "
        "or hung up; without it as the file draws it.",
        [0, 1.57, 0],
        None,
    )
    actuated: list[str] | None = described(
        "Which joints have a motor; without it those of <actuator>, or all.",
        ["joint1", "joint2"],
        None,
    )
    locked: Names | dict[str, float | None] = described(
        "Joints that do not move, or a table with where they stand.", {"finger": 0.02}, list
    )
    angles: Literal["rad", "deg"] | None = described(
        "Unit of angles in logs; without it rad, and what looks like degrees is refused.",
        "deg",
        None,
    )
    effects: Names = described(
        "Effects of default models that are at some places only, as a ladder writes them.",
        ["joint_stiffness@roll"],
        list,
    )
    massless: Names = described(
        "Links of a URDF between the axes of one joint (universal, ball), each carrying one "
        "joint: they are no bodies.",
        ["cross"],
        list,
    )
    guessed: Names = described(
        "Bodies whose masses and inertias in the file are guesses, as those that a table "
        "leaves out: no torque is compared with what they ask for.",
        ["forearm"],
        list,
    )
    inertia_parts: Names = described(
        "What an actuator's inertia is made of.", ["Jr", "Js"], lambda: ["Ia"], min_length=1
    )
    home: dict[str, float] = described(
        "Joint positions; they select the assembly of a closed chain.", {"joint1": 0.3}, dict
    )
    loops: list[LoopEntry] | None = None
    couplings: list[_CouplingEntry] = []
    transmission: _TransmissionEntry | None = None
    axes: list[AxisEntry] = []
    symbols: dict[str, str] = described(
        "Short forms of bodies and joints in labels.", {"platform": "3"}, dict
    )
    base_parameters: _BaseParametersEntry = _BaseParametersEntry()
    nominal: dict[str, Value] = described(
        "Values of parameters beside those of the robot file.", {"joint1.Fv": 3.0}, dict
    )
    rest: dict[str, float] = described(
        "Where the spring of a joint (joint2.K) is relaxed [rad or m]; without it as the robot "
        "file says, or at home.",
        {"joint2": 0.4},
        dict,
    )
    shapes: dict[str, Annotated[float, Field(gt=0)]] = described(
        "Shapes by joint and effect: a Stribeck velocity [rad/s or m/s], the period of a ripple.",
        {"joint1.stribeck_friction": 0.05},
        dict,
    )
    reference: dict[str, float] = described(
        "Values by which the loads of load-dependent friction, a tilted base and a delay are "
        "known; without them nominal ones.",
        {"arm1.m": 3.0},
        dict,
    )
    limits: dict[str, LimitEntry] = {}
    columns: Annotated[dict[str, _ColumnRule], AfterValidator(_checked)] = described(
        "Column or joint in the logs = column or joint here; or a regular expression for the "
        "whole name. Or joint (or pattern) = scale and offset of its positions and commands.",
        {"fer_joint(\\d)": "panda_joint\\1", "elbow": {"scale": 0.00153, "offset": -3.14}},
        dict,
    )
    time: _TimeEntry = _TimeEntry()
    torque: _TorqueEntry = _TorqueEntry()
    servo: ServoEntry | None = None
    known_torque: list[_KnownTorqueEntry] = []
    imu: ImuEntry | None = None
    contacts: list[ContactEntry] = []
    wrench: list[WrenchEntry] = []
    symmetry: list[_SymmetryEntry] = []
    prior_relative: float = described(
        "Width of the priors that [prior] does not state, as a share of their size.",
        0.5,
        1.0,
        gt=0,
    )
    prior: dict[str, _PriorEntry] = {}
    prior_share: dict[str, Annotated[float, Field(gt=0, le=1)]] = described(
        "Bodies (or patterns) to the share within which each is the robot file's; of the others "
        "--prior is.",
        {"hand": 0.02, "link*": 0.1},
        dict,
    )
    bounds: BoundsEntry = BoundsEntry()
    preparation: dict[str, Any] = described(
        "How logs become motion: settings of --set, such as cutoff [Hz].", {"cutoff": 10.0}, dict
    )
    run: dict[str, Any] = described(
        "Where long work runs: settings of --set, such as workers.", {"workers": 4}, dict
    )
    fit: dict[str, Any] = described(
        "How parameters are estimated: settings of --set, such as estimator.",
        {"estimator": "ls"},
        dict,
    )


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


def read_settings(
    robot: str | Path, sidecar: str | Path | None = None
) -> dict[str, dict[str, Any]]:
    """Return the tables of a robot's sidecar that say how verbs work, by their names.

    Raises
    ------
    RobotError
    """
    path = find_sidecar(locate_robot(robot)) if sidecar is None else Path(sidecar)
    read = read_sidecar(path)
    return {"preparation": read.preparation, "run": read.run, "fit": read.fit}


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
