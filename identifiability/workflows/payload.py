"""Loads on a body: mass, centre and inertia, from logs with the load and a fit without it.

The mixed model of the loaded logs (`Differences`) always has the ten parameters of the load. The
robot may differ from the result within its covariance. Torque gains and friction may differ between
logs. Other changes that the logs show are in the model, too. A known load identifies the torque
gain of each joint instead.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from typing import cast

import numpy as np
import scipy

from identifiability.effects import FAMILIES
from identifiability.effects.inertia import Payload
from identifiability.effects.registry import is_loaded
from identifiability.estimation.differences import UNTOLD, WEIGHS, Differences, Known, pooled_values
from identifiability.estimation.groups import Excerpt
from identifiability.estimation.mixed_model import MixedModel, Terms
from identifiability.estimation.rules import RULES, Thresholds
from identifiability.estimation.verdict import percent_of
from identifiability.foundation.engines import Engine, Serial, one_thread
from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.keyed import Row
from identifiability.foundation.linalg import NEARLY, root_diagonal
from identifiability.foundation.names import (
    GROUPED_KINDS,
    INERTIAL_KINDS,
    Array,
    Strings,
    name_each,
)
from identifiability.foundation.options import OptionError, Positive, checked
from identifiability.foundation.presenter import presented
from identifiability.foundation.quoting import for_toml
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import REACH
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.runs import Run
from identifiability.foundation.values import Fields, Json, frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.dataset import require_signal
from identifiability.logs.prepare.preparation import CommonPreparation
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.physical.cad_prior import draw_bodies
from identifiability.physical.fitted_model import LeastSquares, PhysicalSet
from identifiability.physical.plausibility import measure_reach
from identifiability.physical.project import project
from identifiability.physical.pseudo_inertia import (
    QUANTITIES,
    describe_body,
    entry_scale,
    natural_scale,
)
from identifiability.physical.rules import RULES as PHYSICAL_RULES
from identifiability.quality.recordings import LogLike, Logs, list_logs
from identifiability.regression.columns import Candidate
from identifiability.regression.reduction import DEFAULT_EFFECTS, full_model
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Motion, Robot, RobotLike
from identifiability.robot.robot import Point, body_of, last_bodies, ten_parameters
from identifiability.workflows.changes import Change, DifferentTorque, list_lacks, list_log_changes

from .case import MEASURED, Case, take_case
from .compare import read_sides
from .predict import Fit, FitLike, find_fit, is_result, state_missing, state_reading
from .sides import Sides, carry_loads, find_differences, list_patterns
from .torque_scale import UNSCALED, TorqueScale, measure_torque_scale

# `LoadEstimate`: the ten parameters of a load, with their full uncertainty.


#: Where each of `GROUPED_KINDS` stands among `INERTIAL_KINDS`.
ORDER = [INERTIAL_KINDS.index(kind) for kind in GROUPED_KINDS]
#: And the other way round.
FROM_GROUPED = np.argsort(ORDER)
#: Sizes of the ten parameters of a body of 1 kg, by which their columns are compared.
TYPICAL: Array = entry_scale(np.ones(1), np.full(1, 0.1))[0]


@frozen(kw_only=True)
class LoadEstimate:
    """Estimate of a load from logs, before physical constraints.

    Attributes
    ----------
    theta : (10,)
        In the order of `GROUPED_KINDS`, about the origin of the body's frame.
    covariance : (10, 10)
        Of the identifiable parameters.
    root : (10 − d, 10)
        ``|root (θ − theta)|²`` is the distance of another load from this one, in σ².
    unknown : (10, d)
        Directions that the logs do not determine, orthonormal.
    lacks : tuple of str
        Effects that the model seems to lack in these logs.
    changes : tuple of Change
        Other changes.
    torque : DifferentTorque
        Of the first log with the load: its torque, measured and by these parameters.
    """

    theta: Array
    covariance: Array
    root: Array
    unknown: Array
    lacks: Strings
    changes: tuple[Change, ...]
    torque: DifferentTorque

    @property
    def is_less(self) -> bool:
        """Whether the logs have less on the body than those of the result."""
        return bool(self.theta[9] < -REACH * root_diagonal(self.covariance)[9])


def widened(found: Differences, terms: Terms, at: slice) -> tuple[Array, Array]:
    """Return some of the fixed values (k,) and their covariance, widened for one more group.

    Each further group widens it by the shift that it would cause, weighted by its probability.
    """
    value, covariance = (x[at] for x in found.solve(terms))
    out = covariance[:, at]
    for term, weight, _ in found.model.alternatives(terms):
        other, wider = (x[at] for x in found.solve((*terms, term)))
        moved = np.outer(other - value, other - value) + wider[:, at]
        out = out + weight * (moved - covariance[:, at])
    return value, out


def estimate_load(found: Differences, names: Sequence[str]) -> LoadEstimate:
    """Return the load that is in every hypothesis, of logs of some names."""
    first = found.known.size
    terms = found.model.search()
    theta, spread = widened(found, terms, slice(first, first + 10))
    scale = found.scale @ found.always
    square, turn = np.linalg.eigh(spread * np.outer(scale, scale))
    open_ = square > UNTOLD**2
    size = np.sqrt(np.maximum(square[~open_], np.finfo(float).tiny))
    told = turn[:, ~open_] * size / scale[:, None]
    unknown = np.linalg.qr(turn[:, open_] / scale[:, None])[0]
    root = (turn[:, ~open_] / size).T * scale
    lacks = list_lacks(found, terms)
    torque = DifferentTorque.of(found, terms, 1)
    return LoadEstimate(
        theta=theta,
        covariance=told @ told.T,
        root=root,
        unknown=unknown,
        lacks=lacks,
        changes=list_log_changes(found, terms, names),
        torque=torque,
    )


def _load(found: Differences) -> Array:
    """Return which columns of candidates the ten parameters of a load are, (C, 10)."""
    own = [c.kinds == INERTIAL_KINDS and c.pattern == "0" for c, *_ in found.columns]
    return np.eye(len(own))[:, own]


# The weight of the load. A controller subtracts the weight of a load that was entered at the
# pendant, and keeps that of a load it does not know. So the weight of the load may be in the torque
# where that of the robot is not, and the other way round.


#: Log odds from which the unusual hypothesis on the weight is used.
SURELY = RULES.name + RULES.keep


def list_weights(robot: Robot, gravity: Array, body: str) -> tuple[Candidate, ...]:
    """Return the weight of a load on a body under some gravity (3,); none of an inner body."""
    if body not in last_bodies(robot) or not gravity.any() or robot.base is not None:
        return ()
    effect = Payload(gravity)
    kinds = tuple(p.kind for p in effect.parameters(robot) if p.owner == body)
    columns = tuple(range(len(kinds)))
    return (Candidate(FAMILIES["payload"], body, np.nan, kinds, effect, columns),)


def choose_weight(found: Differences, body: str) -> tuple[Differences, list[Finding]]:
    """Return the likelier hypothesis on the weight of a load on a body, and a remark on it.

    Usually the torque has the weight of the load if it has that of the robot.
    """
    load = _load(found)
    usual = found.having(load[:, ORDER])
    weighs = [c.pattern == WEIGHS for c, *_ in found.columns]
    if not any(weighs):
        return usual, []
    # The weight acts through the first four parameters of a load.
    unit = np.eye(len(weighs))
    weight = np.pad(unit[:, weighs], ((0, 0), (0, 6)))
    has_weight = bool(found.missing.seen.robot.gravity.any())
    unusual = found.having((load - weight if has_weight else load + weight)[:, ORDER])
    odds = _log_evidence(unusual.model, ()) - _log_evidence(usual.model, ())
    if odds >= SURELY:  # other effects may explain it as well
        models = unusual.model, usual.model
        likely, other = (_log_evidence(model, model.search()) for model in models)
        odds = likely - other
    if odds < SURELY:
        return usual, []
    text = phrase("load_weight", "lacks" if has_weight else "has", body=body)
    return unusual, [Finding("load_weight", text=text, log_odds=odds, body=body)]


def _log_evidence(model: MixedModel, terms: Terms) -> float:
    """Return the log evidence of a model with some terms, less their price."""
    return model.solve(terms).log_likelihood - sum(t.group.price for t in terms)


# `Quantity`: mass, centre and inertia of a physical body near the estimate, with intervals.
#
# The body is the possible one nearest to the estimate in the metric of its own covariance: a
# projection on a convex set brings an estimate no farther from any body that can be. The centre
# and the moments about it follow from the ten parameters to first order.


#: The mass if the masses of the robot file are right, and torque constants are not.
BY_FILE = "mass by the file"

#: Quantities that are never negative: mass and moments about axes.
POSITIVE = np.isin(np.arange(len(QUANTITIES)), (0, 4, 5, 6))

#: Least mass relative to which moments are small or large [kg].
LIGHTEST: Tolerance = 1e-3


@frozen
class Quantity:
    """One number about a load, or the torque gain of a joint.

    Attributes
    ----------
    name, unit : str
    value : float
    low, high : float
        95 % interval, limited to physically possible values.
    why : str
        Reason why the logs do not determine it; empty if they do.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    why: str = ""

    @property
    def told(self) -> bool:
        """Whether the logs determine it."""
        return not self.why

    @property
    def half(self) -> float:
        """Half the width of the interval."""
        return 0.5 * (self.high - self.low)

    @property
    def sigma(self) -> float:
        """Standard error."""
        return self.half / REACH


