"""What hangs on a body: mass, centre and inertia, from logs of a robot that was fitted without."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial, reduce
from operator import add
from shlex import quote
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from scipy.linalg import block_diag
from scipy.stats import chi2

from identifiability.effects.nominal import reference_values
from identifiability.effects.transmission import LoadDependentFriction
from identifiability.estimation.bootstrap import scatter_scores
from identifiability.estimation.estimate import estimate, find_estimator, weigh_logs
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.least_squares import Noise
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.uncertainty import Motions, compare_motions, remembering_covariance
from identifiability.foundation.answers import Answer, Cell, Column, Table, measured_cells
from identifiability.foundation.engines.mapping import Engine, one_thread
from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import GROUPED_KINDS, Array, shorten_paths
from identifiability.foundation.numbers import REACH, measured
from identifiability.foundation.options import OptionError, checked
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import (
    digits,
    format_measured,
    format_number,
    join,
    percent,
)
from identifiability.foundation.rules import RuleTable, Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.instruments import noise_share
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.logs.repeats import Recording
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.physical.cad_prior import draw_bodies
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.fitted_model import LeastSquares
from identifiability.physical.project import project
from identifiability.physical.pseudo_inertia import entry_scale, natural_scale, to_matrix
from identifiability.regression.gather import gather_information
from identifiability.regression.information import Information
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.robot.changed import last_bodies
from identifiability.robot.kinematics import WORLD
from identifiability.workflows.answers import answer_next, with_hints
from identifiability.workflows.commands import given_paths, name_logs, source_name
from identifiability.workflows.opening import Logs
from identifiability.workflows.pairs import Pair, find_pairs, pair_information, share_noise
from identifiability.workflows.predict import Fit, FitLike, find_fit, state_missing
from identifiability.workflows.rules import RULES
from identifiability.workflows.session import Session

# The parameters of a load: as the logs say them, and as a real body can have them.
#
# `LoadEstimate` holds the ten parameters with everything that is not known of them, `Quantity`
# mass, centre and inertia of a real body near them, with intervals.


# `LoadEstimate`: the ten parameters of a load, with everything that is not known of them.
#
# τ − W x̂ = W δ + K θ + F f + noise, δ ~ N(0, Σ)
#
# x̂ and Σ are the values of the result and their covariance, K the columns of the body that
# carries the load, F those of friction, which is another one with the load: it changes from day to
# day, and gears rub in proportion to what they carry. All unknowns are estimated together, so that
# the interval of the load holds what the result does not know of the robot, and the load takes
# nothing that robot or friction may have. Of paired logs it is the difference of the two
# residuals: the columns of δ nearly vanish, and whatever the model gets wrong along the motion
# does, but friction that follows the load.


#: A column of the load that makes less than this share of the largest never acts.
LEAST: Tolerance = 1e-7

#: Nor does a direction whose square is less than this share of the largest.
SMALLEST: Tolerance = 1e-14

#: A direction whose torque is less than this share of what its columns would make if the robot were
#: known for certain is not told.
RANK: Tolerance = 1e-6

#: A parameter is not told if so much of it lies along directions that are not.
TOUCHED: Tolerance = 1e-3


#: Sizes of the ten parameters of a body of 1 kg, by which their columns are compared.
TYPICAL: Array = entry_scale(np.ones(1), np.full(1, 0.1))[0]


@frozen(kw_only=True)
class LoadEstimate:
    """What logs tell of a load, before physics says what can be.

    Attributes
    ----------
    theta : (10,)
        In the order of `GROUPED_KINDS`, about the origin of the body's frame.
    covariance : (10, 10)
        Of what is told.
    root : (10 - d, 10)
        ``|root (θ − theta)|²`` is the distance of another load from this one, in σ² by formula.
    unknown : (10, d)
        Directions that the logs do not tell, orthonormal in units of `TYPICAL`.
    motions : Motions or None
        The load by each log.
    logs : tuple of int
        Which log each motion of the estimate is.
    rms : (n,) [N·m or N]
        What is left of the torque.
    rubbing : mapping
        How surely the friction of a joint is another one than without the load: p-values.
    """

    theta: Array
    covariance: Array
    root: Array
    unknown: Array
    motions: Motions | None
    logs: tuple[int, ...]
    rms: Array
    rubbing: Mapping[str, float]


@frozen(kw_only=True)
class _Nuisance:
    """Directions (b, s) in which the robot may differ from the result, and their precision (s,)."""

    directions: Array
    precision: Array

    @staticmethod
    def of(fit: Fit) -> _Nuisance:
        size, turn = np.linalg.eigh(fit.covariance)
        good = size > SMALLEST * size.max(initial=0.0)
        known = turn[:, good] * np.sqrt(size[good])
        directions = np.column_stack([fit.submodel.M @ known, fit.submodel.M @ fit.spread.unknown])
        precision = np.repeat([1.0, 0.0], [known.shape[1], fit.spread.unknown.shape[1]])
        return _Nuisance(directions=directions, precision=precision)


@frozen(kw_only=True)
class Rubbing:
    """Friction that is another one with a load, of any joint.

    Attributes
    ----------
    structure : Structure
    carried : tuple of mapping
        Standard parameters by which gears rub in proportion to what they carry: of the robot
        with the load, and without; none while the load is not known.
    """

    structure: Structure
    carried: tuple[Mapping[str, float], ...] = ()

    def regression(self, samples: Sequence[Prepared]) -> Regression:
        """Return base columns, then one of each axis by each of what is carried."""
        known = self.structure.regression(samples)
        model, kept = known.model, self.structure.base.kept
        more = tuple(LoadDependentFriction(values) for values in self.carried)
        width = len(self.structure.parameters)
        every = sum(len(e.parameters(known.robot)) for e in more)
        columns = np.append(kept, np.arange(width, width + every))
        return replace(known, model=Model((*model.effects, *more)), columns=columns)

    @property
    def owners(self) -> tuple[str, ...]:
        """Joint or motor of each column of friction."""
        own = [joint for joint, columns in self.structure.friction.items() for _ in columns]
        return (*own, *(a.name for _ in self.carried for a in self.structure.robot.axes))

    @property
    def directions(self) -> Array:
        """Columns of friction in those of `regression`, (b + e, r)."""
        S = np.zeros((len(self.structure.columns), 0))
        for columns in self.structure.friction.values():
            for members, signs in columns:
                S = np.column_stack([S, np.zeros(len(S))])
                S[list(members), -1] = signs
        more = len(self.owners) - S.shape[1]
        found: Array = block_diag(self.structure.G @ S, np.eye(more))
        return found


def estimate_load(
    fit: Fit,
    load: Array,
    rubbing: Rubbing,
    loaded: Sequence[Information],
    without: Sequence[Information],
    pairs: Sequence[Pair],
) -> LoadEstimate:
    """Return the load that logs tell.

    Parameters
    ----------
    fit : Fit
        Of the robot without the load.
    load : (b, 10)
        Base parameters of the load's ten.
    rubbing : Rubbing
    loaded, without : sequence of Information
        About the columns of `rubbing` along each log with the load that has no pair, and about the
        base parameters along each without.
    pairs : sequence of Pair

    Raises
    ------
    LogError
        If the logs are too short.
    """
    known, friction = _Nuisance.of(fit), rubbing.directions
    r, b = friction.shape[1], len(load)
    nuisance = replace(known, precision=np.append(known.precision, np.zeros(r)))
    s = len(nuisance.precision)
    names = (*(f"robot {k}" for k in range(s)), *GROUPED_KINDS)
    more = np.zeros((len(friction) - b, 1))  # of what gears carry, which only a loaded log has
    wide = [np.vstack([x, np.tile(more, x.shape[1])]) for x in (known.directions, load)]
    both = np.hstack([wide[0], friction, wide[1]])
    empty = np.hstack([known.directions, np.zeros((b, r + 10))])
    base = np.append(fit.base, more)
    parts = [info.reduce(both, names, base) for info in loaded]
    parts += [info.reduce(empty, names, fit.base) for info in without]
    parts += [_differences(pair, fit, rubbing, both, empty, names) for pair in pairs]
    whole = weigh_logs(reduce(add, parts), find_estimator("wls"))
    # Logs without the load tell of the robot only.
    bare = range(len(loaded), len(loaded) + len(without))
    with_load = whole.take(~np.isin(whole.log, bare))
    own, robot = np.eye(s + 10)[:, s:], np.zeros(s)
    # Rounds in which noise is measured beside the load and the load beside noise.
    for _ in range(3):
        noise = _measure(with_load.reduce(own, GROUPED_KINDS, np.append(robot, np.zeros(10))))
        joint = _Joint.of(whole, noise, nuisance)
        robot = joint.robot
    part = with_load.reduce(own, GROUPED_KINDS, np.append(robot, np.zeros(10)))
    alone = estimate(part)
    factor, motions = _scatter(part, alone)
    covariance = share_noise(pairs) * joint.covariance * np.outer(factor, factor)
    if motions is not None:
        covariance = covariance + np.diag(np.where(joint.told, motions.between, 0.0) ** 2)
    unpaired = [k for k in range(len(loaded) + len(pairs)) if k not in {p.at[0] for p in pairs}]
    order = [*unpaired, *[-1] * len(without), *(p.at[0] for p in pairs)]
    return LoadEstimate(
        theta=joint.theta,
        covariance=covariance,
        root=joint.root,
        unknown=joint.unknown,
        motions=motions,
        logs=() if motions is None else tuple(order[k] for k in motions.which),
        rms=np.sqrt(alone.rss / part.samples),
        rubbing=_test_friction(rubbing.owners, joint, s - r, float(np.mean(factor) ** 2)),
    )


def _test_friction(
    owners: Sequence[str], joint: _Joint, start: int, wider: float
) -> dict[str, float]:
    """Return how surely the friction of each joint is another one, by Wald's test."""
    out = {}
    for owner in dict.fromkeys(owners):
        at = start + np.flatnonzero([o == owner for o in owners])
        size = np.sqrt(np.diag(joint.spread)[at])
        at, size = at[size > 0], size[size > 0]
        inverse = np.linalg.pinv(joint.spread[np.ix_(at, at)] / np.outer(size, size), RANK)
        z = joint.robot[at] / size
        out[owner] = float(chi2.sf(z @ inverse @ z / wider, max(len(at), 1)))
    return out


