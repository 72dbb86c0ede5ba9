"""`Structure`: a robot under a model, and all that follows from these two alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated

import numpy as np
from scipy.linalg import null_space

from identifiability.effects import FAMILIES, Effect
from identifiability.effects.friction import CoulombAsymmetry, CoulombFriction
from identifiability.effects.measurement import ClockError, TimeDelay, TorqueOffset
from identifiability.foundation.errors import ModelError
from identifiability.foundation.keyed import explain_combination
from identifiability.foundation.linalg import (
    NEARLY,
    RANK_TOLERANCE,
    ROUNDED,
    SPAN_TOLERANCE,
    TINY,
    or_one,
    scan_columns,
    triangular_factor,
)
from identifiability.foundation.names import (
    GROUPED_KINDS,
    INERTIAL_KINDS,
    Array,
    NumberByName,
    Parameter,
    Strings,
)
from identifiability.foundation.options import Expected, checked
from identifiability.foundation.result import shown
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Dataset
from identifiability.robot import KnownRobot, Motion, Robot, complete_motion

from .regression import Model, Regression, compute_blocks

if TYPE_CHECKING:
    import pandas as pd


# Base parameters: which parameters a motion can determine at all, and which only in combination.
#
# The rank comes from the column-scaled singular values and is returned with its gap. The columns
# that represent the groups are chosen by the user's preference: a column is kept if it does not
# lie in the span of those kept before it; the others are regrouped into the kept ones [Gautier
# 1991].


@frozen
class BaseParameters:
    """Groupings ``beta = G phi`` of standard parameters phi, with ``W phi = W[:, kept] beta``.

    Attributes
    ----------
    parameters : tuple of Parameter
        The p standard parameters.
    kept : (b,) int
        The column that represents each group.
    G : (b, p)
        Identity on the kept columns; a regrouping is a row.
    singular_values : (min(rows, used columns),)
        Of the column-scaled regressor, descending.
    ambiguous : bool
        Whether the number of kept columns and the numerical rank disagree, or a kept column or
        direction is so small that rounded numbers of a robot file may have made it.
    order : tuple of int
        Order in which labels list the members of a group.
    """

    parameters: tuple[Parameter, ...]
    kept: np.ndarray
    G: Array
    singular_values: Array
    ambiguous: bool
    order: tuple[int, ...]

    def __len__(self) -> int:
        """Return the number of base parameters, the rank."""
        return len(self.kept)

    @property
    def rank(self) -> int:
        """Number of independent columns."""
        return len(self.kept)

    @property
    def gap(self) -> tuple[float, float]:
        """Smallest scaled singular value kept and largest dropped, relative to the largest."""
        s = self.singular_values / self.singular_values[0] if len(self.singular_values) else [0.0]
        last = float(s[self.rank - 1]) if self.rank else 0.0
        dropped = float(s[self.rank]) if self.rank < len(s) else 0.0
        return last, round(dropped, 12)  # values below are rounding

    @cached_property
    def names(self) -> Strings:
        """Names of the kept parameters."""
        return tuple(self.parameters[k].name for k in self.kept)

    @cached_property
    def units(self) -> Strings:
        """Units of the kept parameters."""
        return tuple(self.parameters[k].unit for k in self.kept)

    @property
    def without_effect(self) -> Strings:
        """Standard parameters that never change the torque."""
        idle = ~np.any(np.abs(self.G) > SPAN_TOLERANCE, axis=0)
        return tuple(p.name for p, i in zip(self.parameters, idle, strict=True) if i)

    def terms(self, row: int) -> list[tuple[float, Parameter]]:
        """Return the members of a group with their coefficients, the kept one first."""
        acts = (np.abs(self.G[row]) > SPAN_TOLERANCE).tolist()
        order = [self.kept[row], *[k for k in self.order if k != self.kept[row]]]
        return [(float(self.G[row, k]), self.parameters[k]) for k in order if acts[k]]

    def label(self, row: int) -> str:
        """Return a grouping as text, ``m(5) − 2.531·my(3) + m(3) + m(2)``."""
        text = ""
        for coefficient, parameter in self.terms(row):
            sign = "−" if coefficient < 0 else "+"
            # Twice: 0.22815 ± rounding must not be 0.2281 here and 0.2282 on another processor.
            size = f"{float(f'{abs(coefficient):.10g}'):.4g}"
            term = parameter.term if size == "1" else f"{size}·{parameter.term}"
            text += f" {sign} {term}" if text else (f"−{term}" if sign == "−" else term)
        return text

    @cached_property
    def labels(self) -> Strings:
        """Labels of all groups."""
        return tuple(self.label(row) for row in range(len(self)))

    def explain_absence(self, name: str) -> str:
        """Return why a standard parameter is no base parameter; empty for any other name."""
        if name in self.without_effect:
            return "it never changes the torque of this robot."
        groups = []
        for row in range(len(self)):
            members = [parameter.name for _, parameter in self.terms(row)]
            if name in members:
                groups.append(self.names[row])
        return explain_combination([] if name in self.names else groups)

    @cached_property
    def nonnegative(self) -> np.ndarray:
        """Whether physics forbids a value below zero, (b,) bool.

        A sum of masses, diagonal inertias or friction levels with positive coefficients cannot be
        negative; a group with any other member can.
        """
        rows = range(len(self))
        signs = [all(c > 0 and p.nonnegative for c, p in self.terms(r)) for r in rows]
        return np.array(signs, bool)

    def _repr_html_(self) -> str:
        total = len(self.parameters)
        said = f"{self.rank} of {total} combinations of parameters can be determined:"
        return shown(said, self.to_frame(), "to_frame()")

    def to_frame(self) -> pd.DataFrame:
        """Return name, unit and grouping of every base parameter."""
        import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

        return pd.DataFrame({"name": self.names, "unit": self.units, "grouping": self.labels})


def group_columns(
    W: Array, parameters: Sequence[Parameter], preference: Sequence[int] | None = None
) -> BaseParameters:
    """Return the base parameters of a regressor.

    Parameters
    ----------
    W : (rows, p)
        Regressor, or a triangular factor of it.
    parameters : sequence of Parameter
        Of the p columns.
    preference : sequence of int, optional
        Columns in the order of preference; by default as they come.
    """
    count = W.shape[1]
    preference = list(range(count)) if preference is None else list(preference)
    if W.shape[0] > count:
        W = triangular_factor(W)
    length = np.linalg.norm(W, axis=0)
    used = length > TINY * max(length.max(initial=0.0), 1e-300)
    scaled = np.where(used, W / np.where(used, length, 1.0), 0.0)
    s = np.linalg.svd(scaled[:, used], compute_uv=False) if used.any() else np.empty(0)
    rank = int((s > RANK_TOLERANCE * s[0]).sum()) if len(s) else 0
    kept = scan_columns(scaled, [k for k in preference if used[k]])
    G = np.zeros((len(kept), count))
    if kept:
        # Solved for scaled columns, so that units do not decide which digits survive.
        solved = np.linalg.lstsq(scaled[:, kept], scaled, rcond=None)[0]
        G = solved * length[None, :] / length[kept, None]
        G[:, kept] = np.eye(len(kept))
        G[:, ~used] = 0.0
        G[np.abs(solved) < SPAN_TOLERANCE] = 0.0
    indices = np.array(kept, int)
    return BaseParameters(tuple(parameters), indices, G, s, rank != len(kept), tuple(preference))


def random_motion(robot: Robot, rng: np.random.Generator, count: int) -> Motion:
    """Return random states of a robot within its limits, loops closed.

    Positions are uniform within the limits (or ± 1.5 rad and ± 0.1 m about home where there are
    none), velocities and accelerations standard normal.
    """
    home = robot.actuated_positions(robot.home[None])[0]
    reach = np.where(robot.slides, 0.1, 1.5)
    if robot.base is not None:  # its equations hold in its own axes
        reach[: len(robot.joints) - len(robot.motor_joints)] = 0.0
    low, high = robot.limits.T
    low = np.where(np.isfinite(low), low, home - reach)
    high = np.where(np.isfinite(high), high, home + reach)
    n = len(home)
    q = rng.uniform(low, high, (count, n))
    dq, ddq = rng.standard_normal((2, count, n))
    return complete_motion(robot, np.arange(count, dtype=float), q, dq, ddq)


@checked
def find_base_parameters(
    robot: KnownRobot,
    model: Annotated[Model, Expected("a Model, such as Model.of('rigid_body')")],
) -> BaseParameters:
    """Return the base parameters that the structure of a robot allows, from random states.

    The states are always the same, else chance would decide which of nearly equal columns is kept.
    No motion can determine more; a measured motion may determine less.
    """
    parameters = model.parameters(robot)
    refuse_twice(parameters, model)
    count = max(100, 4 * len(parameters) // len(robot.actuated))
    W = model.all_sensors(robot, random_motion(robot, np.random.default_rng(0), count))
    names = tuple(p.name for p in parameters)
    share = _share_of_equals(np.linalg.norm(W, axis=(0, 1)), parameters)
    # A file with nine digits turns a platform that cannot turn by a nanoradian.
    acts = np.where(share > NEARLY, W, 0.0).reshape(-1, len(share))
    base = group_columns(acts, parameters, robot.column_preference(names))
    small = (share[base.kept] < ROUNDED).any() or base.gap[0] < NEARLY
    return replace(base, ambiguous=base.ambiguous or bool(small))


def _share_of_equals(length: Array, parameters: Sequence[Parameter]) -> Array:
    """Return lengths of columns of bodies over the largest of their unit, others' as 1, (p,)."""
    share = np.ones(len(length))
    bodies = np.array([p.kind in INERTIAL_KINDS for p in parameters], bool)
    units = np.array([p.unit for p in parameters])
    for unit in np.unique(units[bodies]):
        own = bodies & (units == unit)
        share[own] = length[own] / or_one(length[own].max())
    return share


