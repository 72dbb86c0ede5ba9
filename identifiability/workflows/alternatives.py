"""Alternatives of the model itself: under a wrong one everything else seems to be missing.

Torque columns may be exchanged, turned, late or in another unit, a driver may have taken gravity
out of them, a base may stand otherwise than its file says. Each is a base model of the same torque,
fitted alike, with friction and rotor inertia that are not negative, and judged on blocked folds of
the fitted logs (`estimation.evidence`). Held-out logs choose none, and masses of the file neither:
one unit of all columns is none of these, since a linear model cannot tell it from other masses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from identifiability.estimation.evidence import Evidence, Folds, Level, Score
from identifiability.estimation.noise import autocorrelation_time
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.commands import of_commands
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.gravity import Leaning, propose_leaning
from identifiability.workflows.oddities import MeasuredLogs
from identifiability.workflows.oddities.timing import measure_delay
from identifiability.workflows.rules import RULES

#: Rows that are looked at, numbers that their columns may be, and alternatives that folds judge.
ENOUGH, NUMBERS, JUDGED = 2000, 4_000_000, 4

#: Units of one joint's torque beside the others'.
UNITS: tuple[Tolerance, ...] = (1e-3, 1e-2, 1e2, 1e3)

#: Columns that add less than this share of their squares to others are none.
RIDGE: Tolerance = 1e-9


@frozen
class Alternative:
    """Another reading of the torque columns, or another direction of gravity.

    Attributes
    ----------
    says : str
        What is otherwise, after which `statement` tells what was done.
    remedy : str
    order : (n,) int
        Column of the log that is the torque of each joint.
    factor : (n,)
        By which this is multiplied.
    late : (n,) [s]
        By how much it is late.
    gravity : bool
        Whether there is gravity in it.
    leaning : Leaning or None
        Where gravity points, if not where the file says.
    evidence : Evidence or None
        Over the model as it was given.
    """

    says: str
    remedy: str
    order: np.ndarray
    factor: Array
    late: Array
    gravity: bool = True
    leaning: Leaning | None = None
    evidence: Evidence | None = None

    @property
    def statement(self) -> str:
        """What is otherwise, by how much it errs less, what was done, and the remedy."""
        assert self.evidence is not None
        less = percent(1.0 - float(np.exp(-self.evidence.error.value)), 2)
        return (
            f"{self.says}: read so, the model errs by {less} less on motion that was not fitted "
            f"({self.evidence.density.value:.3g} nats). {self.remedy}."
        )

    def structure(self, given: Structure) -> Structure:
        """Return the model about its direction of gravity, or without any."""
        if self.leaning is not None:
            return self.leaning.structure
        return given if self.gravity else Structure.of(weightless(given.robot), given.model)

    def read(self, log: Log) -> Log:
        """Return a log with torque columns as they are meant."""
        columns = zip(self.order.tolist(), self.late.tolist(), strict=True)
        moved = [np.interp(log.t + by, log.t, log.tau[:, k]) for k, by in columns]
        return replace(log, tau=np.column_stack(moved) * self.factor)


def weightless(robot: Robot) -> Robot:
    """Return a robot whose torque holds no weight."""
    model = robot.model.copy()
    model.gravity.linear = np.zeros(3)
    return replace(robot, model=model)


def find_alternative(logs: MeasuredLogs) -> Alternative | None:
    """Return the best alternative of the model, if it surely errs less on folds of fitted logs."""
    robot, structure = logs.robot, logs.structure
    if robot.base is not None or any(map(of_commands, logs.recordings)):
        return None
    given = _Rows.of(logs, structure)
    if given is None:
        return None
    plain = _plain(len(logs.joints))
    tried = [(a, given) for a in _columns(logs, plain)]
    for a in _directions(logs, plain):
        rows = _Rows.of(logs, a.structure(structure))
        tried += [] if rows is None else [(a, rows)]
    errors = np.array([rows.left(a) for a, rows in tried])
    best: Alternative | None = None
    for k in np.argsort(errors)[:JUDGED]:
        evidence = _judge(plain, given, *tried[k])
        if evidence is None or not _is_clear(evidence):
            continue
        if best is None or evidence.error.value > _gain(best):
            best = replace(tried[k][0], evidence=evidence)
    return best


def _gain(a: Alternative) -> float:
    return 0.0 if a.evidence is None else a.evidence.error.value


def _is_clear(evidence: Evidence) -> bool:
    """Whether it wins by so many nats, and errs surely, and by so much, less."""
    wins = evidence.density.value >= RULES.alternative_nats
    less = evidence.error.value >= -np.log(RULES.alternative_error)
    return wins and less and evidence.level is Level.BETTER


def _plain(n: int) -> Alternative:
    """Return the columns as they are given."""
    return Alternative("", "", np.arange(n), np.ones(n), np.zeros(n))


def _columns(logs: MeasuredLogs, plain: Alternative) -> Iterator[Alternative]:
    """Yield other readings of the torque columns, but for what the sidecar says of them."""
    names, n, said = logs.joints, len(logs.joints), logs.robot.torque
    one, check = np.eye(n, dtype=bool), "Correct the log or the map of its columns"
    for i, j in combinations(range(n), 2):
        order = plain.order.copy()
        order[[i, j]] = j, i
        what = f"The torque columns of {names[i]} and {names[j]} seem to be exchanged"
        for sign, also in ((1.0, ""), (-1.0, ", and the sign of all to be wrong")):
            turned = sign * plain.factor
            yield replace(plain, says=what + also, remedy=check, order=order, factor=turned)
    if not said.sign:
        for k in range(n):
            what = f"The torque of {names[k]} seems to have the wrong sign"
            factor = np.where(one[k], -1.0, 1.0)
            yield replace(plain, says=what, remedy="Correct its sign in the log", factor=factor)
        what = "The torque of all joints seems to have the wrong sign"
        remedy = "Write sign = -1 under [torque] in the sidecar"
        yield replace(plain, says=what, remedy=remedy, factor=-plain.factor)
    for unit in () if said.gain or n < 2 else UNITS:
        for k in range(n):
            what = f"The torque of {names[k]} is {unit:g} times as large as its model's"
            factor = np.where(one[k], 1.0 / unit, 1.0)
            yield replace(plain, says=what, remedy="Correct its unit in the log", factor=factor)
    delay = measure_delay(logs, logs.samples[0])
    if delay is not None and delay.certain:
        who = "all joints" if delay.joint < 0 else names[delay.joint]
        by = f"{abs(delay.delay)} samples {'late' if delay.delay > 0 else 'early'}"
        late = np.where(one[delay.joint] | (delay.joint < 0), delay.delay * delay.step, 0.0)
        says = f"The torque of {who} seems to be {by}"
        yield replace(plain, says=says, remedy="Shift the column in the log", late=late)


def _directions(logs: MeasuredLogs, plain: Alternative) -> Iterator[Alternative]:
    """Yield the model without gravity, and about another direction of it."""
    robot = logs.robot
    if not robot.gravity.any() or "rigid_body" not in logs.structure.model.names:
        return
    if robot.torque.compensated is None:
        what = "The effort seems to be compensated for gravity"
        remedy = "Say compensated = true under [torque] in the sidecar"
        yield replace(plain, says=what, remedy=remedy, gravity=False)
    leaning = propose_leaning(logs)
    if leaning is not None:
        remedy = "Write the direction into the robot file, or export it"
        yield replace(plain, says=f"Gravity {leaning.text}", remedy=remedy, leaning=leaning)


@frozen
class _Rows:
    """Some rows of all logs under a model: columns, torque, time, which log, what is data."""

    W: Array
    tau: Array
    t: Array
    log: np.ndarray
    nonnegative: np.ndarray

    @staticmethod
    def of(logs: MeasuredLogs, structure: Structure) -> _Rows | None:
        """Return the rows; None if they are too few for the columns, or these too many."""
        n, p = len(logs.joints), len(structure.base.kept)
        each = max(1, min(ENOUGH, NUMBERS // (n * p)) // len(logs.samples))
        few = tuple(s.thin(max(1, s.survey.kept // each)) for s in logs.samples)
        if each * len(few) * n < 2 * p or n * p**2 > NUMBERS:
            return None
        parts = [(k, W.copy(), tau) for k, _, W, tau in structure.regression(few).chunks()]
        tau = np.concatenate([tau for *_, tau in parts])
        log = np.concatenate([np.full(len(tau), k) for k, _, tau in parts])
        if len(tau) * n < 2 * p or not (tau.std(0) > 0).all():
            return None
        t = np.concatenate([s.output_times() for s in few])
        W = np.concatenate([W for _, W, _ in parts])
        return _Rows(W, tau, t, log, structure.base.nonnegative)

    def torque(self, a: Alternative) -> Array:
        """Return the torque (N, n) as it is meant."""
        out = np.empty_like(self.tau)
        for k in np.unique(self.log):
            own = self.log == k
            for j, (c, by) in enumerate(zip(a.order, a.late, strict=True)):
                out[own, j] = np.interp(self.t[own] + by, self.t[own], self.tau[own, c])
        return out * a.factor

    def fit(self, y: Array, train: np.ndarray) -> Array:
        """Return values (F, p) of fits to some rows each, (F, N): what may not be negative is not.

        Each joint is weighed by its error, which the first fit gives.
        """
        left = ~train  # of few rows, unlike those that are fitted
        gram, cross = self.products(y, np.ones(len(y), bool))
        grams, crosses = (
            whole - np.stack(parts)
            for whole, parts in zip(
                (gram, cross), zip(*(self.products(y, x) for x in left), strict=True), strict=True
            )
        )
        weight = np.tile(1.0 / y.var(0), (len(train), 1))
        for _ in range(2):
            G = np.einsum("fa,fapq->fpq", weight, grams)
            g = np.einsum("fa,fap->fp", weight, crosses)
            x = _solve(G, g, self.nonnegative)
            error = np.stack(
                [((y - self.W @ v)[own] ** 2).mean(0) for v, own in zip(x, train, strict=True)]
            )
            weight = 1.0 / np.maximum(error, RIDGE * y.var(0))
        return x

    def products(self, y: Array, rows: np.ndarray) -> tuple[Array, Array]:
        """Return each joint's products of columns, (n, p, p), and with torque, (n, p)."""
        W = np.swapaxes(self.W[rows], 0, 1)
        return np.swapaxes(W, 1, 2) @ W, np.einsum("anp,na->ap", W, y[rows])

    def residual(self, a: Alternative) -> Array:
        """Return what a fit to all rows leaves of each joint's torque, (N, n)."""
        y = self.torque(a)
        (x,) = self.fit(y, np.ones((1, len(y)), bool))
        return self.as_given(a, y - self.W @ x)

    def as_given(self, a: Alternative, x: Array) -> Array:
        """Return torque (N, n) as the log gives it: by column, in its unit."""
        out = np.empty_like(x)
        out[:, a.order] = x / np.abs(a.factor)
        return out

    def left(self, a: Alternative) -> float:
        """Return its squares over those of each column about its mean."""
        return float((self.residual(a).var(0) / self.tau.var(0)).sum())

    def score(self, a: Alternative, folds: Folds, times: Array) -> Score:
        """Return what is predicted of each fold, by fits to its rest."""
        y = self.torque(a)
        values, F = self.fit(y, folds.train), range(folds.count)
        at = [folds.test == f for f in F]
        errors = [self.as_given(a, (y - self.W @ values[f])[at[f]]) for f in F]
        squares = np.stack([np.sum(e**2, 0) for e in errors])
        rows = np.array([x.sum() for x in at])[:, None] / times
        return Score.of_errors(squares, self.tau.var(0) * len(y), folds.ratio, rows)


