"""Parts of a robot: closures, axes, couplings, how motors drive joints, what its file states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot.kinematics import Point, Tree
from identifiability.robot.servo import JointServo

# Parts of a robot: closures, axes, how motors drive joints, and what its file states of them.


@frozen
class Transmission:
    """Motors that mix joints: ``motor = ratio ∘ (coupling · (q - offset))``.

    Friction and rotor inertia act on the motor side and are stated referred to the output of the
    gear, i.e. along ``coupling · q``. There may be more motors than joints, as where cables pull:
    their positions then agree up to their errors, of which the joints take the least squares.

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

    motors: tuple[str, ...]
    coupling: Array
    ratio: Array
    offset: Array

    def joint_side(self, q: Array, tau: Array) -> tuple[Array, Array]:
        """Return joint positions and torques (N, n) from motor positions and torques (N, m)."""
        return self.joint_rate(q) + self.offset, tau @ (self.ratio[:, None] * self.coupling)

    def joint_rate(self, rate: Array) -> Array:
        """Return joint velocities or accelerations (N, n) from those of motors (N, m)."""
        R = self.ratio[:, None] * self.coupling
        square = len(R) == R.shape[1]
        out = np.linalg.solve(R, rate.T) if square else np.linalg.lstsq(R, rate.T, rcond=None)[0]
        return np.asarray(out.T)


@frozen
class Axis:
    """A line along which friction and rotor inertia act.

    It is a joint's, that of a motor which drives several, or a stated combination of joints.

    Attributes
    ----------
    name, symbol : str
    row : (n,) or None
        Its speed is ``row · q̇_actuated``; None where a passive joint has a part (the row then
        varies).
    dof : int
        Index in ``v`` of the joint (axes of one passive joint only, else -1).
    prismatic : bool
        Whether it slides; a combination does where all its joints do, or stated so.
    weights : mapping or None
        Joint to its coefficient, of a stated combination.
    """

    name: str
    symbol: str
    row: Array | None
    dof: int
    prismatic: bool
    weights: Mapping[str, float] | None = None

    @property
    def mixed(self) -> bool:
        """Whether it is the axis of a motor that drives several joints, or a stated one."""
        return self.weights is not None or (
            self.row is not None and int(np.count_nonzero(self.row)) > 1
        )

    def along(self, joints: Sequence[str]) -> dict[str, float]:
        """Return the joints, of the actuated ones, that it runs along, with their coefficients."""
        if self.weights is not None:
            return dict(self.weights)
        assert self.row is not None
        return {joint: c for joint, c in zip(joints, self.row.tolist(), strict=True) if c}


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
        Joint that is followed to the polynomial of its position, which has no constant.
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

    def held(self, locked: Mapping[str, float]) -> Coupling:
        """Return the coupling where some of the joints that are followed stand still."""
        still = [(of, poly) for of, poly in self.terms.items() if of in locked]
        constant = self.constant + sum(float(Polynomial(p)(locked[of])) for of, p in still)
        moving = {of: poly for of, poly in self.terms.items() if of not in locked}
        return Coupling(self.name, self.joint, constant, moving)

    @property
    def polynomial(self) -> tuple[float, ...]:
        """Of the only joint that is followed, with the constant."""
        (poly,) = self.terms.values() or ((0.0,),)
        return (self.constant, *poly[1:])


@frozen
class Combination:
    """A stated combination of joints, and what a robot file says of forces along it.

    Attributes
    ----------
    weights : mapping
        Joint to its coefficient.
    numbers : mapping
        By the words of a robot file: ``damping``, ``frictionloss``, ``armature``, ``stiffness``.
    rest : float or None [rad or m]
        Where a spring along it is relaxed; None where it is so at home.
    """

    weights: Mapping[str, float]
    numbers: Mapping[str, float] = field(default_factory=dict)
    rest: float | None = None


@frozen
class Segment:
    """What runs straight from a point of one body to a point of another.

    Attributes
    ----------
    first, second : Point
    part : float
        How much of its length counts, less than one behind a pulley.
    """

    first: Point
    second: Point
    part: float = 1.0


@frozen
class Cable:
    """A tendon of straight segments; a slide of the tree has its name and its length.

    Attributes
    ----------
    name : str
    segments : tuple of Segment
    numbers : mapping
        ``damping`` [N·s/m], ``frictionloss`` [N] and ``armature`` [kg] that the file states.
    limits : tuple of float [m]
        Of its length.
    """

    name: str
    segments: tuple[Segment, ...]
    numbers: Mapping[str, float] = field(default_factory=dict)
    limits: tuple[float, float] = (-np.inf, np.inf)