def refuse_twice(parameters: Sequence[Parameter], model: Model) -> None:
    """Refuse a model of which two effects have the same parameter."""
    counts = Counter(p.name for p in parameters)
    twice = [name for name, count in counts.items() if count > 1]
    if twice:
        raise ModelError(
            f"Two effects of the model {', '.join(model.texts)} have the parameter {twice[0]}; "
            "leave one of them out, or name its joints behind an '@'."
        )


def separate_directions(robot: Robot, model: Model) -> Model:
    """Return a model that states Coulomb friction once where it differs by direction.

    There each direction has a level; with a torque offset one level is enough, as the offset is
    half their difference.
    """
    places = {e.name: [p.owner for p in e.parameters(robot)] for e in model.effects}
    plain, split = (effect.name for effect in (CoulombFriction, CoulombAsymmetry))
    twice = {*places.get(plain, ())} & {*places.get(split, ())}
    if not twice:
        return model
    shifted = twice.intersection(places.get(TorqueOffset.name, ()))
    left_out = {plain: twice - shifted, split: shifted}
    effects: list[Effect] = []
    for effect in model.effects:
        lost = left_out.get(effect.name, set())
        kept = dict.fromkeys(place for place in places[effect.name] if place not in lost)
        rest = Model.of(f"{effect.name}@{'+'.join(kept)}").effects if kept else ()
        effects += rest if lost else [effect]
    return replace(model, effects=tuple(effects))


