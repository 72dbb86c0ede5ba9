"""What one unit of a torque column is, from logs with and without a known load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import chain
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from scipy import stats
from threadpoolctl import threadpool_limits

from identifiability.effects.inertia import Payload
from identifiability.estimation.noise import autocorrelation_time, autocovariance, lagged_sums
from identifiability.estimation.noise import fit_joint as fit_noise
from identifiability.estimation.rules import Thresholds
from identifiability.foundation.answers import Answer, Column, Note, Table
from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.linalg import RANK_TOLERANCE
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.numbers import holm
from identifiability.foundation.options import OptionError, Positive, checked
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import digits, format_count
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.logs.prepare.plan import has_motors
from identifiability.logs.prepare.preparation import settle_cutoff
from identifiability.regression.reduction import USUAL_EFFECTS, ModelLike, choose_model
from identifiability.regression.regression import Model, Regression
from identifiability.robot import Robot, RobotLike
from identifiability.robot.changed import Point, ten_parameters
from identifiability.workflows.opening import Logs, in_memory, read_recordings
from identifiability.workflows.rules import RULES

# `Gain` and `Gains`: what `identify_gains` returns.


@frozen
class Gain:
    """What one unit of a joint's torque column is.

    Attributes
    ----------
    joint : str
    value : float [N·m or N per unit]
        NaN where nothing can be told.
    interval : (float, float)
        95 %; infinite where zero is among what the column may be per N·m.
    sigma_percent : float
        Standard deviation of one over the gain, in percent of it.
    verdict : str
        ``identifiable``, ``weak`` (its sign is certain) or ``not identifiable``.
    load : float [N·m or N]
        Root mean square of the load's torque that nothing else explains.
    """

    joint: str
    value: float
    interval: tuple[float, float]
    sigma_percent: float
    verdict: str
    load: float


@frozen
class Gains(Result):
    """The gains of all joints. Make them with `identify_gains`.

    Attributes
    ----------
    robot : str
    body : str
        Which the load is fixed to.
    mass : float [kg]
    gains : tuple of Gain
    hints : tuple of str
        On how logs were read, and what is odd about them.
    """

    schema: ClassVar[str] = "identifiability/gains/1"

    robot: str
    body: str
    mass: float
    gains: tuple[Gain, ...]
    hints: tuple[str, ...] = ()

    @property
    def known(self) -> dict[str, float]:
        """The gains that are identifiable [N·m or N per unit], by joint."""
        return {g.joint: g.value for g in self.gains if g.verdict == "identifiable"}

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        found = [
            f"{g.joint} {g.value:.4g} ({g.interval[0]:.4g} … {g.interval[1]:.4g})"
            for g in self.gains
            if g.joint in self.known
        ]
        others = [g.joint for g in self.gains if g.joint not in self.known]
        text = (
            f"One unit of the torque columns is, in N·m (N for slides), with 95 % intervals: "
            f"{listing(found, 12)}."
            if found
            else "The logs do not tell what one unit of any torque column is."
        )
        if others:
            text += (
                f" Of {listing(others, 12)} they do not tell it: move these joints where the load "
                "is heavy for them, faster, or take a heavier load."
            )
        return text

    @property
    def sidecar(self) -> str:
        """Lines for the robot's sidecar; nothing if no gain is identifiable."""
        pairs = ", ".join(f'"{j}" = {g:.6g}' for j, g in self.known.items())
        return f"[torque]\ngain = {{{pairs}}}\n" if pairs else ""

    @property
    def heading(self) -> tuple[str, str, str]:
        """Title of its page, what kind of page it is, and what it is about."""
        return self.robot, "Gains of torque columns", f"{self.mass:g} kg on {self.body}"

    def answers(self) -> tuple[Answer, ...]:
        """Return of which joints one unit is known, and what to do with it."""
        known, count = len(self.known), len(self.gains)
        tone = "green" if known == count else "amber" if known else "vermilion"
        short = f"{known} of {format_count(count, 'gain')} {'is' if known == 1 else 'are'} known."
        table, _, line = self.sidecar.strip().partition("\n")
        sure = [g for g in self.gains if g.joint in self.known]
        worst = max(sure, key=lambda g: g.sigma_percent, default=None)
        least = (
            self.statement
            if worst is None
            else f"Least sure: {worst.joint} {worst.value:.4g} ({worst.interval[0]:.4g} … "
            f"{worst.interval[1]:.4g}, 95 %)."
        )
        return (
            Answer("What is one unit of each torque column?", short, least, tone),
            Answer(
                "What next?",
                "Write it into the sidecar." if known else "Measure once more.",
                f"Under {table}: {line}. With it these columns are torque, for every verb."
                if known
                else "Move joints where the load is heavy for them, or take a heavier load.",
            ),
        )

    def cautions(self) -> tuple[Note, ...]:
        """Return how logs were read, and what is odd about them."""
        return tuple(Note("note", "", hint) for hint in self.hints)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a joint."""
        rows = [{**asdict(g), "low": g.interval[0], "high": g.interval[1]} for g in self.gains]
        names = ["joint", "gain", "low", "high", "sigma_percent", "verdict", "load"]
        return pd.DataFrame(rows).rename(columns={"value": "gain"}).reindex(columns=names)

    def to_dict(self) -> dict[str, Any]:
        """Return the gains in a JSON schema of their own."""
        return {
            "schema": self.schema,
            "robot": self.robot,
            "body": self.body,
            "mass": self.mass,
            "gains": self.to_frame().to_dict("records"),
            "statement": self.statement,
            "hints": list(self.hints),
        }

    def decided_by(self) -> tuple[RuleTable, ...]:
        """Return the numbers by which it was decided, the verb's own first."""
        return (RULES, Thresholds())

    def tables(self) -> tuple[Table, ...]:
        """Return one row a joint."""
        caption = f"{self.robot}: torque in N·m (N for slides) per unit of the log"
        return (Table.of(caption, GAINS, self.gains),)


