"""What hangs on a body: mass, centre and inertia, from logs of a robot that was fitted without.

The load's ten parameters are always in the mixed model of the loaded logs (`Differences`), beside
whatever the robot may differ by from the result, as far as its covariance allows, beside gains and
friction that differ between logs, and beside what else is told to have changed. A load that is
known tells the torque gains instead, joint by joint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from shlex import quote
from typing import Any, ClassVar, cast

import numpy as np
import pandas as pd
from scipy.stats import chi2

from identifiability.estimation.differences import (
    KINDS,
    OPEN,
    Differences,
    Known,
    LogRows,
    pooled_values,
    tool_bodies,
)
from identifiability.estimation.groups import Excerpt
from identifiability.estimation.noise import JointRuns
from identifiability.estimation.rules import Thresholds
from identifiability.foundation.answers import Answer, Table, frame_table
from identifiability.foundation.engines.mapping import Engine, one_thread
from identifiability.foundation.errors import listing, near_match
from identifiability.foundation.names import GROUPED_KINDS, INERTIAL_KINDS, Array, shorten_paths
from identifiability.foundation.numbers import REACH, measured
from identifiability.foundation.options import OptionError, Positive, checked
from identifiability.foundation.result import Result
from identifiability.foundation.rules import RuleTable, Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.instruments import noise_share
from identifiability.logs.repeats import Recording
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.physical.cad_prior import draw_bodies
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.fitted_model import LeastSquares
from identifiability.physical.project import project
from identifiability.physical.pseudo_inertia import entry_scale, natural_scale, to_matrix
from identifiability.regression.reduction import default_ladder
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.robot.changed import Point, ten_parameters
from identifiability.workflows.analyze.workflow import analyze
from identifiability.workflows.answers import answer_next, sentence, state_answers, with_hints
from identifiability.workflows.commands import given_paths, name_logs, source_name
from identifiability.workflows.compare import (
    Change,
    describe,
    find_changes,
    find_differences,
    find_pairs,
    is_result,
    look,
)
from identifiability.workflows.opening import LogLike, Logs, list_logs
from identifiability.workflows.predict import Fit, FitLike, find_fit, state_missing
from identifiability.workflows.rules import RULES
from identifiability.workflows.session import Session

# `LoadEstimate`: the ten parameters of a load, with everything that is not known of them.


#: A direction of the load whose torque may be so many times that of its joints is not told.
UNTOLD: Tolerance = 1e-2 * OPEN
#: A parameter is not told if so much of it lies along directions that are not.
TOUCHED: Tolerance = 1e-3
#: Its words.
WORDS_OF = "payload.how"
#: Where each of `GROUPED_KINDS` stands among `KINDS`.
ORDER = [KINDS.index(kind) for kind in GROUPED_KINDS]
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
    root : (10 − d, 10)
        ``|root (θ − theta)|²`` is the distance of another load from this one, in σ².
    unknown : (10, d)
        Directions that the logs do not tell, orthonormal.
    masses, sd : (l,) [kg]
        By each log with the load alone, where they are several.
    spread : float
        By how much masses scatter more than their variance, which is counted.
    rms : (n,) [N·m or N]
        What is left of the torque.
    changes : tuple of Change
        What else differs.
    """

    theta: Array
    covariance: Array
    root: Array
    unknown: Array
    masses: Array
    sd: Array
    spread: float
    rms: Array
    changes: tuple[Change, ...]

    @property
    def agree(self) -> bool:
        """Whether the logs say the same mass."""
        return self.spread <= 1.0