def sense_joints(robot: Robot) -> Robot:
    """Return a robot as if torque was measured at its joints, with rotors and friction."""
    torque = robot.torque.model_copy(update={"side": "joint"})
    return replace(robot, torque=torque)


def known_rows(C: Array, sd: Array) -> Array:
    """Return rows R (d, b) about ``β = C x`` that state the prior of x, each of variance 1.

    ``|R β|²`` is the least ``Σ (x/sd)²`` of all x that make β; the random part of x is ``sd R β``.

    Parameters
    ----------
    C : (b, p)
    sd : (p,)
        Standard deviations of x about zero, infinite without a prior.
    """
    random = np.isfinite(sd)
    if not random.any():
        return np.empty((0, len(C)))
    outside = null_space(C[:, ~random].T) if not random.all() else np.eye(len(C))
    columns = outside.T @ (C[:, random] * sd[random])
    length = np.linalg.norm(columns, axis=1)
    unit = or_one(length)[:, None]
    return np.linalg.pinv(columns / unit, rcond=RANK_TOLERANCE) @ (outside.T / unit)


@dataclass(frozen=True, eq=False, repr=False)
class Structure:
    """A robot under a model; equal only to itself, so that computed properties can be cached.

    Attributes
    ----------
    robot : Robot
    model : Model
    base : BaseParameters
        Its b base parameters, groupings of the p standard parameters of the model.
    """

    robot: Robot
    model: Model
    base: BaseParameters

    @staticmethod
    def of(robot: Robot, model: Model) -> Structure:
        """Return the structure with the base parameters of `find_base_parameters`.

        If the model states where gravity points, the robot is turned accordingly.
        """
        robot = model.turn(robot)
        model = separate_directions(robot, model)
        return Structure(robot, model, find_base_parameters(robot, model))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The p standard parameters."""
        return self.base.parameters

    @property
    def G(self) -> Array:
        """Base parameters of standard parameters, (b, p)."""
        return self.base.G

    @cached_property
    def columns(self) -> Strings:
        """Names of the p standard parameters."""
        return tuple(p.name for p in self.parameters)

    @cached_property
    def present(self) -> frozenset[tuple[str, str]]:
        """The model's effects by family and place.

        An effect also counts as those that it supersedes, and an error in time as either sign.
        """
        own = {(p.group, p.owner) for p in self.parameters}
        signs = {ClockError.name, TimeDelay.name}
        own |= {(name, place) for family, place in own if family in signs for name in signs}
        return frozenset(own).union(
            (name, place)
            for family, place in own
            if family in FAMILIES
            for name in FAMILIES[family].effect.supersedes
        )

    @cached_property
    def unobserved(self) -> tuple[Parameter, ...]:
        """Parameters of the model's effects that no torque sensor of the robot observes."""
        every = self.model.parameters(sense_joints(self.robot))
        return tuple(p for p in every if p.name not in self.columns)

    @cached_property
    def nonnegative(self) -> np.ndarray:
        """Whether physics forbids a standard parameter below zero, (p,) bool."""
        return np.array([p.nonnegative for p in self.parameters], bool)

    @cached_property
    def nominal(self) -> Array:
        """Standard parameters that the robot file states, zero where it states none, (p,)."""
        return np.array([self.robot.nominal.get(n, 0.0) for n in self.columns])

    @cached_property
    def nominal_base(self) -> Array:
        """Base parameters that the robot file states, (b,)."""
        return self.G @ self.nominal

    @cached_property
    def known(self) -> Array:
        """Rows of the prior on the model's random parameters, for the base parameters, (d, b)."""
        random = self.model.random
        sds = [random.get(p.name, p.sd) for p in self.parameters]
        return known_rows(self.G, np.array(sds))

    @cached_property
    def shapes(self) -> dict[str, float]:
        """Shapes behind the columns, by ``<joint>.<effect>``."""
        return self.model.shapes(self.robot)

    @cached_property
    def bodies(self) -> dict[str, str]:
        """Bodies of the model, loads among them.

        The start of their parameters' names, and a title.
        """
        known = {f"{b}.": b for b in self.robot.bodies}
        known |= {f"{b}.payload_": f"the payload of {b}" for b in self.robot.bodies}
        return {stem: title for stem, title in known.items() if f"{stem}m" in self.columns}

    @cached_property
    def inertial(self) -> np.ndarray:
        """Columns of each body's ten parameters in the order of `GROUPED_KINDS`, (nb, 10) int."""
        at = {name: k for k, name in enumerate(self.columns)}
        rows = [[at[f"{stem}{kind}"] for kind in GROUPED_KINDS] for stem in self.bodies]
        return np.array(rows, int).reshape(-1, 10)

    def regression(self, samples: Sequence[Dataset]) -> Regression:
        """Return the columns of the base parameters along measured motion.

        With instruments where every log has a second record of its motion.
        """
        others = tuple(s.beside for s in samples if s.beside is not None)
        beside = others if others and len(others) == len(samples) else None
        return Regression(self.robot, self.model, tuple(samples), self.base.kept, beside)

    def moving_mass(self, joint: str) -> Array:
        """Return the weights of base parameters in the mass that a joint moves, (b,).

        Zero but for sliding joints of trees: other joints move another inertia at each position.
        """
        robot = self.robot
        at = robot.joints.index(joint) if joint in robot.joints else -1
        if at < 0 or robot.closed or robot.base or not robot.slides[at]:
            return np.zeros(len(self.base))
        ddq = np.zeros((2, len(robot.joints)))
        ddq[1, at] = 1.0
        home = robot.actuated_positions(robot.home[None]) + 0.0 * ddq
        W = self.model.regressor(robot, complete_motion(robot, ddq[:, at], home, 0.0 * ddq, ddq))
        masses = np.array([p.group in ("rigid_body", "actuator_inertia") for p in self.parameters])
        weights: Array = ((W[1, at] - W[0, at]) * masses)[self.base.kept]
        return weights

    def torque_along(self, motion: Motion, phi: Array) -> Array:
        """Return the torque of parameters (p,) along a motion, (N, n) [N·m or N]."""
        widths = self.model.widths(self.robot)
        blocks = compute_blocks(self.model, self.robot, motion, widths)
        return np.concatenate([W @ phi for W in blocks])