@frozen
class Entry:
    """An entry of an array that MuJoCo keeps.

    Attributes
    ----------
    column : str
        Of a log: ``<joint>.q`` …
    factor : float
        What its values are multiplied by.
    low, high : float
        Beyond which they act no further.
    """

    column: str
    factor: float = 1.0
    low: float = -np.inf
    high: float = np.inf


@frozen
class Stated:
    """What a robot file states.

    Attributes
    ----------
    model : pinocchio.Model
    tree : Tree
    last : mapping
        Where each Pinocchio joint ends in the tree.
    loops, couplings : list
    actuated : list of str or None
        None where the file names no actuator.
    home : (nq,) or None
        None is the zero configuration.
    posed : bool
        Whether a keyframe states `home`.
    springs : mapping
        Joint to stiffness [N·m/rad or N/m] and position at which it is relaxed.
    locked : mapping
        Locked joint to position [rad or m]; none of them is in the tree.
    welded : mapping
        Body behind a locked joint to its ten parameters in the frame of the joint that it hangs on.
    combinations : mapping
        Tendons along several joints that have friction, a rotor or a spring.
    cables : tuple of Cable
        The last joints of `tree` are their slides, the last coordinates of `home` their lengths.
    outside : tuple of str
        Bodies of a scene that no actuated joint reaches, at which what is left out begins.
    meshes : tuple of Path
        From which an MJCF takes inertias.
    entries : mapping
        Of arrays that MuJoCo keeps, by array, then index or name.
    servos : mapping
        Of joints, by name.
    offsets : mapping
        Constant torque of commands [N·m or N], by every joint and straight tendon whose actuator
        can hold one.
    floating : str or None
        What the file calls the joint on which the robot floats, of which six joints stand first
        in the tree; None where it stands.
    gravity : (3,) or None [m/s²]
        Of a robot that floats: its model has none.
    at : (int, int) or None
        Where MuJoCo keeps pose and twist of the base.
    which : int or None
        Of the free joints of an MJCF the one on which the robot floats.
    radii : mapping
        Of spheres, by the name of the geom [m].
    drawn : (3, 3)
        How the file turns the root of a robot that stands.
    """

    model: Any
    tree: Tree
    last: Mapping[int, int]
    loops: list[Loop]
    couplings: list[Coupling]
    actuated: list[str] | None
    home: Array | None = None
    posed: bool = False
    springs: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    locked: Mapping[str, float] = field(default_factory=dict)
    welded: Mapping[str, Array] = field(default_factory=dict)
    combinations: Mapping[str, Combination] = field(default_factory=dict)
    cables: tuple[Cable, ...] = ()
    outside: tuple[str, ...] = ()
    meshes: tuple[Path, ...] = ()
    entries: Mapping[str, Mapping[str, Entry]] = field(default_factory=dict)
    servos: Mapping[str, JointServo] = field(default_factory=dict)
    offsets: Mapping[str, float] = field(default_factory=dict)
    floating: str | None = None
    gravity: Array | None = None
    at: tuple[int, int] | None = None
    which: int | None = None
    radii: Mapping[str, float] = field(default_factory=dict)
    drawn: Array = field(default_factory=lambda: np.eye(3))


def name_numbers(
    joint: str, numbers: Mapping[str, float], inertia_parts: tuple[str, ...]
) -> dict[str, float]:
    """Return the parameters of a joint of which a robot file states some numbers.

    One level of dry friction is that of both directions, and one rotor that of all its parts.
    """
    kinds = {
        "damping": ("Fv",),
        "frictionloss": ("Fc", "Fc+", "Fc-"),
        "armature": inertia_parts[:1],
        "stiffness": ("K",),
        "offset": ("off",),
    }
    return {f"{joint}.{kind}": value for word, value in numbers.items() for kind in kinds[word]}


#: How a compiled model (mjtWrap) numbers what a tendon runs through.
PULLEY, SITE = 2, 3


def straight(m: Any, t: int) -> bool:
    """Whether a tendon of a compiled model runs straight between sites."""
    kinds = {int(m.wrap_type[w]) for w in tendon_parts(m, t)}
    return SITE in kinds and kinds <= {SITE, PULLEY}


def tendon_parts(m: Any, t: int) -> range:
    """Return what a tendon of a compiled model runs through, by index."""
    start = int(m.tendon_adr[t])
    return range(start, start + int(m.tendon_num[t]))