def estimate_load(found: Differences, structure: Structure) -> LoadEstimate:
    """Return the load that is in every hypothesis."""
    model = found.model
    terms = model.search()
    theta, spread = model.widened(terms, found.always_at()[ORDER])
    (part,) = (p for p in found.parts if p.role == "always")
    scale = part.scale[ORDER]
    square, turn = np.linalg.eigh(spread * np.outer(scale, scale))
    open_ = square > UNTOLD**2
    size = np.sqrt(np.maximum(square[~open_], np.finfo(float).tiny))
    told = turn[:, ~open_] * size / scale[:, None]
    unknown = np.linalg.qr(turn[:, open_] / scale[:, None])[0]
    loaded = np.flatnonzero(found.patterns[0])
    mass = found.always_at()[0]
    several = loaded if len(loaded) > 1 else loaded[:0]
    alone = [model.of_logs(several[[k]]).values(terms)[1:] for k in range(len(several))]
    masses = np.array([v[mass] for v, _ in alone])
    sd = np.array([np.sqrt(c[mass, mass]) for _, c in alone])
    wider = _scatter(masses, sd)
    left = found.residual(terms)[np.isin(found.rows.log, loaded)]
    return LoadEstimate(
        theta=theta,
        covariance=told @ told.T * max(wider, 1.0),
        root=(turn[:, ~open_] / size).T * scale,
        unknown=unknown,
        masses=masses,
        sd=sd,
        spread=wider,
        rms=np.sqrt(np.mean(left**2, axis=0)),
        changes=find_changes(structure, found, terms, [()]),
    )


def _scatter(masses: Array, sd: Array) -> float:
    """Return by how much masses scatter more than their variance, if surely; 1 if not."""
    if len(masses) < 2:
        return 1.0
    weights = sd**-2.0
    square = float(weights @ (masses - weights @ masses / weights.sum()) ** 2)
    sure = chi2.sf(square, len(masses) - 1) < Thresholds.sign_level
    return square / (len(masses) - 1) if sure else 1.0


# `Gain`: what one unit of a torque column is, by a load that is known.
#
# Torque that was read by wrong gains is a load by the same factor wrong. So each joint by itself,
# in units of its column: ``τ = W b + s W_load φ``, of which s is one over the gain and b is free,
# as parameters of the robot take the gain up [Gautier & Briot 2014].


@frozen
class Gain:
    """By which factor a joint's torque is larger than it was read as.

    Attributes
    ----------
    joint : str
    value : float
        NaN where nothing can be told.
    low, high : float
        95 %; infinite where zero is among what the column may be.
    verdict : str
        ``identifiable`` or ``not identifiable``.
    column : float
        What the sidecar must state as `gain` for torque to be right.
    """

    joint: str
    value: float
    low: float
    high: float
    verdict: str
    column: float


def find_gains(
    found: Differences, structure: Structure, seen: Excerpt, place: str, theta: Array
) -> tuple[Gain, ...]:
    """Return the gain of each joint's torque from a known load.

    Parameters
    ----------
    found : Differences
        What is known of the robot, and which logs have the load.
    structure : Structure
    seen : Excerpt
        Rows of all logs.
    place : str
    theta : (10,)
        In the order of `KINDS`.
    """
    out = []
    robot, known = structure.robot, found.known
    for j, joint in enumerate(robot.joints):
        base = pooled_values(seen.X[:, [j]], seen.y[:, [j]], known.directions, known.base)
        rows = LogRows.of(structure, seen, base, (place,)).of_joint(j)
        x, sd = np.nan, np.inf
        by = {c.kind: c for c in rows.causes}
        if "load" in by:
            unit = replace(by["gain"], torque={0: by["load"].torque[0] @ theta[:, None]})
            friction = (c for c in rows.causes if c.kind == "friction")
            rows = replace(rows, causes=(unit, *friction))
            own = replace(found, rows=rows, lacks=None, shared=1.0)
            _, solved, covariance = own.model.values(own.model.search())
            (at,) = own.always_at()
            x, sd = float(solved[at]), float(np.sqrt(covariance[at, at]))
        ends = [-np.inf, np.inf]
        if abs(x) > REACH * sd:
            ends = sorted(1.0 / (x + side * REACH * sd) for side in (-1, 1))
        sure = sd <= Thresholds().sigma_share * abs(x)
        verdict = "identifiable" if sure else "not identifiable"
        gain = robot.torque.gain.get(joint, robot.torque.gain.get("", 1.0))
        out.append(Gain(joint, 1.0 / x, ends[0], ends[1], verdict, gain / x))
    return tuple(out)


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

#: Those that no body has below zero.
MOMENTS = ("Ixx", "Iyy", "Izz")

#: Rows and columns of these moments in a tensor.
_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))