GAINS = (
    Column("joint", get="joint"),
    Column("gain", digits(4), "value"),
    Column("from", digits(4), lambda g: g.interval[0]),
    Column("to", digits(4), lambda g: g.interval[1]),
    Column("verdict", get="verdict"),
    Column("load seen", digits(3), "load"),
)


# The fit of each joint by itself: raw torque is what the load and the robot without it demand.
#
# How far noise moves a gain is measured on two roads, and the larger counts, as of parameters:
# what the residual and its scores remember, and autoregressive noise by restricted likelihood
# [Harville 1977], which knows that the fit takes slow noise out of its residual. Where noise
# remembers ten samples, the first alone is a tenth too small.


#: Effects that are the same with and without a load.
SAME = ("rigid_body", "actuator_inertia")


def gather(
    every: Regression, first: int, place: str, load: Array
) -> tuple[Array, Array, Array, np.ndarray]:
    """Return raw torque (N, n), the load's torque (N, n), columns (N, n, p) and the log (N,).

    Parameters
    ----------
    every : Regression
        Of all logs, first those without the load.
    first : int
        The first log with it.
    place : str
        The body that carries it.
    load : (10,)
        Its parameters there.
    """
    own = np.array([p.group == "payload" for p in every.parameters])
    here = [k for k, p in enumerate(every.parameters) if own[k] and p.owner == place]
    friction = np.array([p.group not in (*SAME, "payload") for p in every.parameters])
    tau, torque, columns, which = [], [], [], []
    for log, _, W, measured in every.chunks():
        loaded = log >= first
        tau.append(measured)
        torque.append(W[:, :, here] @ load * loaded)
        varied = [W[:, :, friction] * (loaded == state) for state in (False, True)]
        columns.append(np.concatenate([W[:, :, ~own & ~friction], *varied], axis=2))
        which.append(np.full(len(measured), log))
    return tuple(map(np.concatenate, (tau, torque, columns, which)))  # type: ignore[return-value]