def count_offsets(structure: Structure) -> Structure:
    """Return a structure whose groupings count the torque offsets that no motion separates.

    Along an upright slide, weight and the force of a counterweight are both constant. A model
    without the offset would call the mass alone identifiable. A structure whose offsets are
    separable is returned as it is.
    """
    robot = structure.robot
    model = structure.model
    slides = any(map(robot.is_prismatic, robot.actuated))
    if TorqueOffset.name in model.names or not slides:
        return structure
    inertias = [e for e in model.effects if e.name in ("rigid_body", "actuator_inertia")]
    base = Structure.of(robot, Model((*inertias, TorqueOffset()))).base
    apart = {base.parameters[k].name for k in base.kept}
    folded = [p.owner for p in TorqueOffset().parameters(robot) if p.name not in apart]
    if not folded:
        return structure
    counted = Model.of(*model.texts, f"{TorqueOffset.name}@{'+'.join(folded)}")
    return Structure.of(robot, replace(counted, random=model.random))


def mimic_in_bodies(structure: Structure, family: str) -> dict[str, Array]:
    """Return the changes (b, k) of base parameters that act as an effect at a joint in any motion.

    About a joint whose axis keeps its tilt, a first moment makes ``τ = ks sin q + kc cos q`` as a
    gravity spring of 1 N·m does. A joint has up to two such changes. A wrong zero of a last joint
    acts as its body turned about the axis, by 1 rad to first order.
    """
    robot = structure.robot
    present = {place for name, place in structure.present if name == family}
    turning = {a.name for a in robot.axes if not a.prismatic} - present
    # A wrong zero is of a joint; a spring may also act at a coupled motor.
    everywhere = Model.of(family).effects[0].parameters(robot)
    places = tuple(dict.fromkeys(p.owner for p in everywhere if p.owner in turning))
    if not places:
        return {}
    alone = Structure.of(robot, Model.of("rigid_body", f"{family}@{'+'.join(places)}"))
    own = [p.group == family for p in alone.parameters]
    kept = [alone.columns.index(name) for name in alone.base.names]
    of_effect = np.take(own, kept)
    bodies = structure.G[:, [structure.columns.index(alone.columns[k]) for k in kept if not own[k]]]
    found = dict[str, Array]()
    for joint in places:
        at = [k for k, p in enumerate(alone.parameters) if own[k] and p.owner == joint]
        at = [k for k in at if not alone.G[of_effect, k].any()]
        if at:
            found[joint] = bodies @ alone.G[~of_effect][:, at]
    return found


def list_asked_effects(structure: Structure) -> Strings:
    """Return the effects of a model, without the torque offsets that `count_offsets` added."""
    texts = structure.model.texts
    rest = tuple(text for text in texts if text.partition("@")[0] != TorqueOffset.name)
    if rest == texts:
        return texts
    counted = count_offsets(Structure.of(structure.robot, Model.of(*rest)))
    if {*counted.model.texts} == {*texts}:
        return rest
    return texts


class OfStructure:
    """A result about one `structure`."""

    structure: Structure

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.structure.robot

    @property
    def base(self) -> BaseParameters:
        """Base parameters of the robot's structure."""
        return self.structure.base

    @property
    def effects(self) -> Strings:
        """Effects of the unpruned model, as a ladder file writes them."""
        return self.structure.model.texts

    @property
    def shapes(self) -> NumberByName:
        """Shapes of the model's effects by ``<joint>.<effect>``."""
        return self.structure.shapes