def nearest_body(found: LoadEstimate) -> Array:
    """Return the parameters (10,) of the physically consistent body nearest to an estimate."""
    masses = np.array([max(abs(found.theta[9]), LIGHTEST)])
    region = PhysicalSet(np.arange(10)[None], np.zeros(10, bool), ("load",), mass=masses)
    data = LeastSquares(found.root, found.root @ found.theta, 1.0, 1.0)
    return project(data, region).phi


def _explain_doubts(length: float, *, less: bool) -> list[str]:
    """Return why a large error makes each quantity of a body unidentifiable."""
    parts = ["less" if less else "most", *["vague"] * 3, *["most"] * 3, *["product"] * 3]
    return [phrase("untold", part, length=length) for part in parts]


def state_quantities(
    found: LoadEstimate, body: Array, length: float, scale: TorqueScale, *, turns: bool
) -> tuple[Quantity, ...]:
    """Return the quantities of a body with the intervals of its estimate.

    Parameters
    ----------
    found : LoadEstimate
        As measured.
    body : (10,)
        The physically consistent body nearest to it, divided by the factor. Of less load the
        estimate counts, with its negative mass.
    length : float [m]
        Size of the robot's bodies. A number of either sign may be zero: it is identifiable if it is
        sure to its size, a centre to this length, a product to the least moment.
    scale : TorqueScale
        The factor by which torque is read too large.
    turns : bool
        Whether the robot can turn the body that carries it.
    """
    if found.is_less:
        body = found.theta / scale.factor
    values = describe_body(body)
    half = _half_widths(found, body, scale)
    low = values - half
    high = values + half
    vague = POSITIVE & (low <= 0)
    moment = 0.0 if vague[4:7].any() else values[4:7].min()
    size = np.repeat([length, moment], [4, 6])
    unsure = np.where(POSITIVE, vague, half > size)
    low = np.where(POSITIVE & ~found.is_less, np.maximum(low, 0.0), low)
    doubts = _explain_doubts(length, less=found.is_less)
    out = []
    for k, (name, unit) in enumerate(QUANTITIES.items()):
        why = ""
        if np.isinf(half[k]):
            why = phrase("untold", "motion" if turns else "turn")
        elif k and unsure[0]:
            why = phrase("untold", "mass")
        elif unsure[k]:
            why = doubts[k]
        out.append(Quantity(name, unit, float(values[k]), float(low[k]), float(high[k]), why))
    return tuple(out)