def _solve(G: Array, g: Array, nonnegative: np.ndarray) -> Array:
    """Return solutions (F, p) of normal equations, without columns that would be negative."""
    size = np.sqrt(np.maximum(np.einsum("fpp->fp", G), 1e-300))
    G, g = G / (size[:, :, None] * size[:, None, :]), g / size
    kept = np.ones(g.shape)
    while True:
        A = G * kept[:, :, None] * kept[:, None, :]
        A = A + (1.0 - kept + RIDGE)[:, :, None] * np.eye(g.shape[1])
        x = np.linalg.solve(A, (g * kept)[:, :, None])[:, :, 0]
        wrong = (x < 0) & nonnegative
        if not wrong.any():
            return np.asarray(x / size)
        kept = np.where(wrong, 0.0, kept)


def _judge(plain: Alternative, given: _Rows, a: Alternative, rows: _Rows) -> Evidence | None:
    """Return the evidence of an alternative over what is given; None where logs are too short."""
    memories = [autocorrelation_time(r.residual(x)) for x, r in ((plain, given), (a, rows))]
    times = np.maximum(*memories)
    try:
        folds = Folds.over(given.log, np.ones(len(given.log), int), float(times.max()))
    except LogError:
        return None
    return Evidence.of(rows.score(a, folds, times), given.score(plain, folds, times), joints=False)