#: Least mass beside which moments are small or large [kg].
LIGHTEST: Tolerance = 1e-3


@frozen
class Quantity:
    """One number about a load.

    Attributes
    ----------
    name, unit : str
    value : float
    low, high : float
        95 % interval, of a mass or a moment about an axis not below zero.
    why : str
        Why the logs do not tell it; empty where they do.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    why: str = ""

    @property
    def told(self) -> bool:
        """Whether the logs tell it."""
        return not self.why

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
    heavy = values[0] > half[0]
    out = []
    for (name, unit), value, reach in zip(QUANTITIES.items(), values, half, strict=True):
        low, why = value - reach, ""
        if name == "mass" or name in MOMENTS:
            why = "" if low > 0 else f"at most {value + reach:.3g} {unit}"
            low = max(low, 0.0)
        elif name.startswith("centre") and reach > length:
            why = f"less certain than ± {length:.2g} m"
        if not np.isfinite(reach):
            why = "this motion does not tell it"
        elif not heavy and name != "mass":
            why = "no mass is told"
        out.append(Quantity(name, unit, float(value), float(low), float(value + reach), why))
    return tuple(out)


GAINS_OF = "By which factor torque is larger than it was read as"

# `Load`: mass, centre and inertia of what hangs on a body, in numbers and words.


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
    worse : (n,)
        How many times more is left of each joint's torque than in the result's own logs.
    quantities : tuple of Quantity
        Mass, centre, and moments of inertia about it.
    arm : (float, float, float)
        What the arm weighs by its file [kg], by which factor its torque says more, and the standard
        deviation of that; NaN where nothing says it.
    gains : tuple of Gain
        Of each joint's torque, where the load's mass is known.
    known : float or None
        That mass [kg].
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
    worse: Array
    quantities: tuple[Quantity, ...]
    arm: tuple[float, float, float]
    gains: tuple[Gain, ...] = ()
    known: float | None = None
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
        gains = () if self.known is None else (_gains(self),)
        tone = "blue" if self.mass.told else "amber"
        what = Answer(f"What hangs on {self.body}?", self.answer, self.proportional, tone)
        return *gains, what, _told_of(self), _trust(self), answer_next(_next_commands(self))

    def decided_by(self) -> tuple[RuleTable, ...]:
        """Return the numbers by which it was decided, the verb's own first."""
        return (RULES, Thresholds())

    def tables(self) -> tuple[Table, ...]:
        """Return one row a quantity, and one a joint whose gain a known load tells."""
        what = frame_table(self.to_frame(), "Mass, centre, and moments about the centre")
        what = replace(what, columns=with_hints("load", *what.columns))
        gains = frame_table(pd.DataFrame([asdict(g) for g in self.gains]), GAINS_OF)
        return (what,) if self.known is None else (what, gains)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        return state_answers(self.answer, self.answers(), self.hints)

    @property
    def proportional(self) -> str:
        """That the mass is proportional to gains, and what the arm itself says of these."""
        if not self.mass.told:
            return ""
        (mass, factor, sd), text = self.arm, sentence(WORDS_OF, "proportional")
        if not (np.isfinite(sd) and abs(factor - 1.0) > max(REACH * sd, RULES.gain_off)):
            return text
        own = {"weighs": mass * factor, "mass": mass, "load": self.mass.value / factor}
        return f"{text} {sentence(WORDS_OF, 'arm', **own)}"

    @property
    def sidecar(self) -> str:
        """Lines for the robot's sidecar; nothing if no gain is identifiable."""
        sure = [g for g in self.gains if g.verdict == "identifiable"]
        pairs = ", ".join(f'"{g.joint}" = {g.column:.6g}' for g in sure)
        return f"[torque]\ngain = {{{pairs}}}\n" if sure else ""

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Joints whose friction is another one than without the load."""
        return tuple(c.place for c in self.estimate.changes if c.kind == "friction")

    @property
    def caveats(self) -> tuple[str, ...]:
        """What makes the answer doubtful, and what to do."""
        k = int(np.argmax(self.worse))
        if self.pairs or self.worse[k] < RULES.grows:
            return ()
        own = {"joint": self.robot.joints[k], "ratio": f"{self.worse[k]:.2g}"}
        return (sentence(WORDS_OF, "changed", **own),)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a quantity: ``name``, value, interval, unit, whether it is told, why."""
        return pd.DataFrame([{**asdict(q), "told": q.told} for q in self.quantities])

    def log_frame(self) -> pd.DataFrame:
        """Return the mass by each log alone, with half of its interval; none of one."""
        found = self.estimate
        names = shorten_paths(self.logs) if len(found.masses) else []
        return pd.DataFrame({"log": names, "mass": found.masses, "half": REACH * found.sd})

    def to_dict(self) -> dict[str, Any]:
        """Return the load in the documented JSON schema."""
        own = ["model", "body", "statement", "logs", "without", "pairs", "caveats"]
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            **{name: getattr(self, name) for name in own},
            "quantities": self.to_frame().to_dict("records"),
            "parameters": dict(zip(GROUPED_KINDS, self.parameters.tolist(), strict=True)),
            "estimate": dict(zip(GROUPED_KINDS, self.estimate.theta.tolist(), strict=True)),
            "covariance": self.estimate.covariance.tolist(),
            "order": list(GROUPED_KINDS),
            "by_log": self.log_frame().to_dict("records"),
            "friction_changed": self.rubbing,
            "arm": dict(zip(("mass", "factor", "sd"), self.arm, strict=True)),
            "gains": [asdict(g) for g in self.gains],
        }