def _half_widths(found: LoadEstimate, body: Array, scale: TorqueScale) -> Array:
    """Return half the 95 % interval of each quantity, (10,); infinite if not identifiable.

    Quantities are linearised about a body.
    """
    # Steps by which derivatives are taken, as a share of a body's own numbers.
    steps = 1e-6 * TYPICAL * max(abs(body[9]), LIGHTEST)
    slopes = scipy.optimize.approx_fprime(body, describe_body, steps)
    covariance = found.covariance / scale.factor**2 + scale.sd**2 * np.outer(body, body)
    half = REACH * np.sqrt(np.einsum("qi,ij,qj->q", slopes, covariance, slopes))
    sizes = slopes * TYPICAL
    along = np.abs(sizes @ found.unknown).max(1, initial=0.0)
    return np.where(along > NEARLY * np.linalg.norm(sizes, axis=1), np.inf, half)


# Gains: size of one unit of a torque column, from a known load.
#
# Torque with a wrong gain gives a load that is wrong by the same factor. So each joint is fitted
# separately, in units of its column: ``τ = W b + s W_load φ``, of which s is one over the gain and
# b is free, as parameters of the robot take the gain up [Gautier & Briot 2014]. Moments about the
# centre that nobody stated are fitted as well: gains by a point mass are too small where it turns.