def fit_joint(
    measured: Array, load: Array, columns: Array, log: np.ndarray
) -> tuple[float, float, float, float]:
    """Return one over the gain, its standard deviation and degrees of freedom, and the load left.

    Parameters
    ----------
    measured : (N,) [units of the log]
    load : (N,) [N·m or N]
        Torque of the load.
    columns : (N, p)
    log : (N,) int
    """
    length = np.linalg.norm(columns, axis=0)
    U, s, _ = np.linalg.svd(columns[:, length > 0] / length[length > 0], full_matrices=False)
    basis = U[:, s > RANK_TOLERANCE * s.max(initial=0.0)]
    left, y = (x - basis @ (basis.T @ x) for x in (load, measured))
    square = float(left @ left)
    size = float(np.sqrt(square / len(load)))
    # A load's torque of which less than this share is left beside the model cannot be told
    # from it.
    if not square > 0.0001**2 * float(load @ load):
        return np.nan, np.inf, 1.0, size
    x = float(left @ y) / square
    residual = y - x * left
    score = residual * left
    logs = [np.flatnonzero(log == k) for k in np.unique(log)]
    parts = [r[at, None] for r in (residual, score) for at in logs]
    runs = [(int(at[0]), int(at[-1]) + 1) for at in logs]
    noise = fit_noise(measured, [np.column_stack([basis, load])], runs)
    covariance = noise.sigma**2 * autocovariance(noise.pacf, len(load) - 1)
    memory = max(
        *(float(autocorrelation_time(part)[0]) for part in parts),
        float(2.0 * covariance.sum() / covariance[0] - 1.0),
    )
    free = len(load) / memory - basis.shape[1] - 1
    if free < 1:
        return x, np.inf, 1.0, size
    # Of white errors both are their variance over that of the load, times the number of samples.
    spread = max(float(residual @ residual), float(score @ score) * len(load) / square) / square
    coloured = sum(_weigh(left[at], covariance) for at in logs) / square**2
    return x, float(np.sqrt(max(spread / free, coloured))), free, size


def _weigh(x: Array, covariance: Array) -> float:
    """Return ``xᵀ Σ x`` of a stretch (N,) and stationary noise with autocovariances (≥ N,)."""
    own = lagged_sums(x)
    return float(2.0 * own @ covariance[: len(x)] - own[0] * covariance[0])


def judge(
    joints: Sequence[str], found: Sequence[tuple[float, float, float, float]]
) -> tuple[Gain, ...]:
    """Return the gains with their intervals and verdicts.

    Parameters
    ----------
    joints : sequence of str
    found : sequence of tuple
        What `fit_joint` returns, of each joint.
    """
    out = []
    p = [2 * stats.t.sf(abs(x) / sd, free) if np.isfinite(x) else 1.0 for x, sd, free, _ in found]
    for joint, adjusted, (x, sd, free, size) in zip(joints, holm(np.array(p)), found, strict=True):
        reach = float(stats.t.ppf(0.975, free)) * sd
        ends = [-np.inf, np.inf]
        if abs(x) > reach:
            ends = sorted(1.0 / e for e in (x - reach, x + reach))
        relative = sd / abs(x) if x else np.inf
        verdict = "not identifiable"
        if adjusted < Thresholds.sign_level:
            verdict = "identifiable" if relative <= Thresholds().sigma_share else "weak"
        value = 1.0 / x if x else np.nan
        out.append(Gain(joint, value, (ends[0], ends[1]), 100 * relative, verdict, size))
    return tuple(out)


# `identify_gains`: what one unit of a torque column is, from logs with and without a known load.
#
# Currents and uncalibrated sensors tell torque up to a factor of each joint, ``τ = g i``.
# Parameters that are fitted to them take the factor up, and no log by itself tells. A load that is
# known does: for each joint by itself, ``i = W (φ/g) + p (1/g)``, where ``p`` is the torque of the
# load alone, zero in logs without it [Gautier & Briot 2014; Gaz & De Luca 2017]. Friction may
# differ between loaded and unloaded logs: it grows with load, and warms up.


#: The model of the robot without its load.
EFFECTS = (*USUAL_EFFECTS[:-1], "torque_offset", USUAL_EFFECTS[-1])