@frozen(kw_only=True)
class _Joint:
    """Load and robot estimated together.

    Attributes
    ----------
    robot : (s,)
        Along the directions of the nuisance.
    spread : (s, s)
        Covariance of these by formula; zero where they are not told.
    theta, covariance, root, unknown
        As in `LoadEstimate`, by formula.
    """

    robot: Array
    spread: Array
    theta: Array
    covariance: Array
    root: Array
    unknown: Array

    @property
    def told(self) -> np.ndarray:
        """Parameters that lie along no direction that is not told, (10,) bool."""
        told: np.ndarray = np.linalg.norm(self.unknown, axis=1) < TOUCHED
        return told

    @staticmethod
    def of(whole: Information, noise: Noise, nuisance: _Nuisance) -> _Joint:
        s = len(nuisance.precision)
        R = whole.factor(1.0 / (noise.variance * noise.times))
        A = np.vstack([R[:, :-1], np.diag([*np.sqrt(nuisance.precision), *np.zeros(10)])])
        b = np.append(R[:, -1], np.zeros(s + 10))
        lengths = np.linalg.norm(A, axis=0)
        idle = lengths[s:] * TYPICAL <= LEAST * (lengths[s:] * TYPICAL).max(initial=0.0)
        lengths = np.where(lengths > 0, lengths, 1.0)
        A = A / lengths
        A[:, s:][:, idle] = 0.0
        left, size, _ = np.linalg.svd(A[:, :s], full_matrices=False)
        left = left[:, size > RANK * size.max(initial=0.0)]
        load = A[:, s:] - left @ (left.T @ A[:, s:])
        _, size, turn = np.linalg.svd(load)
        good = size > RANK
        inverse = turn[good].T / size[good]
        theta = inverse @ (inverse.T @ (load.T @ (b - left @ (left.T @ b))))
        robot = np.linalg.lstsq(A[:, :s], b - A[:, s:] @ theta, rcond=RANK)[0]
        every = np.linalg.pinv(A, RANK)[:s] / lengths[:s, None]
        unknown = turn[~good].T / (lengths[s:] * TYPICAL)[:, None]
        return _Joint(
            robot=robot / lengths[:s],
            spread=every @ every.T,
            theta=theta / lengths[s:],
            root=size[good, None] * turn[good] * lengths[s:],
            unknown=np.linalg.qr(unknown)[0],
            covariance=inverse @ inverse.T / np.outer(lengths[s:], lengths[s:]),
        )