def find_gains(found: Differences, theta: Array, *, moments: bool) -> tuple[Quantity, ...]:
    """Return the gain of each joint's torque from a known load.

    Parameters
    ----------
    found : Differences
    theta : (10,)
        The load, in the order of `INERTIAL_KINDS`.
    moments : bool
        Whether its moments are known. Unknown ones are those of a body of its mass that is as large
        as an unknown load (`TYPICAL`).
    """
    load = _load(found)
    sums = load @ theta[:, None]
    unknown = load @ (np.diag(theta[0] * TYPICAL)[:, :6])[FROM_GROUPED]
    robot = found.missing.seen.robot
    gains = []
    for j, joint in enumerate(robot.joints):
        inverse, sd = _invert_gain(found, sums, j)
        if inverse and not moments:  # a joint in which no load acts has no gain
            expected = np.array([np.inf, *[abs(inverse)] * 6])
            inverse, sd = _invert_gain(found, np.hstack([sums, unknown]), j, expected)
        gains.append(_state_gain(robot, joint, inverse, sd))
    return tuple(gains)


def _invert_gain(
    found: Differences, sums: Array, j: int, expected: Array | None = None
) -> tuple[float, float]:
    """Return one over the gain of a joint's torque, in units as it was read, and its error.

    Parameters
    ----------
    found : Differences
    sums : (C, a)
        The known load as a sum of candidates, then its unknown parts.
    j : int
        The joint.
    expected : (a,), optional
        Standard deviations that one over the gain and its products with these parts may have.
    """
    seen = found.missing.seen
    known = found.known
    size = known.directions.shape[1]
    at = known.size
    # Friction of this joint is fitted to its rows, in its unit.
    X = seen.X[:, [j]]
    y = seen.y[:, [j]]
    values = pooled_values(X, y, np.eye(size), np.zeros(size))
    fitted = replace(known, base=known.base + known.directions @ values)
    one = replace(found, known=fitted).having(sums, j, expected)
    may = {c.group[0] for c, *_ in one.columns if c.pattern and c.kind == "friction"}
    groups = tuple(g for g in one.groups if g.family in may)
    value, covariance = one.solve(replace(one.model, groups=groups).search())
    return float(value[at]), float(np.sqrt(covariance[at, at]))


def _state_gain(robot: Robot, joint: str, inverse: float, sd: float) -> Quantity:
    """Return the gain of a joint's torque from one over it, and its error."""
    # Torque that was read by a gain is that of the load by this over the right one.
    column = robot.torque_column(joint)
    read = robot.torque.at("gain", column) or 1.0
    inverse = inverse / read or np.nan
    sd = sd / abs(read)
    half = REACH * sd
    low = -np.inf
    high = np.inf
    if abs(inverse) > half:
        low, high = sorted((1.0 / (inverse - half), 1.0 / (inverse + half)))
    sure = percent_of(sd, inverse) <= Thresholds().sigma_percent
    why = "" if sure else phrase("untold", "load")
    if not column:
        why = phrase("untold", "motors")
    turns = column not in ("", joint) or robot.torque.at("ratio", joint)  # as motors do
    unit = "N·m" if turns else robot.torque_units[robot.joints.index(joint)]
    return Quantity(column or joint, unit, 1.0 / inverse, low, high, why)