@checked
def payload(
    robot: RobotLike,
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
    """Find mass, centre and inertia of what hangs on a body, or torque gains from a known load.

    Parameters
    ----------
    robot : Robot, path or shipped name
        The robot that the result is about.
    result : Fit, Analysis, Ladder, Diagnosis or path
        Fitted to logs without the load. What it does not know of the robot enters every interval.
        Where the load is known it may be logs without it instead: then gains may be anything.
    logs : log, path, DataFrame, or several
        Logs with the load; they are prepared like the fitted ones, with the same cut-off.
    without : the same, optional
        Logs without the load, best of the same day and along the same motion: then whatever the
        model gets wrong along it cancels.
    body : str, optional
        Which carries the load; by default the last of a chain, or the platform, on which most
        loops end.
    mass : float, optional
        Of the load, where it is known [kg]: then the torque gain of each joint follows.
    centre : (3,), optional
        Its centre of mass in the frame of the body's joint [m]; by default where the logs say,
        which takes the gains of all joints for one.
    inertia : (3,), optional
        Its moments about its centre, along the axes of that frame [kg·m²].
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
        if mass is None and (centre is not None or inertia is not None):
            raise OptionError("A centre or moments of a known load need its mass; give --mass.")
        empty = [] if mass is None or is_result(result) else list_logs(cast("Logs", result))
        fit = _unknown_gains(robot, empty) if empty else find_fit(cast("FitLike", result), robot)
        without = [*empty, *list_logs(without)]
        structure, place = fit.structure, choose_body(fit.structure, body)
        session, second = Session.read_sides(
            structure, logs, without, fit.preparation, engine, alone=True
        )
        given, other = session.recordings.fitted, second.recordings.fitted
        both = session.beside(second)
        # What hangs on the robot is odd by its file, so that nothing odd is looked for.
        samples = session.prepare((*given, *other), "weighed")
        hints = [*both.recordings.hints, *_tell_noise(robot, given, session.how)]
        hints += [text for s in samples for text in s.hints]
        pairs = find_pairs(robot, (*given, *other), len(given), session.how) if fit.origin else []
        seen = look(structure, samples, 0)
        known = Known.of(fit.base, fit.submodel.M, fit.covariance, fit.spread.unknown)
        free = Known.nothing(fit.submodel.M, fit.submodel.fixed)
        pattern = np.repeat([1.0, 0.0], [len(given), len(other)])
        asked = {"known": known, "patterns": (pattern,), "always": (0,)}
        found = find_differences(structure, seen, fit.base, (place,), pairs, **asked)
        alone = replace(found, known=free if other else known, lacks=None)
        gains: tuple[Gain, ...] = ()
        if mass is not None and not fit.origin:
            gains = find_gains(alone, structure, seen, place, _known(mass, centre, inertia))
            seen = _rescaled(seen, gains)
            base = pooled_values(seen.X, seen.y, free.directions, free.base)
            found = replace(alone, rows=LogRows.of(structure, seen, base, (place,)))
        estimate = estimate_load(found, structure)
        nearest = nearest_body(estimate)
        if mass is not None and fit.origin:
            theta = nearest[np.argsort(ORDER)] * mass / nearest[9]
            theta = theta if centre is None else _known(mass, centre, inertia)
            gains = find_gains(alone, structure, seen, place, theta)
        bodies = draw_bodies(structure).phi[structure.inertial]
        length = float(np.median(natural_scale(bodies)[1]))
    paths = given_paths(given), given_paths(other)
    return Load(
        robot=robot,
        body=place,
        model=fit.submodel.name,
        logs=paths[0],
        without=paths[1],
        pairs=tuple((paths[0][p.at[0]], paths[1][p.at[1] - len(given)]) for p in pairs),
        estimate=estimate,
        parameters=nearest,
        worse=estimate.rms / (np.maximum(fit.spread.low, 1e-300) if fit.origin else np.inf),
        quantities=state_quantities(estimate, nearest, length),
        arm=weigh_arm(fit, seen),
        gains=gains,
        known=mass,
        hints=tuple(dict.fromkeys(filter(None, (state_missing(fit.missing), *hints)))),
        origin=fit.origin,
    )


def _unknown_gains(robot: Robot, logs: Sequence[LogLike]) -> Fit:
    """Return a fit to logs of a robot whose torque columns are taken as they are.

    Raises
    ------
    OptionError
    """
    if robot.known_torque:  # in N·m, and what the columns are in is what is asked
        raise OptionError(
            "Gains are identified without [[known_torque]]: take it out of the sidecar."
        )
    one = replace(robot, torque=replace(robot.torque, gain={"": 1.0}, ratio={"": 1.0}, sign={}))
    return replace(analyze(one, logs, ladder=default_ladder(one), replicates=0).fit, origin="")


def _rescaled(seen: Excerpt, gains: Sequence[Gain]) -> Excerpt:
    """Return rows with torque by the gains that were found; without joints where there is none."""
    sure = [g.verdict == "identifiable" for g in gains]
    factors = np.where(sure, [np.nan_to_num(g.value) for g in gains], 0.0)
    runs = tuple(own if s else () for own, s in zip(seen.runs.each, sure, strict=True))
    raw, y = seen.raw * factors, seen.y * factors
    return replace(seen, X=seen.X * np.array(sure)[:, None], y=y, raw=raw, runs=JointRuns(runs))


def _known(mass: float, centre: Point | None, inertia: Point | None) -> Array:
    """Return the ten parameters of a known load in the order of `KINDS`.

    Raises
    ------
    RobotError
    """
    nothing = np.zeros(3)
    ten = ten_parameters(
        mass, nothing if centre is None else centre, nothing if inertia is None else inertia
    )
    return ten[[INERTIAL_KINDS.index(kind) for kind in KINDS]]


def weigh_arm(fit: Fit, seen: Excerpt) -> tuple[float, float, float]:
    """Return what the arm weighs by its file [kg], and by which factor its torque says more.

    With the standard deviation of the factor; NaN where the file says nothing.
    """
    structure, M = fit.structure, fit.submodel.M
    mass = sum(fit.robot.nominal.get(f"{b}.m", 0.0) for b in fit.robot.bodies)
    rigid = [structure.parameters[k].group == "rigid_body" for k in structure.base.kept]
    W = (seen.X * np.array(rigid)).reshape(-1, len(rigid))
    stated = W @ structure.nominal_base
    square = float(stated @ stated)
    if not (mass > 0 and square > 0):
        return mass, float("nan"), float("nan")
    slope = stated @ W / square
    variance = float(slope @ M @ fit.covariance @ M.T @ slope)
    blind = np.abs(slope @ M @ fit.spread.unknown).max(initial=0.0) > TOUCHED
    return mass, float(slope @ fit.base), float("nan") if blind else float(np.sqrt(variance))


def _tell_noise(robot: Robot, logs: Sequence[Recording], how: Preparation) -> list[str]:
    """Return what noise of the motion does to the load, where it does."""
    computed = [x for x in logs if isinstance(x, Log) and not {"dq", "ddq"} <= set(x.channels)]
    share = {x.name: noise_share(robot, x, how.outputs or how.cutoff) for x in computed}
    loud = [name for name, own in share.items() if own > LOG_RULES.noise_share**0.5]
    return [sentence(WORDS_OF, "noise", logs=listing(loud, 4))] if loud else []


def choose_body(structure: Structure, body: str | None) -> str:
    """Return the body that carries the load.

    Raises
    ------
    OptionError
    """
    robot, best = structure.robot, tool_bodies(structure)
    if body is None and len(best) > 1:
        raise OptionError(f"The load may hang on {listing(best, 8)}; name its body (--body).")
    body = body or (*best, robot.bodies[-1])[0]
    if body not in robot.bodies:
        raise OptionError(
            f"'{body}' is no moving body of {robot.name}{near_match(body, robot.bodies)} A load "
            f"can hang on {listing(robot.bodies, 12)}."
        )
    if f"{body}." not in structure.bodies:
        raise OptionError("The result's model has no bodies (rigid_body); fit one that has.")
    return body


def _told_of(result: Load) -> Answer:
    count = sum(q.told for q in result.quantities)
    short = f"{count} of {len(result.quantities)} quantities are told."
    by: dict[str, list[str]] = {}
    for q in result.quantities:
        if not q.told:
            by.setdefault(q.why, []).append(q.name)
    lost = "; ".join(f"{listing(names)} ({why})" for why, names in by.items())
    text = f"Not told: {lost}." if lost else ""
    return Answer("How well is it known?", short, text, "green" if result.mass.told else "amber")


def _trust(result: Load) -> Answer:
    rows = result.log_frame().to_dict("records")
    each = listing([f"{r['log']} {measured(r['mass'], r['half'], 'kg')}" for r in rows], 4)
    short, text, tone = "Yes, within its intervals.", f"The logs agree ({each}).", "green"
    if result.pairs:
        text = sentence(WORDS_OF, "cancels")
    elif not rows:
        short, tone = "As far as one log can tell.", "amber"
        text = "One motion cannot show what another would change."
    if not result.estimate.agree:
        short, tone = "With care: intervals are widened to hold all logs.", "amber"
        text = f"The logs disagree ({each})."
    if changes := [describe(change) for change in result.estimate.changes]:
        text += f" Beside the load {listing(changes)}, which the intervals hold."
    if result.caveats:
        short, tone = "With care: the robot changed since.", "amber"
    return Answer("May I trust it?", short, " ".join([text, *result.caveats]), tone)


def _next_commands(result: Load) -> list[tuple[str, str]]:
    robot, logs = source_name(result.robot), name_logs(result.robot, result.logs)
    call = f"identifiability payload {robot} {quote(result.origin)} {logs} --body {result.body}"
    text = "Weigh it against a log of the same motion without the load (empty.csv):"
    paired = [] if result.pairs else [(text, f"{call} --without empty.csv --report payload.html")]
    begun = name_logs(result.robot, result.logs, "--start-from")
    more = f"identifiability excite {robot} {begun} --out next.json"
    return [*paired, ("Find a motion that tells more:", more)]


def _gains(result: Load) -> Answer:
    sure = [g for g in result.gains if g.verdict == "identifiable"]
    tone = "green" if len(sure) == len(result.gains) else "amber" if sure else "vermilion"
    short = f"{len(sure)} of {len(result.gains)} are known."
    said = [f"{g.joint} {g.value:.4g} ({g.low:.4g} … {g.high:.4g})" for g in sure]
    text = f"By {result.known:g} kg torque is so many times what was read: {listing(said, 12)}."
    if not sure:
        text = "The logs do not tell the gain of any torque column."
    if lost := [g.joint for g in result.gains if g not in sure]:
        text += f" {sentence(WORDS_OF, 'untold', joints=listing(lost, 12))}"
    return Answer("What is one unit of each torque column?", short, text, tone)