@checked
def identify_gains(
    robot: RobotLike,
    logs: Logs,
    loaded: Logs,
    *,
    mass: Positive,
    centre: Point = (0.0, 0.0, 0.0),
    inertia: Point = (0.0, 0.0, 0.0),
    body: str | None = None,
    model: ModelLike | None = None,
    preparation: Preparation | None = None,
) -> Gains:
    """Identify what one unit of each torque column is, from a load that is known.

    Parameters
    ----------
    robot : Robot, path or shipped name
        What its sidecar says of gains, ratios and signs is left aside: the result replaces it.
    logs : log, path, DataFrame, or several
        Logs without the load; columns ``<joint>.tau`` or ``<joint>.current`` in any unit.
    loaded : the same
        Log with it.
    mass : float [kg]
        Of the load [kg].
    centre : (3,)
        Its centre of mass in the frame of the body's joint [m].
    inertia : (3,)
        Its moments of inertia about its centre, along the axes of that frame [kg·m²].
    body : str, optional
        Which it is fixed to; by default the last one.
    model : Model, sequence of str or path of a model file, optional
        Effects of the robot without the load; by default bodies, viscous and Coulomb friction,
        offsets and actuator inertia.
    preparation : Preparation, optional
        How derivatives are made.

    Raises
    ------
    LogError, OptionError
    """
    with threadpool_limits(1):
        robot = Robot.of(robot)
        robot.check_stands("identifying gains")
        if robot.known_torque:  # in N·m, and what the columns are in is what is asked
            raise OptionError(
                "Gains are identified without [[known_torque]]: take it out of the sidecar."
            )
        place, load = _load_of(robot, mass, centre, inertia, body)
        known = replace(Conventions.of(robot), raw_torque=True)
        recordings = read_recordings(logs, loaded, known, preparation)
        without, with_load = (in_memory(x, Log) for x in (recordings.fitted, recordings.held_out))
        if not with_load:
            raise LogError("No log with the load was given; give at least one.")
        _refuse_motors(robot, [*without, *with_load])
        how = settle_cutoff(robot, [*without, *with_load], preparation)
        samples = [prepare_samples(robot, log, how) for log in (*without, *with_load)]
        chosen = choose_model(model, EFFECTS)
        loaded_model = Model((*chosen.effects, Payload()))
        every = Regression(robot, loaded_model, tuple(samples))
        rows = gather(every, len(without), place, load)
        tau, torque, columns, log = rows
        found = [
            fit_joint(tau[:, j], torque[:, j], columns[:, j], log) for j in range(len(robot.joints))
        ]
        hints = (*recordings.hints, *chain.from_iterable(s.hints for s in samples))
    return Gains(robot.name, place, float(mass), judge(robot.joints, found), hints)


def _load_of(
    robot: Robot, mass: float, centre: Point, inertia: Point, body: str | None
) -> tuple[str, Array]:
    """Return the body that carries the load, and its ten parameters there.

    Raises
    ------
    OptionError
    """
    places = [p.owner for p in Payload().parameters(robot)][:: len(INERTIAL_KINDS)]
    if body is None and len(places) > 1:
        raise OptionError(f"The load may be fixed to {listing(places)}; name one of them as body.")
    place = places[-1] if body is None else body
    if place not in places:
        raise OptionError(
            f"'{place}' is no last body of the robot{near_match(place, places)} "
            f"A load is fixed to {listing(places)}."
        )
    c, own = np.asarray(centre, float), np.asarray(inertia, float)
    if c.shape != (3,) or own.shape != (3,) or not np.isfinite([*c, *own]).all() or own.min() < 0:
        raise OptionError("centre and inertia are three numbers each, x, y and z, of real bodies.")
    return place, ten_parameters(mass, c, own)


def _refuse_motors(robot: Robot, logs: Sequence[Log]) -> None:
    for log in logs:
        if has_motors(robot, log):
            raise LogError(
                f"{log.name} has motors that mix joints; gains are identified from torques of "
                "joints."
            )