@frozen
class KnownLoad:
    """Stated properties of a load.

    Attributes
    ----------
    mass : float or None [kg]
    centre : (3,) or None [m]
    inertia : (3,) or None [kg·m²]
        About its centre.
    """

    mass: float | None
    centre: Point | None
    inertia: Point | None

    def check(self, empty: Sequence[LogLike], reach: float, *, turns: bool) -> None:
        """Refuse a load that is known in part; logs instead of a result need more of it.

        The centre of a load that the robot cannot turn has no torque. A centre much farther away
        than the robot reaches [m] is in another unit.

        Raises
        ------
        OptionError
        """
        mass = self.mass is not None
        centre = self.centre is not None
        if centre > mass or (self.inertia is not None) > centre:
            raise OptionError(Finding("load.moments"))
        away = float(np.linalg.norm(self.centre or 0.0))
        if away > PHYSICAL_RULES.widest * max(reach, 1.0):
            raise OptionError(Finding("load.far", away=away, reach=reach))
        if empty and not mass:
            raise OptionError(Finding("load.mass"))
        if empty and turns and not centre:  # by one gain of all joints it would be found elsewhere
            raise OptionError(Finding("load.centre"))

    def parameters(self, nearest: Array) -> Array:
        """Return its ten parameters in the order of `INERTIAL_KINDS`.

        An unstated centre is taken from the nearest physically consistent body, together with the
        moments.
        """
        if self.mass is None or self.centre is None:
            return (nearest * (self.mass or 0.0) / nearest[9])[FROM_GROUPED]
        inertia = np.zeros(3) if self.inertia is None else self.inertia
        return ten_parameters(self.mass, self.centre, inertia)


# `Load`: mass, centre and inertia of a load as numbers.