def _differences(
    pair: Pair, fit: Fit, rubbing: Rubbing, both: Array, bare: Array, names: Sequence[str]
) -> Information:
    """Return the information of what a pair's two residuals differ by."""
    W, tau, other, below, data = pair.rows(fit.structure, rubbing.regression)
    columns = W @ both - other @ bare
    torque = tau - below - (W[:, :, : len(bare)] - other) @ fit.base
    return pair_information(names, columns, torque, data)


def _measure(part: Information) -> Noise:
    """Return the noise beside the load, larger than what rounding leaves."""
    alone = estimate(part)
    least = ROUNDOFF**2 * float(np.mean(part.torque)) / part.samples
    variance = np.maximum(alone.variance, max(least, np.finfo(float).tiny))
    return Noise(variance, alone.times)


def _scatter(part: Information, alone: Estimate) -> tuple[Array, Motions | None]:
    """Return by how much the scatter over time exceeds the formula, (10,), and what logs say.

    Raises
    ------
    LogError
    """
    factor, kept = np.ones(10), list(alone.kept)
    scores = scatter_scores(part, alone, alone.memory)
    if scores is None and kept:
        raise LogError(
            f"{part.samples} samples are too few to say how a load's numbers scatter; give longer "
            "or more logs."
        )
    if scores is not None:
        formula = np.sqrt(np.diag(remembering_covariance(part, alone)))
        factor[kept] = np.maximum(scores.widened[kept] / formula, 1.0)
    factor[~np.isfinite(factor)] = 1.0  # not told, and said so
    several = len(np.unique(part.log)) > 1
    return factor, compare_motions(part, alone, alone.memory) if several else None


