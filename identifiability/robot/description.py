"""`Description`: the data of a robot file that the rest of the library uses.

It holds closures, couplings, axes, tendons and transmissions, the values that a file states, and
known masses, centres and limits.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
import pinocchio as pin
from numpy.polynomial import Polynomial

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.names import GROUPED_KINDS, Array, NumberByName, Renames, Strings
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import Json, frozen

from .elastic import Spring
from .floating import SIX, Base
from .kinematics import DOWN, WORLD, Point, Tree, shortest_turn
from .locate import ROOTS, parse_xml, read_included
from .servo import Servo
from .sidecar import KnownTorque, MeasuredTorque, Sidecar

# Numbers of joints, tendons and actuators in robot files: one table of fields.


@frozen
class Field:
    """A number in an MJCF, by its word.

    Attributes
    ----------
    kinds : tuple of str
        Parameters that have its value: one level of dry friction holds for both directions.
    power : int
        Power of the coefficient that refers the number to a joint.
    urdf : str
        Its word in the ``<dynamics>`` of a URDF; empty if there is none.
    off : tuple of str
        Flags of MuJoCo that switch it off.
    signed : bool
        Whether it may be negative.
    """

    kinds: Strings
    power: int
    urdf: str = ""
    off: Strings = ()
    signed: bool = False


FIELDS = {
    "damping": Field(("Fv",), 2, "damping", ("DAMPER",)),
    "frictionloss": Field(("Fc", "Fc+", "Fc-"), 1, "friction", ("FRICTIONLOSS", "CONSTRAINT")),
    "armature": Field(("Ia",), 2),
    "stiffness": Field(("K",), 2, off=("SPRING",)),
    "offset": Field(("off",), 1, signed=True),
}

#: Kinds of parameters that are not negative, without those of rotors.
NOT_NEGATIVE = {"m", "Ixx", "Iyy", "Izz"}.union(
    *(field.kinds for field in FIELDS.values() if not field.signed)
)


def name_numbers(joint: str, numbers: NumberByName, inertia_parts: Strings) -> dict[str, float]:
    """Return the parameters of a joint from the numbers of a robot file.

    The inertia of an actuator goes to the first of its parts.
    """
    kinds = {word: field.kinds for word, field in FIELDS.items()} | {"armature": inertia_parts[:1]}
    return {f"{joint}.{kind}": value for word, value in numbers.items() for kind in kinds[word]}


# Parts of a robot: closures, axes, transmissions, and the statements of its file.


@frozen
class Transmission:
    """Motors that mix joints: ``motor = ratio ∘ (coupling · (q - offset))``.

    Friction and rotor inertia act on the motor side. They are referred to the output of the gear,
    i.e. along ``coupling · q``. There may be more motors than joints, for example with cables.
    Joint positions are then the least-squares fit to the motor positions.

    Attributes
    ----------
    motors : tuple of str
    coupling : (m, n)
        Rows are motors, columns the actuated joints; of rank n, so that m ≥ n.
    ratio : (m,)
        Gear ratios between the coupled coordinate and the motor's.
    offset : (n,) [rad or m]
        Joint position at motor position zero.
    """

    motors: Strings
    coupling: Array
    ratio: Array
    offset: Array

    def joint_side(self, q: Array, tau: Array) -> tuple[Array, Array]:
        """Return joint positions and torques (N, n) from motor positions and torques (N, m)."""
        return self.joint_rate(q) + self.offset, tau @ (self.ratio[:, None] * self.coupling)

    def joint_rate(self, rate: Array) -> Array:
        """Return joint velocities or accelerations (N, n) from those of motors (N, m)."""
        R = self.ratio[:, None] * self.coupling
        return np.linalg.lstsq(R, rate.T, rcond=None)[0].T

    def motor_rate(self, rate: Array) -> Array:
        """Return motor velocities or accelerations (N, m) from those of joints (N, n).

        A joint without a value leaves those motors open that move it.
        """
        moved = [np.flatnonzero(row) for row in self.coupling]
        rows = zip(self.ratio, self.coupling, moved, strict=True)
        return np.stack([ratio * (rate[:, at] @ row[at]) for ratio, row, at in rows], axis=1)


@frozen
class Link:
    """A body and the joint that carries it, which may turn about several axes at one point.

    Attributes
    ----------
    first, last : int
        Its joint's axes in the robot's tree.
    parent : int
        The body that carries it, or `WORLD`.
    """

    first: int
    last: int
    parent: int


@frozen
class Axis:
    """A line along which friction and rotor inertia act.

    It belongs to a joint, to a motor that drives several joints, or to a stated combination of
    joints.

    Attributes
    ----------
    name, symbol : str
    weights : mapping
        Joints that it runs along to their coefficients.
    row : (n,) or None
        Its speed is ``row · q̇_actuated``; None if it includes a passive joint (the row then
        varies).
    prismatic : bool
        Whether it is a translation; all its joints then slide.
    """

    name: str
    symbol: str
    weights: NumberByName
    row: Array | None
    prismatic: bool

    @property
    def mixed(self) -> bool:
        """Return whether it belongs to a motor that drives several joints, or was stated."""
        return self.name not in self.weights


@frozen
class Loop:
    """A point closure: a point of one body coincides with a point of another.

    `stated` is the entry of a sidecar: bodies, and points in their frames.
    """

    name: str
    first: Point
    second: Point
    stated: tuple[tuple[str, tuple[float, ...]], tuple[str, tuple[float, ...]]] | None = None


@frozen
class Coupling:
    """A joint that follows others: ``q_joint = constant + Σ_j p_j(q_j)``.

    With one joint it is an MJCF ``<joint>`` equality or a URDF mimic.

    Attributes
    ----------
    name, joint : str
    constant : float
    terms : mapping
        Followed joint to the polynomial of its position, without constant term.
    """

    name: str
    joint: str
    constant: float
    terms: Mapping[str, tuple[float, ...]]

    @staticmethod
    def of(
        name: str, joint: str, terms: Mapping[str, Sequence[float]], constant: float = 0.0
    ) -> Coupling:
        """Return a coupling whose polynomials may have constants."""
        constant += sum(float(poly[0]) for poly in terms.values())
        bare = {of: (0.0, *map(float, poly[1:])) for of, poly in terms.items()}
        return Coupling(name, joint, constant, bare)

    def held(self, locked: NumberByName) -> Coupling:
        """Return the coupling after some of the followed joints are fixed."""
        still = [(of, poly) for of, poly in self.terms.items() if of in locked]
        constant = self.constant + sum(float(Polynomial(p)(locked[of])) for of, p in still)
        moving = {of: poly for of, poly in self.terms.items() if of not in locked}
        return Coupling(self.name, self.joint, constant, moving)

    def through(self, others: Sequence[Coupling]) -> Coupling:
        """Return the coupling as a sum over joints that follow no other by one of some couplings.

        Couplings to several joints stay.
        """
        inner = {c.joint: Polynomial(c.polynomial) for c in others if len(c.terms) == 1}
        leads = {c.joint: next(iter(c.terms)) for c in others if len(c.terms) == 1}
        terms = {of: Polynomial(poly) for of, poly in self.terms.items()}
        while followers := terms.keys() & leads.keys():
            joint = min(followers)
            of = leads[joint]
            before = terms.get(of, Polynomial([0.0]))
            terms[of] = before + terms.pop(joint)(inner[joint])
        powers = {of: poly.coef.tolist() for of, poly in terms.items()}
        return Coupling.of(self.name, self.joint, powers, self.constant)

    @property
    def polynomial(self) -> tuple[float, ...]:
        """Of the only joint that is followed, with the constant."""
        (poly,) = self.terms.values() or ((0.0,),)
        return (self.constant, *poly[1:])


@frozen
class Cable:
    """A tendon whose length is a coordinate: a slide of the tree has its name and its length.

    Attributes
    ----------
    name : str
    points : tuple of Point
        It runs straight from point to point; none if it runs along joints.
    along : Coupling or None
        Its length as a sum of joints.
    """

    name: str
    points: tuple[Point, ...] = ()
    along: Coupling | None = None


@frozen(kw_only=True)
class Stated:
    """The statements of a robot file.

    Attributes
    ----------
    model : pinocchio.Model
    tree : Tree
    carriers : tuple of int
        Joints of the model that carry a body; the others are axes of these at the same place.
    loops, couplings : tuple
    driven : list of str or None
        Joints with actuators; None if the file names none.
    listed : tuple of str
        All joints with one axis, locked ones too, in the order of the file: carriers first.
    home : (nq,)
        The configuration that selects the assembly of a closed chain.
    posed : bool
        Whether a keyframe states `home`.
    numbers : mapping
        Numbers by joint, straight tendon or combination of joints, then by word of `FIELDS`.
    rests : mapping
        Rest positions of the springs of these [rad or m].
    spans, speeds : mapping
        Limits of position and speed of joints and straight tendons, if there are any.
    locked : mapping
        Locked joint to position [rad or m]; none of them is in the tree.
    welded : mapping
        Body behind a locked joint to its ten parameters, in the frame of the joint that carries it.
    springs : mapping
        Springs between motor and link, by the joint of the motor. They stand still.
    combinations : mapping
        Tendons along several joints that have friction, a rotor or a spring, and stated axes: by
        name, then joint, the coefficient.
    cables : tuple of Cable
        The last joints of `tree` are their slides, the last coordinates of `home` their lengths.
    outside : tuple of str
        Bodies of a scene that no actuated joint reaches. They are left out, with all bodies behind
        them.
    meshes : tuple of Path
        Meshes from which an MJCF takes inertias.
    gears : mapping
        Joint to gear, for joints with exactly one actuator.
    servos : mapping
        Joint or tendon to kp, kv, least and largest torque, (4,).
    offsets : mapping
        Constant torque of commands [N·m or N], by joint and straight tendon whose actuator can hold
        one.
    base : Base or None
        The base of a floating robot. The first six joints represent it, and the model has no
        gravity.
    radii : mapping
        Radii of spheres by the name of the geom [m].
    """

    model: Any
    tree: Tree
    carriers: tuple[int, ...]
    loops: tuple[Loop, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    driven: list[str] | None
    listed: Strings = ()
    home: Array
    posed: bool = False
    numbers: Mapping[str, NumberByName] = {}
    rests: Mapping[str, float] = {}
    spans: Mapping[str, tuple[float, float]] = {}
    speeds: Mapping[str, float] = {}
    locked: Mapping[str, float] = {}
    welded: Mapping[str, Array] = {}
    springs: Mapping[str, Spring] = {}
    combinations: Mapping[str, NumberByName] = {}
    cables: tuple[Cable, ...] = ()
    outside: Strings = ()
    meshes: tuple[Path, ...] = ()
    gears: Mapping[str, float] = {}
    servos: Mapping[str, Array] = {}
    offsets: Mapping[str, float] = {}
    base: Base | None = None
    radii: Mapping[str, float] = {}


# Known limits of masses and centres of mass.


@frozen
class Bound:
    """Known limits of the mass of bodies, or of the centre of mass of one.

    Attributes
    ----------
    bodies : tuple of str
        Bodies whose masses add up; only one if its centre is limited.
    mass : (float, float) or None [kg]
    box : three pairs or None [m]
        Limits of the centre of mass along the axes of the body's frame.
    rotation, origin : (3, 3), (3,) [m]
        The body's frame in that of its joint, to which parameters refer.
    """

    bodies: Strings
    mass: tuple[float, float] | None = None
    box: tuple[tuple[float, float], ...] | None = None
    rotation: Array = np.eye(3)
    origin: Array = np.zeros(3)


# `Description`: the data of a robot file that the rest of the library uses.


_NO_PLACES = np.empty(0, int)


@frozen
class Tilt:
    """A base whose direction of gravity differs from the robot file's.

    Attributes
    ----------
    direction : (3,)
        Of gravity in the file's world, a unit vector.
    degrees : float
        Between it and the direction that the file states.
    """

    direction: Array
    degrees: float

    @staticmethod
    def of(stated: Array, found: Array) -> Tilt:
        """Return the tilt of a gravity (3,) against the one that a file states."""
        angle = float(np.linalg.norm(shortest_turn(stated, found)))
        return Tilt(found / np.linalg.norm(found), float(np.degrees(angle)))

    @property
    def text(self) -> str:
        """Return the direction of gravity in words, to follow "gravity"."""
        x, y, z = (f"{c:.3f}".replace("-", "−") for c in self.direction.round(3) + 0.0)
        return (
            f"points along ({x}, {y}, {z}) in the world of the robot file, {self.degrees:.3g}° "
            "from the direction that the file states"
        )

    def to_dict(self) -> Json:
        """Return it as plain values."""
        return {"direction": self.direction.tolist(), "degrees": self.degrees}


@frozen(kw_only=True)
class Description(Stated):
    """All known data of a robot: its file's statements and further ones; `Robot` reads one.

    Attributes
    ----------
    name, title : str
        Short name and title for reports.
    path : Path
        The robot file; `sidecar` is its TOML file, if any.
    said : Sidecar
        Its keys, with patterns replaced by the names that fit.
    bodies : tuple of str
        Names of the moving bodies, in the order of `carriers`.
    symbols : mapping
        Short forms of names for labels, if the sidecar has some.
    actuated, dependent : (n,), (n_e,) int
        Indices of degrees of freedom in ``v``.
    assembled : bool
        Whether `home` was found by closing the loops, because the files do not state it.
    nominal : mapping
        Parameter values stated in the file (``slider1.Fv`` …), without the inertial ones.
    limits : (n, 2) [rad or m]
        Position limits of the actuated joints; infinite if the file has none.
    speed_limits, acceleration_limits : (n,)
        Limits of their velocity and acceleration.
    rest : mapping
        Rest positions of the file's springs; other springs are relaxed at home.
    prior : mapping
        Stated (mean, sd) by name.
    guessed : tuple of str
        Bodies whose masses in the file are guesses.
    inertia_parts : tuple of str
        Kinds that make up the inertia of an actuator (``Ia``, or rotor and screw).
    shapes : mapping
        Shapes of effects by ``<joint>.<effect>``; others have the default of the effect.
    reference : mapping
        Standard parameters of known loads, if they differ from the nominal ones.
    columns : Renames
        Rules from columns or joints of its logs to those of the robot.
    scales : mapping
        Joint or motor to scale and offset: its positions and commands in logs are scale × value +
        offset [rad or m].
    time_unit : str
        Unit of the times in its logs; empty if not stated.
    torque : MeasuredTorque
        The contents of the torque columns of its logs.
    known_torque : tuple of KnownTorque
        Torque as a function of a position; it is subtracted from measured torque first.
    angles : {"rad", "deg"} or None
        Unit of the angles in its logs; None if not stated: rad, unless the values contradict it.
    lock_option : tuple of str
        Joints that an option locked when the robot was loaded, and its files do not.
    bounds : tuple of Bound
        Known limits of masses and centres of mass.
    tendons : tuple of str
        Names of the `combinations` in the robot file itself.
    upright : (3,) [m/s²] or None
        Gravity of the file, if another direction replaced it (`turned`).
    servo : Servo or None
        Position servos of the actuated joints, if the files state some.
    base_option : {"fixed", "floating"} or None
        Option for the base when the robot was loaded, which its files do not state.
    """

    name: str
    title: str
    path: Path
    sidecar: Path | None
    said: Sidecar
    bodies: Strings
    symbols: Mapping[str, str]
    actuated: Array = _NO_PLACES
    dependent: Array = _NO_PLACES
    nominal: Mapping[str, float] = {}
    limits: Array = _NO_PLACES
    speed_limits: Array = _NO_PLACES
    acceleration_limits: Array = _NO_PLACES
    transmission: Transmission | None = None
    guessed: Strings = ()
    inertia_parts: Strings = ("Ia",)
    prior: Mapping[str, tuple[float, float]] = {}
    ties: tuple[Mapping[str, Strings], ...] = ()
    rest: Mapping[str, float] = {}
    shapes: Mapping[str, float] = {}
    reference: Mapping[str, float] = {}
    columns: Renames = Renames()
    scales: Mapping[str, tuple[float, float]] = {}
    time_unit: str = ""
    torque: MeasuredTorque = MeasuredTorque()
    known_torque: tuple[KnownTorque, ...] = ()
    angles: str | None = None
    lock_option: Strings = ()
    bounds: tuple[Bound, ...] = ()
    tendons: Strings = ()
    assembled: bool = False
    upright: Array | None = None
    servo: Servo | None = None
    base_option: str | None = None

    @cached_property
    def sha256(self) -> str:
        """Return a hash of the robot file, its includes, meshes with inertia, and its sidecar."""
        files = (self.path, *read_included(self.path)[1], *self.meshes)
        digest = hashlib.sha256()
        for file in (*files, self.sidecar) if self.sidecar is not None else files:
            digest.update(file.read_bytes())
        if self.locked:  # an option may have locked them
            digest.update(repr(sorted(self.locked.items())).encode())
        if self.base_option is not None:
            digest.update(self.base_option.encode())
        return digest.hexdigest()

    @cached_property
    def mjcf(self) -> bool:
        """Return whether the robot file is MJCF; else it is URDF."""
        return bool(parse_xml(self.path, ROOTS).tag == "mujoco")

    @property
    def known_servo(self) -> Servo | None:
        """The servos, if all their gains are known."""
        if self.servo is None or self.servo.unknown.any():
            return None
        return self.servo

    @property
    def identity(self) -> Json:
        """Return the robot's entry in the JSON of results, such as name, hash and locked joints."""
        said: Json = {"name": self.name, "title": self.title, "sha256": self.sha256}
        if self.tilt is not None:
            said |= {"gravity": self.tilt.to_dict()}
        if self.locked:
            said |= {"locked": dict(self.locked)}
        if self.outside:
            said |= {"left_out": list(self.outside)}
        if self.assembled:
            said |= {"home": self.home_table}
        known = [k.text for k in self.known_torque]
        return said | ({"known_torque": known} if known else {})

    @property
    def gravity(self) -> Array:
        """Gravity in the file's world, (3,) [m/s²]."""
        return np.array(self.model.gravity.linear)

    def turned(self, direction: Array) -> Self:
        """Return the robot with gravity along another direction of the file's world.

        Use it for a base that is not mounted as the file states. The file does not change. A file
        that is written from the new robot states the new direction.

        Parameters
        ----------
        direction : (3,)
        """
        size = float(np.linalg.norm(self.gravity))
        direction = np.asarray(direction, float)
        if not (size and direction.any()):
            return self
        model = self.model.copy()
        model.gravity.linear = size * direction / np.linalg.norm(direction)
        upright = self.gravity if self.upright is None else self.upright
        return replace(self, model=model, upright=upright)

    @property
    def tilt(self) -> Tilt | None:
        """Return the tilt of the base relative to the file; None if it has none."""
        if self.upright is None:
            return None
        return Tilt.of(self.upright, self.gravity)

    @property
    def closed(self) -> bool:
        """Return whether the robot has loops or coupled joints."""
        return len(self.dependent) > 0

    @cached_property
    def equations(self) -> int:
        """Return the number of loop equations, including redundant ones."""
        return 3 * len(self.loops) + len(self.couplings) + len(self.cables)

    @property
    def nv(self) -> int:
        """Degrees of freedom of the tree."""
        return self.tree.nv

    @cached_property
    def dofs(self) -> Strings:
        """Names of the tree's degrees of freedom in the order of ``v``."""
        named = sorted((j.iv + k, d) for j in self.tree.joints for k, d in enumerate(j.dofs))
        return tuple(d for _, d in named)

    @cached_property
    def joints(self) -> Strings:
        """Names of the actuated joints."""
        return tuple(self.dofs[k] for k in self.actuated)

    @property
    def motor_joints(self) -> Strings:
        """Names of the joints that motors drive: all actuated ones but those of a floating base."""
        if self.base is None:
            return self.joints
        return self.joints[SIX:]

    def check_stands(self, what: str) -> None:
        """Refuse a floating robot for a use that needs a fixed base.

        Parameters
        ----------
        what : str
            The use, in the gerund.

        Raises
        ------
        RobotError
        """
        if self.base is not None:
            raise RobotError(
                f"{self.path} floats, and {what} of robots that float is not supported: put it "
                'on a stand (--set base=fixed, or base = "fixed" in its sidecar).'
            )

    @cached_property
    def slides(self) -> np.ndarray:
        """Return whether each actuated joint slides, (n,) bool."""
        return np.array([self.is_prismatic(int(k)) for k in self.actuated], bool)

    @property
    def position_units(self) -> Strings:
        """Units of the position of each actuated joint: m or rad."""
        return tuple("m" if slides else "rad" for slides in self.slides)

    @property
    def torque_units(self) -> Strings:
        """N or N·m for each actuated joint."""
        return tuple("N" if slides else "N·m" for slides in self.slides)

    def torque_column(self, joint: str) -> str:
        """Return the joint or motor under which the sidecar states the gain of a joint's torque.

        Logs of a robot with a [transmission] hold torque of motors. The name is empty if several
        motors make the torque of the joint, so that no gain alone corrects it.
        """
        gear = self.transmission
        stated = joint in self.torque.table("gain")
        if gear is None or stated or joint not in self.motor_joints:
            return joint
        share = gear.coupling[:, self.motor_joints.index(joint)]
        alone = np.flatnonzero(share)
        return gear.motors[alone[0]] if len(alone) == 1 else ""

    @cached_property
    def passive(self) -> Strings:
        """Names of the passive degrees of freedom."""
        return tuple(self.dofs[k] for k in self.dependent)

    def dof_index(self, name: str) -> int:
        """Return the index of a degree of freedom in ``v``."""
        try:
            return self.dofs.index(name)
        except ValueError:
            raise RobotError(
                f"{self.path.name} has no joint '{name}'{near_match(name, self.dofs)} "
                f"Its joints are {', '.join(self.dofs)}."
            ) from None

    def is_prismatic(self, dof: int) -> bool:
        """Return whether the degree of freedom with this index slides."""
        for j in self.tree.joints:
            if j.iv <= dof < j.iv + j.nv:
                return j.kind == "prismatic" or (j.kind == "free" and dof < j.iv + 3)
        raise IndexError(dof)

    def dof_position(self, q: Array, name: str) -> Array:
        """Return the coordinate of a one-dof joint at configurations (N, nq), (N,)."""
        self.dof_index(name)
        if name not in self.tree.single:
            raise RobotError(f"Joint '{name}' of {self.path.name} has no scalar position.")
        return q[:, self.tree.single[name].iq]

    def actuated_positions(self, q: Array) -> Array:
        """Return the coordinates of the actuated joints at configurations (N, nq), (N, n)."""
        return np.stack([self.dof_position(q, name) for name in self.joints], 1)

    def configuration(self, q: Array) -> Array:
        """Return full configurations (N, nq) with actuated positions `q`, the rest at home."""
        full = np.repeat(self.home[None], len(q), 0)
        places = [self.tree.single[name].iq for name in self.joints]
        full[:, places] = q
        return full

    def describe_home(self) -> str:
        """Return the home positions of the actuated joints as ``slider1 = 0.7, …``."""
        names = self.motor_joints
        at = self.actuated_positions(self.home[None])[0, -len(names) :]
        return ", ".join(f"{n} = {x:.4g}" for n, x in zip(names, at, strict=True))

    def describe_assembly(self) -> str:
        """Return a sentence on a home that was computed, or nothing."""
        if not self.assembled:
            return ""
        at = listing(f"{name} = {x:.4g}" for name, x in self.home_table.items())
        return (
            f"{self.path.name} states no home position, so the one that closes its loops and is "
            f"nearest to the drawn one is used ({at}). If the robot is assembled otherwise, the "
            "results are wrong: state its home position."
        )

    @property
    def home_table(self) -> dict[str, float]:
        """Home positions of the joints that turn or slide [rad or m]."""
        return {name: float(self.home[joint.iq]) for name, joint in self.tree.single.items()}

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        """Every actuated joint, every motor whose coordinate mixes joints, every stated axis."""
        found = [(name, {name: 1.0}) for name in self.motor_joints]
        if self.transmission is not None:
            for name, row in zip(self.transmission.motors, self.transmission.coupling, strict=True):
                pairs = zip(self.motor_joints, row.tolist(), strict=True)
                weights = {joint: c for joint, c in pairs if c}
                if len(weights) > 1:
                    found += [(name, weights)]
        found += [(name, dict(weights)) for name, weights in self.combinations.items()]
        return tuple(self._axis(name, weights) for name, weights in found)

    @cached_property
    def links(self) -> tuple[Link, ...]:
        """Return the link of each of its bodies to the body before it."""
        owner = {WORLD: WORLD} | {joint - 1: k for k, joint in enumerate(self.carriers)}
        links = []
        for last in (joint - 1 for joint in self.carriers):
            first = last
            while (above := self.tree.joints[first].parent) not in owner:
                first = above
            links.append(Link(first, last, owner[above]))
        return tuple(links)

    @cached_property
    def tendon_axes(self) -> Strings:
        """Return the axes of several joints whose numbers the robot's file can state as tendons."""
        return self.mixed_axes if self.mjcf else self.tendons

    @cached_property
    def mixed_axes(self) -> Strings:
        """Return the axes of several joints whose numbers an MJCF can state as tendons."""
        mixed = (axis.name for axis in self.axes if axis.mixed)
        return tuple(dict.fromkeys((*self.tendons, *mixed)))

    def _axis(self, name: str, weights: NumberByName) -> Axis:
        inside = weights.keys() <= {*self.joints}
        row = np.array([weights.get(joint, 0.0) for joint in self.joints]) if inside else None
        slides = all(self.is_prismatic(self.dof_index(joint)) for joint in weights)
        return Axis(name, self.symbols.get(name, name), weights, row, slides)

    def along(self, axis: Axis, x: Array) -> Array:
        """Return velocities or accelerations (N, nv) of the tree along an axis, (N,)."""
        columns = [*map(self.dof_index, axis.weights)]
        factors = [*axis.weights.values()]
        return x[:, columns] @ factors

    def travel(self, axis: Axis, q: Array, start: Array | None = None) -> Array:
        """Return how far configurations (N, nq) are along an axis, (N,) [rad or m].

        From the zeros of its joints, or from a configuration (nq,).
        """
        at = [self.tree.single[joint].iq for joint in axis.weights]
        moved = q[:, at] if start is None else q[:, at] - start[at]
        return moved @ [*axis.weights.values()]

    @cached_property
    def passive_axes(self) -> tuple[Axis, ...]:
        """Return the axes of passive one-dof joints; balls have no friction law with one axis."""
        return tuple(self._axis(d, {d: 1.0}) for d in self.passive if d in self.tree.single)

    def column_preference(self, names: Strings) -> list[int]:
        """Return column indices in the order in which the grouping keeps them.

        Bodies that the sidecar names come first, each with its mass last.
        """
        order = dict.fromkeys((*self.said.base_parameters.bodies, *self.bodies))
        wanted = [f"{b}.{kind}" for b in order for kind in GROUPED_KINDS]
        rank = {name: k for k, name in enumerate(wanted)}
        return sorted(range(len(names)), key=lambda k: rank.get(names[k], len(rank)))


#: A position or speed from which on a file means that there is no limit [rad or m, and per s].
ENDLESS: Tolerance = 1e6


def write_gravity(robot: Description) -> str:
    """Return what states the robot's direction of gravity in its file."""
    if robot.mjcf:
        numbers = " ".join(f"{c:.4g}" for c in robot.gravity.round(4) + 0.0)
        return f'<option gravity="{numbers}"/>'
    turn = pin.exp3(shortest_turn(robot.gravity, DOWN))
    # Zero is added so that no angle is written as -0.
    rounded = pin.rpy.matrixToRpy(turn).round(4) + 0.0
    angles = " ".join(f"{a:.4g}" for a in rounded)
    return f'a new first link, and below it a fixed joint with rpy="{angles}"'