@frozen(kw_only=True)
class Load(Result):
    """The load on a body, made by `payload`.

    `to_frame` has one row a quantity: ``name``, value, interval, unit, verdict, why. For a known
    load it has one row a joint, with its gain.

    Attributes
    ----------
    robot : Robot
    body : str
        Body that carries it; positions and moments are along the axes of its joint's frame.
    model : str
        Name of the fitted model.
    logs, without : tuple of str
        Logs with the load, and without.
    estimate : LoadEstimate
        The estimate from the logs alone.
    motion : Motion
        Of the first log with the load.
    parameters : (10,)
        Of the nearest physically consistent body, in the order of `GROUPED_KINDS`, about the origin
        of the frame.
    as_measured : tuple of Quantity
        Mass, centre, and moments of inertia about it, if the torque columns are right as they are
        read.
    by_file : tuple of Quantity
        The same by the masses of the robot file. The intervals contain the doubt about the torque
        constants.
    scale : TorqueScale
        By which factor torque is read too large.
    gains : tuple of Quantity
        Of each joint's torque column, for the sidecar, where the load's mass is known.
    load : KnownLoad
        What was stated of the load.
    hints : tuple of str
    fit : Fit or None
        The result without the load; None where a load is known.
    """

    schema = "identifiability/payload/1"

    robot: Robot
    body: str
    model: str
    logs: Strings
    without: Strings
    estimate: LoadEstimate
    motion: Motion
    parameters: Array
    as_measured: tuple[Quantity, ...]
    by_file: tuple[Quantity, ...]
    scale: TorqueScale
    load: KnownLoad
    gains: tuple[Quantity, ...] = ()
    hints: Strings = ()
    fit: Fit | None = None

    @property
    def known(self) -> float | None:
        """The stated mass of the load [kg]."""
        return self.load.mass

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Mass, centre and moments; by torque as it was read where the file contradicts it."""
        return self.as_measured if self.scale.contradicts else self.by_file

    @property
    def stated(self) -> tuple[Quantity, ...]:
        """The same, with both masses where the robot file contradicts the torque constants."""
        mass, *others = self.quantities
        if not self.scale.contradicts:
            return (mass, *others)
        return (mass, replace(self.by_file[0], name=BY_FILE), *others)

    @property
    def mass(self) -> Quantity:
        """Of the load [kg]."""
        return self.quantities[0]

    @property
    @presented
    def answer(self) -> str:
        """Mass and centre, or gains from a known mass, in one sentence."""
        raise NotImplementedError

    @property
    def sidecar(self) -> str:
        """Lines for the robot's sidecar; empty if no gain is identifiable."""
        gains = {g.name: float(f"{g.value:.6g}") for g in self.gains if g.told}
        if gains:
            return f"[torque]\ngain = {for_toml(gains)}\n"
        return ""

    @property
    @presented
    def caveats(self) -> Strings:
        """Reasons to doubt the answer, each with a remedy."""
        raise NotImplementedError

    def rows_by_name(self) -> Iterator[Row]:
        """Yield the quantities of the load, and the gain of each joint by the joint's name."""
        conditions = {}
        if self.scale.contradicts:
            constants = phrase("untold", "constants")
            conditions = {"mass": constants, BY_FILE: phrase("untold", "file")}
        for quantity in (*self.stated, *self.gains):
            yield Row(
                name=quantity.name,
                estimate=quantity.value,
                standard_error=quantity.sigma,
                interval=(quantity.low, quantity.high),
                unit=quantity.unit,
                verdict="identifiable" if quantity.told else "not identifiable",
                reason=quantity.why or conditions.get(quantity.name, ""),
                details={},
            )

    def to_dict(self) -> Json:
        """Return the load in the documented JSON schema."""
        own = ["model", "body", "statement", "logs", "without", "caveats"]
        quantities = [*map(_describe, self.quantities)]
        as_measured = [*map(_describe, self.as_measured)]
        by_file = _describe(self.by_file[0]) if self.scale.contradicts else None
        estimate = name_each(GROUPED_KINDS, self.estimate.theta)
        gains = [*map(_describe, self.gains)]
        parameters = name_each(GROUPED_KINDS, self.parameters)
        changed = [c.place for c in self.estimate.changes if c.kind == "friction"]
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            **{name: getattr(self, name) for name in own},
            "mass": quantities[0],
            "mass_by_file": by_file,
            "quantities": quantities,
            "as_measured": as_measured,
            "torque_scale": asdict(self.scale),
            "parameters": parameters,
            "estimate": estimate,
            "covariance": self.estimate.covariance.tolist(),
            "order": list(GROUPED_KINDS),
            "friction_changed": changed,
            "gains": gains,
        }


def _describe(number: Quantity) -> Json:
    """Return a number about a load for JSON."""
    return {**asdict(number), "told": number.told}