# `Quantity`: mass, centre and inertia of a real body near what logs say, with their intervals.
#
# The body is the possible one nearest to the estimate in the metric of its own covariance: a
# projection on a convex set brings an estimate no farther from any body that can be. The centre
# and the moments about it follow from the ten parameters to first order.


#: Names and units of what is said of a load.
QUANTITIES = {
    "mass": "kg",
    **dict.fromkeys(("centre x", "centre y", "centre z"), "m"),
    **dict.fromkeys(("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), "kg·m²"),
}

#: Rows and columns of these moments in a tensor.
_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))

#: The moment that bounds a product of inertia, half of it on either side.
_BOUNDS = {"Ixy": "Izz", "Ixz": "Iyy", "Iyz": "Ixx"}


#: Least mass beside which moments are small or large [kg].
LIGHTEST: Tolerance = 1e-3


@frozen(kw_only=True)
class Quantity:
    """One number about a load.

    Attributes
    ----------
    name, unit : str
    value : float
    low, high : float
        95 % interval, of which nothing that no body can have is part.
    told : bool
        Whether the logs tell it.
    why : str
        Why not, or what they do tell.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    told: bool
    why: str = ""

    @property
    def half(self) -> float:
        """Half the width of the interval."""
        return 0.5 * (self.high - self.low)


def nearest_body(found: LoadEstimate) -> Array:
    """Return the parameters (10,) of the real body nearest to an estimate."""
    # Radius of gyration of a load of which nothing is known [m].
    region = PhysicalSet(
        bodies=np.arange(10)[None],
        nonnegative=np.zeros(10, bool),
        names=("load",),
        mass=np.array([max(abs(found.theta[9]), LIGHTEST)]),
        length=np.array([0.1]),
    )
    data = LeastSquares(found.root, found.root @ found.theta, 1.0, 1.0)
    phi: Array = project(data, region).phi
    return phi


def describe_body(theta: Array) -> Array:
    """Return mass, centre and the moments about it, (10,) in the order of `QUANTITIES`."""
    mass, centre = theta[9], theta[6:9] / theta[9]
    second = to_matrix(theta)[:3, :3] - mass * np.outer(centre, centre)
    tensor = np.trace(second) * np.eye(3) - second
    return np.array([mass, *centre, *(tensor[at] for at in _ENTRIES)])


def state_quantities(found: LoadEstimate, body: Array, length: float) -> tuple[Quantity, ...]:
    """Return what is known of a body near an estimate.

    Parameters
    ----------
    found : LoadEstimate
    body : (10,)
        The real one nearest to it.
    length : float [m]
        Size of the robot's bodies: where a centre is less certain, it is not told.
    """
    values = describe_body(body)
    # Steps by which derivatives are taken, as a share of a body's own numbers.
    steps = 1e-4 * TYPICAL * max(body[9], LIGHTEST)
    slopes = np.array(
        [
            (describe_body(body + h) - describe_body(body - h)) / (2 * h.sum())
            for h in np.diag(steps)
        ]
    ).T
    half = REACH * np.sqrt(np.einsum("qi,ij,qj->q", slopes, found.covariance, slopes))
    along = np.abs(slopes * TYPICAL @ found.unknown).max(1, initial=0.0)
    open_ = along > TOUCHED * np.linalg.norm(slopes * TYPICAL, axis=1)
    half = np.where(open_, np.inf, half)
    names = list(QUANTITIES)
    ends = {n: (v - h, v + h) for n, v, h in zip(names, values, half, strict=True)}
    heavy = ends["mass"][0] > 0
    return tuple(
        _judge(name, float(value), ends, heavy=heavy, length=length)
        for name, value in zip(names, values, strict=True)
    )


def _judge(
    name: str, value: float, ends: dict[str, tuple[float, float]], *, heavy: bool, length: float
) -> Quantity:
    """Return one quantity, kept to what a body can have, and whether it is told."""
    low, high = ends[name]
    unit, half, why = QUANTITIES[name], 0.5 * (high - low), ""
    if name in _BOUNDS:
        most = 0.5 * ends[_BOUNDS[name]][1]
        physics, low, high = half >= most, max(low, -most), min(high, most)
        why = "no more than its moments allow by themselves" if physics and low * high < 0 else ""
    elif not name.startswith("centre"):
        why = f"at most {high:.3g} {unit}" if low <= 0 else ""
        low = max(low, 0.0)
    elif half > length:
        why = f"less certain than ± {length:.2g} m"
    if not np.isfinite(half):
        why = "this motion does not tell it"
    elif not heavy and name != "mass":
        why = "no mass is told"
    return Quantity(name=name, unit=unit, value=value, low=low, high=high, told=not why, why=why)


# `payload`: what hangs on a body of a robot that was fitted without it, as a `Load`.


# `Load`: mass, centre and inertia of what hangs on a body, in numbers and words.


#: What masses are stated by.
GAINS = (
    "Mass and moments are proportional to the torque constants and gear ratios by which the torque "
    "was read: as many percent as these are off, so is every number."
)


@frozen(kw_only=True)
class Load(Result):
    """What hangs on a body. Make it with `payload`.

    Attributes
    ----------
    robot : Robot
    body : str
        Which carries it; positions and moments are along the axes of its joint's frame.
    model : str
        Name of the fitted model.
    logs, without : tuple of str
        Logs with the load, and without.
    pairs : tuple of (str, str)
        Those that were compared, of the same motion.
    estimate : LoadEstimate
        What the logs say by themselves.
    parameters : (10,)
        Of the nearest real body, in the order of `GROUPED_KINDS`, about the origin of the frame.
    quantities : tuple of Quantity
        Mass, centre, and moments of inertia about it.
    usual : (n,) [N·m or N]
        What the result left of the torque.
    hints : tuple of str
    origin : str
        Name of the file of the result without the load.
    """

    schema: ClassVar[str] = "identifiability/payload/1"

    robot: Robot
    body: str
    model: str
    logs: tuple[str, ...]
    without: tuple[str, ...]
    pairs: tuple[tuple[str, str], ...]
    estimate: LoadEstimate
    parameters: Array
    quantities: tuple[Quantity, ...]
    usual: Array
    hints: tuple[str, ...] = ()
    origin: str = "result.json"

    @property
    def of(self) -> Mapping[str, Quantity]:
        """The quantities by name."""
        return {q.name: q for q in self.quantities}

    @property
    def mass(self) -> Quantity:
        """Of the load [kg]."""
        return self.of["mass"]

    @property
    def answer(self) -> str:
        """Mass and where, in one sentence."""
        mass = self.mass
        if not np.isfinite(mass.half):
            return f"These logs do not tell the mass of what hangs on {self.body}."
        if not mass.told:
            return f"Nothing surely hangs on {self.body}: at most {mass.high:.3g} kg."
        text = f"{measured(mass.value, mass.half, 'kg')} at body {self.body}"
        centre = [self.of[f"centre {axis}"] for axis in "xyz"]
        if all(q.told for q in centre):
            at = ", ".join(measured(q.value, q.half) for q in centre)
            text += f", its centre at ({at}) m in the frame of {self.body}"
        return f"{text} (95 %)."

    def answers(self) -> tuple[Answer, ...]:
        """Return how heavy and where, how well known, whether to trust it, what next."""
        return _what(self), _known(self), _trust(self), answer_next(_next_commands(self))

    def decided_by(self) -> tuple[RuleTable, ...]:
        """Return the numbers by which it was decided, the verb's own first."""
        return (RULES, Thresholds())

    def tables(self) -> tuple[Table, ...]:
        """Return one row a quantity."""
        return (_quantity_table(self),)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        texts = [self.answer, self._moments(), self._untold(), self._agreement(), self.friction]
        texts += [*self.caveats, GAINS if self.mass.told else ""]
        return " ".join(t for t in (*texts, *self.hints) if t)

    def _moments(self) -> str:
        told = [q for q in self.quantities if q.name.startswith("I") and q.told]
        texts = [f"{q.name} {measured(q.value, q.half)}" for q in told]
        return f"Moments about its centre: {listing(texts)} kg·m²." if texts else ""

    def _untold(self) -> str:
        if not (self.mass.told and np.isfinite(self.mass.half)):
            return ""
        by: dict[str, list[str]] = {}
        for q in self.quantities:
            if not q.told:
                by.setdefault(q.why, []).append(q.name)
        texts = [f"{listing(names)} ({why})" for why, names in by.items()]
        return f"Not told: {'; '.join(texts)}." if texts else ""

    def _agreement(self) -> str:
        motions = self.estimate.motions
        if motions is None:
            return "" if self.pairs else "One motion cannot show what another would change."
        rows = self.log_frame().to_dict("records")
        each = listing([f"{r['log']} {measured(r['mass'], r['half'], 'kg')}" for r in rows], 4)
        if motions.agree:
            return f"The logs agree ({each})."
        return f"The logs disagree ({each}): intervals are widened to hold all of them."

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Joints whose friction is surely another one than without the load."""
        level = Thresholds.sign_level / max(len(self.estimate.rubbing), 1)
        return tuple(joint for joint, p in self.estimate.rubbing.items() if p < level)

    @property
    def friction(self) -> str:
        """What became of friction, in a sentence; empty where it did not change for sure."""
        if not self.rubbing:
            return ""
        many = "differ" if len(self.rubbing) > 1 else "differs"
        return (
            f"Friction of {listing(self.rubbing, 6)} {many} from that without the load, which the "
            "intervals hold."
        )

    @property
    def caveats(self) -> tuple[str, ...]:
        """What makes the answer doubtful, and what to do."""
        ratio = self.estimate.rms / np.maximum(self.usual, 1e-300)
        if len(self.pairs) == len(self.logs) or ratio.max() < RULES.grows:
            return ()
        k = int(np.argmax(ratio))
        return (
            f"But the torque of {self.robot.joints[k]} is left "
            f"{format_number(ratio[k], 2)} × as far off as by the "
            "result's own logs: the robot changed since (friction does, with temperature), or "
            "the load is not rigid or hangs elsewhere (--body). Add a log of the same motion "
            "without the load (--without); compare says what changed.",
        )

    def to_frame(self) -> pd.DataFrame:
        """Return one row a quantity: ``name``, value, interval, unit, whether it is told, why."""
        return pd.DataFrame([asdict(q) for q in self.quantities])

    def log_frame(self) -> pd.DataFrame:
        """Return the mass by each log alone, with half of its interval for noise; none of one."""
        motions = self.estimate.motions
        if motions is None:
            return pd.DataFrame(columns=["log", "mass", "half"])
        at = GROUPED_KINDS.index("m")
        short = shorten_paths(self.logs)
        names = [short[k] for k in self.estimate.logs]
        return pd.DataFrame(
            {"log": names, "mass": motions.values[:, at], "half": REACH * motions.sd[:, at]}
        )

    @property
    def possible(self) -> bool:
        """Whether the estimate is a real body by itself."""
        return bool(np.allclose(self.parameters, self.estimate.theta, rtol=1e-6, atol=1e-12))

    def to_dict(self) -> dict[str, Any]:
        """Return the load in the documented JSON schema."""
        theta = dict(zip(GROUPED_KINDS, self.parameters.tolist(), strict=True))
        alone = dict(zip(GROUPED_KINDS, self.estimate.theta.tolist(), strict=True))
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "model": self.model,
            "body": self.body,
            "statement": self.statement,
            "quantities": [asdict(q) for q in self.quantities],
            "parameters": theta,
            "estimate": alone,
            "covariance": self.estimate.covariance.tolist(),
            "order": list(GROUPED_KINDS),
            "possible": self.possible,
            "logs": list(self.logs),
            "without": list(self.without),
            "pairs": [list(p) for p in self.pairs],
            "by_log": self.log_frame().to_dict("records"),
            "caveats": list(self.caveats),
            "friction_changed": list(self.rubbing),
        }


# `payload`: what hangs on a body of a robot that was fitted without it.


@checked
def payload(
    robot: RobotLike,
    result: FitLike,
    logs: Logs,
    without: Logs = (),
    *,
    body: str | None = None,
    engine: Engine | None = None,
) -> Load:
    """Find mass, centre and inertia of what hangs on a body.

    Parameters
    ----------
    robot : Robot, path or shipped name
        The robot that the result is about.
    result : Fit, Analysis, Ladder, Diagnosis or path
        Fitted to logs without the load. What it does not know of the robot enters every interval.
    logs : log, path, DataFrame, or several
        Logs with the load; they are prepared like the fitted ones, with the same cut-off.
    without : the same, optional
        Logs without the load, best of the same day and along the same motion: then whatever the
        model gets wrong along it cancels.
    body : str, optional
        Which carries the load; by default the last of a chain, or the platform, on which most
        loops end.
    engine : Engine, optional
        Where logs that are too long for memory are worked on.

    Raises
    ------
    OptionError
        If there is no such body, or several can carry the load and none was named.
    IdentifiabilityError
        If the result is about another robot, or a log does not fit it.
    """
    with one_thread("blas"):
        robot = Robot.of(robot)
        fit = find_fit(result, robot)
        place, columns = choose_body(fit.structure, body)
        session, second = Session.read_sides(
            fit.structure, logs, without, fit.preparation, engine, alone=True
        )
        sides = session.recordings, second.recordings
        given, other = (side.fitted for side in sides)
        pairs = find_pairs(robot, given, other, session.how)
        # What hangs on the robot is odd by its file, so that nothing odd is looked for.
        paired = tuple({p.at[k] for p in pairs} for k in (0, 1))
        samples, unloaded = (
            session.prepare([r for k, r in enumerate(side) if k not in done], "weighed")
            for side, done in zip((given, other), paired, strict=True)
        )
        hints = [text for side in sides for text in side.hints]
        hints += _tell_noise(robot, given, session.how)
        hints += [text for s in (*samples, *unloaded) for text in s.hints]
        gather = partial(gather_information, engine=session.engine)
        bare = [gather(fit.structure.regression([s])) for s in unloaded]
        rubbing = Rubbing(structure=fit.structure)
        # How often the load is found: friction that follows it takes what it was found to
        # be before.
        for _ in range(2):
            loaded = [gather(rubbing.regression([s])) for s in samples]
            found = estimate_load(fit, columns, rubbing, loaded, bare, pairs)
            nearest = nearest_body(found)
            rubbing = Rubbing(
                structure=fit.structure, carried=_carried(fit.structure, place, nearest)
            )
        length = float(np.median(natural_scale(_bodies(fit.structure))[1]))
    paths = given_paths(given), given_paths(other)
    return Load(
        robot=robot,
        body=place,
        model=fit.submodel.name,
        logs=paths[0],
        without=paths[1],
        pairs=tuple((paths[0][p.at[0]], paths[1][p.at[1]]) for p in pairs),
        estimate=found,
        parameters=nearest,
        quantities=state_quantities(found, nearest, length),
        usual=fit.spread.low,
        hints=tuple(dict.fromkeys(filter(None, (state_missing(fit.missing), *hints)))),
        origin=fit.origin,
    )


def _carried(structure: Structure, body: str, load: Array) -> tuple[Mapping[str, float], ...]:
    """Return by which values gears carry what they do: with the load, and without.

    Where the model itself has friction by load, it is that without.
    """
    bare = reference_values(structure.robot)
    loaded = dict(bare)
    for kind, value in zip(GROUPED_KINDS, load.tolist(), strict=True):
        loaded[f"{body}.{kind}"] = loaded.get(f"{body}.{kind}", 0.0) + value
    return (loaded,) if LoadDependentFriction.name in structure.model.names else (loaded, bare)


def _tell_noise(robot: Robot, logs: Sequence[Recording], how: Preparation) -> list[str]:
    """Return what noise of the motion does to the load, where it does."""
    loud = {
        log.name: share
        for log in logs
        if isinstance(log, Log)
        and (share := noise_share(robot, log, _cutoff(log, how))) > LOG_RULES.noise_share**0.5
    }
    if not loud:
        return []
    return [
        f"{listing(loud, 4)}: noise of the measured motion has up to "
        f"{percent(max(loud.values()), 2)} of an acceleration (rms), which pulls the load's "
        "numbers off, and intervals do not hold that; measure '<joint>.dq' and '<joint>.ddq', or "
        "lower the cut-off of the result (analyze --cutoff)."
    ]


def _cutoff(log: Log, how: Preparation) -> float | None:
    """Return the low-pass of computed derivatives; None where they were measured."""
    return None if {"dq", "ddq"} <= set(log.channels) else how.outputs or how.cutoff


def choose_body(structure: Structure, body: str | None) -> tuple[str, Array]:
    """Return the body that carries the load, and base parameters (b, 10) of the load's ten.

    Raises
    ------
    OptionError
    """
    robot = structure.robot
    if body is None:
        last = last_bodies(robot)
        # Points of loops hang on single axes, of which a body's joint may have several.
        axes = np.repeat(np.arange(robot.model.njoints - 1), list(robot.model.nvs)[1:])
        points = [p.joint for loop in robot.loops for p in (loop.first, loop.second)]
        ends = Counter(robot.bodies[axes[joint]] for joint in points if joint != WORLD)
        count = [ends[b] for b in last]
        best = [b for b, c in zip(last, count, strict=True) if c == max(count)]
        if len(best) > 1:
            raise OptionError(
                f"The load may hang on {listing(best, 8)}; name its body (--body, body=…)."
            )
        body = best[0]
    if body not in robot.bodies:
        raise OptionError(
            f"'{body}' is no moving body of {robot.name}{near_match(body, robot.bodies)} A load "
            f"can hang on {listing(robot.bodies, 12)}."
        )
    stems = list(structure.bodies)
    if f"{body}." not in stems:
        raise OptionError(
            "The result's model has no bodies to which a load could be added (rigid_body); fit one "
            "that has."
        )
    return body, structure.G[:, structure.inertial[stems.index(f"{body}.")]]


def _bodies(structure: Structure) -> Array:
    """Return the ten parameters of every body that the robot file states, or what stands in."""
    theta: Array = draw_bodies(structure).phi[structure.inertial]
    return theta


def value_text(quantity: Quantity) -> str:
    """Return a quantity with half of its 95 % interval, rounded together."""
    value, half = format_measured(quantity.value, quantity.half)
    return f"{value} ± {half} {quantity.unit}"


def _what(result: Load) -> Answer:
    question, mass = f"What hangs on {result.body}?", result.mass
    if not np.isfinite(mass.half):
        return Answer(question, "These logs do not tell.", tone="grey")
    if not mass.told:
        short = f"Nothing surely: at most {format_number(mass.high, 2)} kg."
        return Answer(question, short, tone="amber")
    gains = "It is proportional to the torque constants by which the torque was read."
    centre = [result.of[f"centre {axis}"] for axis in "xyz"]
    told = [f"{q.name[-1]} = {value_text(q)}" for q in centre if q.told]
    text = f"Its centre in the frame of {result.body}: {join(told)}." if told else ""
    return Answer(question, f"{value_text(mass)} (95 %).", f"{text} {gains}".strip(), "blue")


def _known(result: Load) -> Answer:
    mass, count = result.mass, sum(q.told for q in result.quantities)
    short = f"{count} of {len(result.quantities)} quantities are told."
    if mass.told and np.isfinite(mass.half):
        short = f"The mass to {percent(mass.half / mass.value, 2)}; {short}"
    lost = [q.name for q in result.quantities if not q.told]
    text = f"Not told: {join(lost, len(lost))}; the table says why." if lost else ""
    return Answer("How well is it known?", short, text, "green" if mass.told else "amber")


def _trust(result: Load) -> Answer:
    answer = _trusted(result)
    text = " ".join(filter(None, (answer.text, result.friction)))
    return replace(answer, text=text)


def _trusted(result: Load) -> Answer:
    question, motions = "May I trust it?", result.estimate.motions
    if result.caveats:
        return Answer(question, "With care: the robot changed since.", result.caveats[0], "amber")
    if motions is not None and not motions.agree:
        text = "Intervals are widened to hold all of them."
        return Answer(question, "With care: the logs disagree.", text, "amber")
    if len(result.pairs) == len(result.logs):
        text = "Each log has one of the same motion without the load: what the model gets wrong "
        return Answer(question, "Yes, within its intervals.", f"{text}along it cancels.", "green")
    if motions is None:
        text = "One motion cannot show what another would change."
        return Answer(question, "As far as one log can tell.", text, "amber")
    return Answer(question, "Yes, within its intervals.", "The logs agree.", "green")


def _next_commands(result: Load) -> list[tuple[str, str]]:
    robot, logs = source_name(result.robot), name_logs(result.robot, result.logs)
    call = f"identifiability payload {robot} {quote(result.origin)} {logs} --body {result.body}"
    without = "".join(f" --without {quote(n)}" for n in result.without)
    out = []
    if len(result.pairs) < len(result.logs):
        text = "Weigh it against a log of the same motion without the load (empty.csv):"
        out.append((text, f"{call} --without empty.csv --report payload.html"))
    if not all(q.told for q in result.quantities):
        begun = name_logs(result.robot, result.logs, "--start-from")
        text = "Find a motion that tells more:"
        out.append((text, f"identifiability excite {robot} {begun} --out next.json"))
    if result.mass.told:
        out.append(("Keep the numbers for other programs:", f"{call}{without} --json load.json"))
    return out


def _quantity_table(result: Load) -> Table:
    """Return one row a quantity."""
    own = with_hints(
        "load",
        Column("quantity", get="name"),
        Column("value", "number", lambda q: _value(q)[0]),
        Column("± 95 %", "error", lambda q: _value(q)[1]),
        Column("from", digits(3), "low"),
        Column("to", digits(3), "high"),
        Column("unit", get="unit"),
        Column("told", get=_told),
    )
    return Table.of("Mass, centre, and moments about the centre", own, result.quantities)


def _value(quantity: Quantity) -> tuple[Cell, Cell]:
    """Return a quantity and half of its interval, which is not about the value of one untold."""
    if quantity.told:
        return measured_cells(quantity.value, quantity.half)
    return Cell(format_number(quantity.value, 2), quantity.value), Cell("")


def _told(quantity: Quantity) -> Cell:
    return Cell("yes" if quantity.told else "no", note=quantity.why)
