"""The sidecar: a TOML file beside the robot file with what the robot file cannot say.

Its tables may have patterns, ``wrist_*.Fv``, for every joint, motor and axis that fits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from identifiability.foundation.documents import read_document
from identifiability.foundation.errors import RobotError, listing
from identifiability.foundation.names import INERTIAL_KINDS, Renames, find_named, is_pattern
from identifiability.foundation.values import frozen
from identifiability.robot.markup import LARGEST, LONGEST_NAME
from identifiability.robot.measured_torque import Interpolation, Side
from identifiability.robot.servo import RATE

# The sidecar: a TOML file beside the robot file with what the robot file cannot say.
#
# Every key is optional::
#
# name = "3-RPS parallel robot"
# prior_relative = 1.0                 # width of the other priors (default: 1, the size itself)
# base = "fixed"                       # the root of a legged URDF was bolted down (asked for)
# actuated = ["joint1", "joint2"]      # which joints have a motor (default: <actuator>, or all)
# locked = ["finger"]                  # joints that do not move (or a table: finger = 0.02)
# angles = "deg"                       # unit of angles in the logs: rad or deg (default: rad,
#                                      # and what looks like degrees is refused)
# effects = ["joint_stiffness@roll"]   # effects of default models that are at some places only,
#                                      # as a ladder writes them
# massless = ["cross"]                 # links of a URDF between the axes of one joint (universal,
#                                      # ball), each carrying one joint: they are no bodies
# inertia_parts = ["Jr", "Js"]         # what an actuator's inertia is made of (default: Ia)
#
# [home] # joint = position; selects the assembly of a closed chain joint1 = 0.3
#
# [[loops]]                            # point closures, in the frames of the bodies
# name = "tip"
# body1 = "left_tip"
# point1 = [0.3, 0, 0]
# body2 = "right_tip"
# point2 = [0.3, 0, 0]
# axes = ["x", "z"]                    # directions in which it is demanded (default: all, which
#                                      # also a planar loop may have, at any yaw)
# frame = "table"                      # the body whose axes they are, as a slot turns with its
#                                      # body (default: the world's)
#
# [[couplings]] # joint = c0 + c1 of + c2 of² + …, beside the file's own joint = "joint3" of =
# "joint2" polynomial = [0, -1] terms = {joint1 = [0, 0.5, 0.1]} # further joints that are added, a
# polynomial each
#
# [transmission] # motor = ratio ∘ (coupling · (q - offset)); there may be motors = ["m1", "m2"] #
# more motors than joints coupling = [[1, 0], [1, 1]] ratio = [45, 32] offset = [0, 0]
#
# [[axes]] # a combination of joints on which effects can be name = "jaws" # (jaws.Fv, jaws.K …);
# fixed tendons of an MJCF along joints = {jaw2 = 1, jaw1 = -1} # several joints are axes by their
# own names rest = 0.1 # where a spring on it is relaxed (default: at home)
#
# [symbols] # short forms in labels: body or joint = symbol platform = "3"
#
# [base_parameters] bodies = ["arm2", "arm1"] # whose columns are kept first when columns are
# grouped
#
# [nominal] # parameter values beside those of the robot file "joint1.Fv" = 3.0
#
# [rest] # where the spring of a joint ("joint2.K") is relaxed joint2 = 0.4 # [rad or m] (default:
# as the robot file says, or at home)
#
# [shapes] # joint and effect = Stribeck velocity, period of a ripple "joint1.stribeck_friction" =
# 0.05 # [rad/s or m/s]
#
# [reference] # values by which the loads of load-dependent friction, "arm1.m" = 3.0 # a tilted
# base and a delay are known (default: nominal)
#
# [limits] # actuated joint = {q = [lo, hi], v = vmax, a = amax} joint1 = {q = [-1, 1], v = 2, a =
# 10}
#
# [columns] # column or joint in the logs = column or joint here, "fer_joint(\\d)" =
# "panda_joint\\1" # or a regular expression for the whole name
#
# [time]
# unit = "ms"                          # of `t` in the logs: s, ms, us or ns (default: s, or what
#                                      # can only be meant)
#
# [torque]                             # what torque columns hold: τ = sign · gain · ratio · value
# side = "motor"                       # at the rotor, or "link": behind the gear, where no rotor
#                                      # inertia is seen (default: at the joint, with all of it)
# gain = {joint1 = 0.11}               # K_t of a current [N·m/A]; or one number for all
# ratio = {joint1 = 100}               # of the gear
# sign = {joint1 = -1}
# compensated = true                   # without what holds the weight, which the driver took off
#                                      # (or a list of joints): the file's is added again
#
# [servo]                              # where logs hold commands and no torque:
# kp = 40                              # τ = kp (q_cmd − q) + kv (dq_cmd − dq) + τ_ff [N·m/rad],
# kv = {"*_knee" = 2, "*" = 1}         # [N·m·s/rad]; one number, or by joint
# limit = 30                           # torque beyond which it is saturated [N·m or N]
# delay = "auto"                       # of commands [s]; auto (default): logs tell it
# rate = 1000                          # at which it measures and acts [Hz] (default: 1000)
#
# [[known_torque]]                     # torque that motors supply beside all else, taken off the
# along = "joint2"                     # measured one: a joint, passive or not, or a coupled motor
# table = [[-1, 0.2], [0, 0], [1, -3]] # (position [rad or m], torque [N·m or N]), or polynomial =
# interpolation = "linear"             # [c0, c1, …] with range = [lo, hi]; linear, monotone or
#                                      # cubic between points, and never beyond the ends
#
# [prior] # normal priors of standard parameters "arm1.m" = {mean = 3.0, sd = 0.3} # the others:
# nominal ± prior_relative × their size
#
# [bounds]                             # what a real robot of this kind can have
# total_mass = [8.0, 12.0]             # of all moving bodies, without payload [kg]
# [bounds.bodies."leg*"]               # a body, or all whose names fit
# mass = [0.5, 2.0]                    # [kg]
# box = [[-0.1, 0.1], [-0.1, 0.1], [0.0, 0.4]]       # where its centre of mass is, along the
#                                      # axes of the body's frame in the robot file [m]
# ellipsoid = {centre = [0, 0, 0.2], radii = [0.1, 0.1, 0.3]}
#
# [[symmetry]] # columns that equal legs let us add name = "equal legs" tie = {"leg.my" =
# ["leg1.my", "leg2.my"]}
#
# In [nominal], [prior], [shapes], [reference], [limits] and the sums of [[symmetry]] a pattern
# such as ``wrist_*.Fv`` or ``leg?.my`` stands for all names that fit (passive joints too), ``*``
# being any letters and ``?`` one. A name goes before a pattern, and of two patterns the one that
# stands last.


Triple = tuple[float, float, float]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


def _unique(names: list[str]) -> list[str]:
    if len(set(names)) != len(names):
        raise ValueError("name each one once")
    return names


def _rising(span: tuple[float, float]) -> tuple[float, float]:
    if not span[0] < span[1]:
        raise ValueError("the lower limit must be below the upper one")
    return span


def _renaming(rules: dict[str, str]) -> dict[str, str]:
    Renames.of(rules)
    return rules


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
#: No value of a robot in SI units is larger.
Held = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
#: Coefficients of a polynomial.
DEGREE = 50


class LoopEntry(_Strict):
    """A point closure."""

    name: str = ""
    body1: str
    point1: Triple = (0.0, 0.0, 0.0)
    body2: str
    point2: Triple = (0.0, 0.0, 0.0)
    axes: list[Literal["x", "y", "z"]] = Field(default=["x", "y", "z"], min_length=1)
    frame: str | None = None


class _CouplingEntry(_Strict):
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
    motors: Names
    coupling: list[list[float]]
    ratio: list[float] | None = None
    offset: list[float] | None = None


class AxisEntry(_Strict):
    """A combination of joints that effects can be on."""

    name: str = Field(min_length=1)
    joints: dict[str, Factor] = Field(min_length=1)
    rest: float | None = None


class _BaseParametersEntry(_Strict):
    bodies: Names = []


class LimitEntry(_Strict):
    """Motion limits of an actuated joint."""

    q: Span | None = None
    v: float | None = Field(default=None, gt=0)
    a: float | None = Field(default=None, gt=0)
    tau: float | None = Field(default=None, gt=0)
    power: float | None = Field(default=None, gt=0)


class _TimeEntry(_Strict):
    unit: Literal["s", "ms", "us", "ns"] | None = None


class _TorqueEntry(_Strict):
    side: Side = "joint"
    gain: Factor | dict[str, Factor] | None = None
    ratio: Factor | dict[str, Factor] | None = None
    sign: Literal[1, -1] | dict[str, Literal[1, -1]] | None = None
    compensated: bool | Names | None = None


class _KnownTorqueEntry(_Strict):
    along: str
    table: list[tuple[float, float]] = []
    interpolation: Interpolation | None = None
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
        elif self.interpolation is not None:
            raise ValueError("a polynomial needs no interpolation; leave it out")
        return self


class ServoEntry(_Strict):
    """Position servos."""

    kp: Gain | dict[str, Gain] | None = None
    kv: Gain | dict[str, Gain] | None = None
    limit: Length | dict[str, Length] | None = None
    delay: Literal["auto"] | Annotated[float, Field(ge=0, le=1)] = "auto"
    rate: float = Field(default=RATE, gt=0)


class _SymmetryEntry(_Strict):
    name: str = ""
    tie: dict[str, list[str]]


class _EllipsoidEntry(_Strict):
    centre: Triple = (0.0, 0.0, 0.0)
    radii: tuple[Length, Length, Length]


class BodyBoundsEntry(_Strict):
    """What is known of a body."""

    mass: Masses | None = None
    box: tuple[Span, Span, Span] | None = None
    ellipsoid: _EllipsoidEntry | None = None


class BoundsEntry(_Strict):
    """What is known of masses and centres of mass."""

    total_mass: Masses | None = None
    bodies: dict[str, BodyBoundsEntry] = {}


class _PriorEntry(_Strict):
    mean: float
    sd: float = Field(gt=0)


class Sidecar(_Strict):
    """The whole file."""

    name: str = Field(default="", max_length=LONGEST_NAME)
    description: str = Field(default="", max_length=20 * LONGEST_NAME)
    base: Literal["fixed"] | None = None
    actuated: list[str] | None = None
    locked: Names | dict[str, float | None] = []
    angles: Literal["rad", "deg"] | None = None
    effects: Names = []
    massless: Names = []
    inertia_parts: Names = Field(default=["Ia"], min_length=1)
    home: dict[str, float] = {}
    loops: list[LoopEntry] | None = None
    couplings: list[_CouplingEntry] = []
    transmission: _TransmissionEntry | None = None
    axes: list[AxisEntry] = []
    symbols: dict[str, str] = {}
    base_parameters: _BaseParametersEntry = _BaseParametersEntry()
    nominal: dict[str, Held] = {}
    rest: dict[str, float] = {}
    shapes: dict[str, Annotated[float, Field(gt=0)]] = {}
    reference: dict[str, float] = {}
    limits: dict[str, LimitEntry] = {}
    columns: Annotated[dict[str, str], AfterValidator(_renaming)] = {}
    time: _TimeEntry = _TimeEntry()
    torque: _TorqueEntry = _TorqueEntry()
    servo: ServoEntry | None = None
    known_torque: list[_KnownTorqueEntry] = []
    symmetry: list[_SymmetryEntry] = []
    prior_relative: float = Field(default=1.0, gt=0)
    prior: dict[str, _PriorEntry] = {}
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


# Patterns in a sidecar's tables: ``wrist_*.Fv`` for every joint, motor and axis that fits.


V = TypeVar("V")


@frozen
class Owners:
    """What parameters can be named after.

    Attributes
    ----------
    bodies : tuple of str
    lines : tuple of str
        Joints, motors and axes.
    gone : tuple of str
        What is locked, and bodies behind it: a pattern may fit nothing else.
    """

    bodies: tuple[str, ...]
    lines: tuple[str, ...]
    gone: tuple[str, ...] = ()


def spread_patterns(path: Path, extra: Sidecar, owners: Owners) -> Sidecar:
    """Return a sidecar in which every name that a pattern stands for is written out.

    A name goes before a pattern, and of two patterns the one that stands last.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    extra : Sidecar
    owners : Owners

    Raises
    ------
    RobotError
        If nothing fits a pattern.
    """
    tables = {
        key: _spread(path, key, getattr(extra, key), owners)
        for key in ("nominal", "prior", "shapes", "reference")
    }
    limits: dict[str, LimitEntry] = {}
    for text in sorted(extra.limits, key=is_pattern, reverse=True):
        names = _fitting(path, "limits", text, owners.lines, owners.gone)
        limits |= dict.fromkeys(names, extra.limits[text])
    ties = [
        s.model_copy(
            update={
                "tie": {
                    name: [n for text in members for n in _named(path, "symmetry", text, owners)]
                    for name, members in s.tie.items()
                }
            }
        )
        for s in extra.symmetry
    ]
    return extra.model_copy(update={**tables, "limits": limits, "symmetry": ties})


def _spread(path: Path, key: str, table: Mapping[str, V], owners: Owners) -> dict[str, V]:
    out: dict[str, V] = {}
    for text in sorted(table, key=is_pattern, reverse=True):
        out |= dict.fromkeys(_named(path, key, text, owners), table[text])
    return out


def _named(path: Path, key: str, text: str, owners: Owners) -> list[str]:
    """Return the parameters that a text stands for; those of inertia are bodies'."""
    if not is_pattern(text):
        return [text]
    owner, _, kind = text.rpartition(".")
    kinds = find_named(kind, INERTIAL_KINDS) if is_pattern(kind) else [kind]
    of_bodies = is_pattern(kind) or kind in INERTIAL_KINDS or kind.startswith("payload_")
    known = owners.bodies if of_bodies else owners.lines
    return [
        f"{name}.{k}"
        for name in _fitting(path, key, owner if kinds else text, known, owners.gone, text)
        for k in kinds
    ]


def _fitting(
    path: Path, key: str, pattern: str, known: Sequence[str], gone: Sequence[str], text: str = ""
) -> list[str]:
    """Return the names that fit a pattern, none where only what is gone does; a name is itself."""
    if not is_pattern(pattern):
        return [pattern]
    found = find_named(pattern, known)
    if not found and not find_named(pattern, gone):
        raise RobotError(
            f"The sidecar of {path}: [{key}] has the pattern '{text or pattern}', which nothing "
            f"fits; the names are {listing(known)}."
        )
    return found