@checked
def payload(
    robot: RobotLike | Case,
    result: FitLike | Logs,
    logs: Logs,
    without: Logs = (),
    *,
    body: str | None = None,
    mass: Positive | None = None,
    centre: Point | None = None,
    inertia: Point | None = None,
    engine: Engine | None = None,
) -> Load:
    """Find mass, centre and inertia of a load on a body, or torque gains from a known load.

    Parameters
    ----------
    robot : Robot, path, shipped name, or Case
        The robot that the result is about. The fitted logs of a case are the logs without the load.
    result : Fit, Analysis, Ladder, Diagnosis or path
        Fitted to logs without the load. Its uncertainty enters every interval. Where the load is
        known it may be logs without it instead: then gains may be anything.
    logs : log, path, DataFrame, or several
        Logs with the load; they are prepared like the fitted ones, with the same cut-off.
    without : the same, optional
        Logs without the load, best of the same day and along the same motion: effects that the
        model lacks act equally in both.
    body : str, optional
        Which carries the load; by default the open end of a chain, or the platform, on which
        most loops end.
    mass : float, optional
        Of the load, where it is known [kg]: then the torque gain of each joint follows.
    centre : (3,), optional
        Its centre of mass in the frame of the body's joint [m]; by default estimated from the logs,
        under the assumption that all joints have one gain.
    inertia : (3,), optional
        Its moments about its centre, along the axes of that frame [kg·m²]; by default unknown, so
        that the intervals of gains are wider.
    engine : Engine, optional
        Where logs that are too long for memory are processed.

    Raises
    ------
    RobotError
        If there is no such body, or several can carry the load and none was named.
    IdentifiabilityError
        If the result is about another robot, or a log does not fit it.
    """
    run = Run(engine=engine or Serial())
    load = KnownLoad(mass, centre, inertia)
    with one_thread("blas"):
        case = take_case(robot, (), without, None)
        empty = [] if is_result(result) else list_logs(cast("Logs", result))
        fit = None if empty else find_fit(cast("FitLike", result), case.robot)
        structure = _without_gains(case.robot) if fit is None else fit.structure
        place = choose_body(structure, body)
        load.check(empty, measure_reach(structure.robot), turns=can_turn(structure, place))
        if isinstance(robot, Case):
            sides, hints = _join_case(case, fit, structure, logs, run)
        else:
            sides, hints = _prepare_sides(fit, structure, logs, [*empty, *case.validate], run)
        require_signal(sides.samples, "weighed")
        of_load = fit, structure, place, load, case.robot.gravity
        seen = sides.look(0)
        differences = _find_load(sides, seen, *of_load)
        found, remarks = choose_weight(differences, place)
        if is_loaded(structure.parameters):
            seen = carry_loads(sides, seen, [_first_load(found, place)] * sides.count)
            differences = _find_load(sides, seen, *of_load)
            found, remarks = choose_weight(differences, place)
        scale = UNSCALED
        if fit is not None and mass is None:
            scale = measure_torque_scale(fit, [sample.motion for sample in sides.samples])
        numbers = _state_load(found, sides, structure, place, scale)
        if mass is not None:
            theta = load.parameters(numbers["parameters"])
            numbers["gains"] = find_gains(differences, theta, moments=inertia is not None)
    model = fit.submodel.name if fit else full_model(structure.base).name
    remarks_once = dict.fromkeys([*remarks, *hints])
    return Load(
        robot=case.robot,
        body=place,
        model=model,
        load=load,
        hints=tuple(remarks_once),
        fit=fit,
        **numbers,
    )


def _state_load(
    found: Differences, sides: Sides, structure: Structure, place: str, scale: TorqueScale
) -> Fields:
    """Return logs, the estimate of a load, and its quantities, as a `Load` names them."""
    loaded, unloaded = sides.paths
    estimate = estimate_load(found, sides.names)
    nearest = nearest_body(estimate)
    bodies = draw_bodies(structure)[0][structure.inertial]
    length = float(np.median(natural_scale(bodies)[1]))
    turns = can_turn(structure, place)
    likely = nearest / scale.factor
    by_file = state_quantities(estimate, likely, length, scale, turns=turns)
    as_measured = state_quantities(estimate, nearest, length, UNSCALED, turns=turns)
    return {
        "logs": loaded,
        "without": unloaded,
        "motion": sides.samples[0].motion,
        "estimate": estimate,
        "parameters": nearest if scale.contradicts else likely,
        "as_measured": as_measured,
        "by_file": by_file,
        "scale": scale,
    }


def _prepare_sides(
    fit: Fit | None, structure: Structure, logs: Logs, unloaded: Logs, run: Run
) -> tuple[Sides, list[str]]:
    """Return logs with a load, then those without, with one cut-off, and remarks on all.

    The load contradicts the robot's file, so no checks run.
    """
    robot = structure.robot
    how = fit.preparation if fit else None
    reading = fit.reading if fit else None
    case = Case(robot, logs, unloaded, preparation=how, reading=reading, use=MEASURED)
    sides = read_sides(case, run)
    loaded = len(sides.fitted)
    both = replace(sides, fitted=(*sides.fitted, *sides.held_out), held_out=())
    common = case.common_preparation(robot, both)
    samples = case.unfitted(robot, both, common, run)
    hints = [*both.hints]
    if fit is not None:
        told = state_reading(fit, case, samples, run)
        hints = [*told, *fit.hints, *state_missing(fit.missing), *hints]
    hints += _tell_noise(both.fitted[:loaded], common)
    hints += [text for s in samples for text in s.hints]
    return Sides(loaded, structure.regression(samples)), hints


def _join_case(
    case: Case, fit: Fit | None, structure: Structure, logs: Logs, run: Run
) -> tuple[Sides, list[str]]:
    """Return logs with a load, then the fitted ones of a case without it, and remarks on all.

    Raises
    ------
    OptionError, LogError
        If the result is none, a log stands on both sides, or torque comes from commands.
    """
    if fit is None:
        raise OptionError(Finding("sides.result"))
    case = case.with_(reading=fit.reading)
    recordings = read_sides(case, run)
    loaded, hints = _prepare_sides(fit, structure, logs, (), run)
    seen = {log.sha256 for log in (*recordings.fitted, *recordings.held_out)}
    if any(log.sha256 in seen for log in loaded.samples):
        raise LogError(Finding("twice.sides"))
    robot = case.known_robot(run)
    how = case.common_preparation(robot, recordings)
    samples = case.prepared(robot, recordings, how, run).fitted
    regression = loaded.regression.followed_by(case.regression(structure, samples))
    return Sides(loaded.count, regression), [*hints, *recordings.hints]


def _first_load(found: Differences, place: str) -> dict[str, float]:
    """Return the parameters of the load on a body by name, without any further change."""
    first = found.known.size
    theta = found.solve()[0][first : first + 10][FROM_GROUPED]
    return name_each((f"{place}.{kind}" for kind in INERTIAL_KINDS), theta)


def _find_load(
    sides: Sides,
    seen: Excerpt,
    fit: Fit | None,
    structure: Structure,
    place: str,
    load: KnownLoad,
    gravity: Array,
) -> Differences:
    """Return the possible differences between logs with a load and the robot without it.

    Gravity (3,) [m/s²] is that of the robot file.
    """
    count = sides.count
    if fit is None or (load.mass is not None and count < len(sides.samples)):
        # Logs without the load tell more than values by other gains.
        submodel = full_model(structure.base) if fit is None else fit.submodel
        known = Known.nothing(submodel.M, submodel.fixed)
    else:
        known = Known.of(fit.base, fit.submodel.M, fit.covariance, fit.spread.unknown)
    patterns = list_patterns(len(sides.samples), count, count)
    weights = list_weights(structure.robot, gravity, place) if load.mass is None else ()
    return find_differences(structure, seen, (place,), known, patterns, weights=weights)


def _without_gains(robot: Robot) -> Structure:
    """Return a robot whose torque columns may be in units of their own, under the usual model.

    Raises
    ------
    OptionError
    """
    if robot.known_torque:  # in N·m, but the unit of the columns is to be found
        raise OptionError(Finding("load.torque"))
    free = replace(robot, torque=robot.torque.with_gains())
    return Structure.of(free, Model.of(*DEFAULT_EFFECTS))


def _tell_noise(logs: Sequence[Log], how: Preparation) -> Iterator[str]:
    """Yield a warning if noise of the motion can bias the load."""
    band = how.band if isinstance(how, CommonPreparation) else None
    loud = [x.name for x in logs if not {"dq", "ddq"} <= set(x.channels)]
    if loud and band is not None and band.noise > LOG_RULES.small:
        yield phrase("load_noise", "says", logs=listing(loud, 4))


def can_turn(structure: Structure, body: str) -> bool:
    """Return whether the robot can turn a body: else all torque by it depends on its mass alone."""
    turning = INERTIAL_KINDS[1:]
    turns = [p.owner == body and p.kind in turning for p in structure.parameters]
    return bool(structure.G[:, turns].any())


def choose_body(structure: Structure, body: str | None) -> str:
    """Return the body that carries the load.

    Raises
    ------
    RobotError
        If there is no such body, or several can carry the load and none was named.
    OptionError
        If the model has no bodies.
    """
    place = body_of(structure.robot, body)
    if f"{place}." not in structure.bodies:
        raise OptionError(Finding("load.bodies"))
    return place
