"""`choose_reading`: the reading of the logs that the fitted rows prefer to the literal one.

1. Every candidate is fitted to all rows. Those that lower the error enough stay.
2. The best few get the delay, unit, offsets or robot that fits best.
3. The evidence of adjusted rows chooses among these: missing effects must not vote, and only
   independent rows count.

Held-out logs and the file's masses choose nothing. One unit shared by all columns is no reading: a
linear model cannot tell it from other masses.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy

from identifiability.estimation.groups import Missing, with_reversals
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.logs.commands import of_commands
from identifiability.logs.prepare.dataset import Dataset, move_samples
from identifiability.logs.signals import sampling_step
from identifiability.physical.cad_prior import combine_with_file
from identifiability.physical.rules import RULES as PHYSICAL_RULES
from identifiability.quality import MeasuredLogs

from .candidates import MOST, ReadingCandidates
from .fit import TorqueRows, excerpt_size
from .gravity import find_gravity
from .reading import Reading
from .rules import RULES

#: Readings that are judged by the evidence of adjusted rows.
JUDGED = 3
#: Factors between two units or delays that are tried, of several numbers and of one.
BETWEEN = np.geomspace(1 / 3, 3.0, 101)
COARSE = BETWEEN[::5]
#: Sum of the logs of the residual by which one reading is as good as another.
EVEN: Tolerance = 0.02
#: Sum of the logs of the residual where loops do not close.
OPEN = 1000
#: How a zero is searched for.
ZERO_SEARCH = {"xatol": 1e-3, "maxiter": 14}


def choose_reading(logs: MeasuredLogs) -> Reading | None:
    """Return the reading that the fitted rows surely prefer; None for the literal one.

    Robots with a floating base and logs of commands are read literally.

    Parameters
    ----------
    logs : MeasuredLogs
        The fitted logs, literally read.
    """
    if logs.robot.base is not None or any(map(of_commands, logs.recordings)):
        return None
    search = ReadingSearch(logs)
    if not search.is_informative:
        return None
    return search.judge([search.refine(reading) for reading in search.screen()])


class ReadingSearch:
    """The search for the reading of some logs.

    Parameters
    ----------
    logs : MeasuredLogs
    """

    def __init__(self, logs: MeasuredLogs) -> None:
        self.logs = logs
        self.robot = logs.robot
        self.structure = logs.structure
        self.literal = Reading.literal(logs.robot)
        #: Rows along the literal motion.
        columns = logs.regression
        self.rows = TorqueRows.of(logs.structure, logs.samples, columns, turns_gravity=True)
        self.candidates = ReadingCandidates(logs, self.literal, self.rows.turns_gravity)
        #: Rows of other motions, and of separate offsets: each regressor is evaluated once.
        self._other_rows: dict[bytes, TorqueRows] = {}

    @cached_property
    def screened(self) -> PositionScreen:
        """Fits to few samples, by which positions are screened."""
        return PositionScreen(self.logs)

    @property
    def is_informative(self) -> bool:
        """Whether there are rows enough, and torque that varies in each joint."""
        columns = len(self.structure.base.kept)
        enough = self.rows.counts.sum() >= 2 * columns
        return bool(enough and (self.rows.variation > 0).all())

    def rows_of(self, reading: Reading) -> TorqueRows:
        """Return the rows of a reading's motion and offsets.

        Raises
        ------
        ClosureError
            If loops do not close along its motion.
        """
        if not (reading.separate_offsets or reading.moves_joints):
            return self.rows
        key = b"" if reading.separate_offsets else reading.motion.tobytes()
        if key not in self._other_rows:
            self._other_rows[key] = self._make_rows(reading)
        return self._other_rows[key]

    def _make_rows(self, reading: Reading) -> TorqueRows:
        if reading.separate_offsets:
            excerpt = self.rows.excerpt
            parts = excerpt.X[..., None]
            return TorqueRows(self.structure, excerpt, parts, separate_offsets=True)
        screened = self.screened.find_rows(reading.motion) if self.screened.is_whole else None
        return screened or move_rows(self.logs, self.logs.samples, reading.motion)

    def fit(self, reading: Reading, *, adjusted: bool = False) -> Array:
        """Return half the log of the residual share of each log column under a reading, (n,)."""
        return self.rows_of(reading).fit(reading, adjusted=adjusted)

    def misfit(self, reading: Reading) -> float:
        """Return the sum of these logs; `OPEN` where loops do not close."""
        try:
            return float(self.fit(reading).sum())
        except ClosureError:
            return OPEN

    # Step 1: which readings lower the error.

    def screen(self) -> list[Reading]:
        """Return the readings that lower the error most, each with its ratio of errors."""
        literal = self.fit(self.literal)
        squares = np.exp(2 * literal)
        gains = list[tuple[int, Reading]]()
        for reading in self.propose():
            if self._cannot_gain(reading, squares):
                continue
            misfit = self.fit(reading)
            ratio = float(np.sqrt(np.exp(2 * misfit).sum() / squares.sum()))
            gain = round(float((literal - misfit).sum()) / EVEN)
            if gain > 0 and ratio <= RULES.error_ratio:
                gains.append((gain, replace(reading, error_ratio=ratio)))
        # The first of equally good readings comes first.
        gains.sort(key=lambda pair: -pair[0])
        return [reading for _, reading in gains[:JUDGED]]

    def _cannot_gain(self, reading: Reading, squares: Array) -> bool:
        """Whether a robot has many joints, and those that change have too small a residual.

        Singles and pairs of many joints are too many fits.
        """
        changed = reading.changes_torque
        if len(changed) <= MOST or not changed.any():
            return False
        most = (1 - RULES.error_ratio**2) * squares.sum()
        return bool(squares[changed].sum() < most)

    def propose(self) -> Iterator[Reading]:
        """Yield all readings that are tried."""
        yield from self.candidates.of_torque()
        if self.rows.turns_gravity:
            yield from self.propose_gravity()
        yield from self.propose_positions()

    def propose_gravity(self) -> Iterator[Reading]:
        """Yield the direction of gravity that fits best, if the file states another one."""

        def misfits(gravity: Array) -> Array:
            return self.fit(replace(self.literal, gravity=gravity))

        reading = self.candidates.turned(find_gravity(self.robot.gravity, misfits, EVEN))
        if reading.description:
            yield reading

    def propose_positions(self) -> Iterator[Reading]:
        """Yield zeros, and readings of positions, where the literal error is large enough."""
        worst = float(np.exp(self.fit(self.literal)).max())
        # Loops are closed anew for each motion, which takes long.
        grades = ESTIMATION_RULES.grades
        closed = self.robot.closed
        # All samples would be moved in memory.
        long = any(s.long for s in self.logs.samples)
        if long or worst <= grades[closed]:
            return
        yield from self.propose_zeros()
        if worst > grades[1] and not closed:
            self.screened.restart()
            yield from sorted(self.candidates.of_positions(), key=self.screened.misfit)[:JUDGED]

    def propose_zeros(self) -> Iterator[Reading]:
        """Yield the encoder zeros that fit best, at the two joints where most is gained."""
        screened = self.screened
        literal = self.misfit(self.literal) if screened.is_whole else screened.misfit(self.literal)
        joints = range(len(self.candidates.names))
        tried = [
            (screened.misfit(self._zeroed(joint, share)), joint, share)
            for joint in joints
            for share in (-0.2, 0.2)  # of its range
        ]
        for misfit, joint, share in sorted(tried)[:2]:
            # A zero about a vertical axis moves nothing.
            if abs(misfit - literal) <= 1e-9:
                continue
            reading = self._find_zero(joint, 4 * share)
            if self.misfit(reading) < OPEN:
                yield reading

    def _zeroed(self, joint: int, share: float) -> Reading:
        """Return the reading with a joint's zero at a share of its range."""
        return self.candidates.zeroed(joint, share * self.screened.range[joint])

    def _find_zero(self, joint: int, end: float) -> Reading:
        """Return the reading with a joint's best zero, between none and an end [share]."""
        self.screened.restart()

        def misfit(share: float) -> float:
            return self.screened.misfit(self._zeroed(joint, share))

        bounds = sorted((0.0, end))
        found = scipy.optimize.minimize_scalar(
            misfit, bounds=bounds, method="bounded", options=ZERO_SEARCH
        )
        return self._zeroed(joint, found.x)

    # Step 2: the numbers of a reading.

    def refine(self, reading: Reading) -> Reading:
        """Return a reading with the delay, unit, offsets or robot that fits best."""
        if reading.compensated.any():
            return replace(reading, parameters=self._fit_robot(reading))
        if reading.separate_offsets:
            return self._fit_offsets(reading)
        return describe_numbers(self._refine_units(self._refine_delay(reading)))

    def _refine_delay(self, reading: Reading) -> Reading:
        """Return a reading with the delay that fits best, in samples of the log."""
        if not reading.delay.any():
            return reading
        step = sampling_step(self.rows.excerpt.pieces[0].motion.t)
        delays = [np.round(x * reading.delay / step) * step for x in COARSE]
        return min((replace(reading, delay=delay) for delay in delays), key=self.misfit)

    def _refine_units(self, reading: Reading) -> Reading:
        """Return a reading with the unit of each rescaled column that fits best."""
        joints = np.flatnonzero(reading.rescaled)
        for joint in joints.tolist():
            at = self.candidates.is_joint(joint)
            # One column has another unit; the gears of several need a finer search.
            factors = COARSE if reading.rescaled.sum() == 1 else BETWEEN
            tried = [np.where(at, x * reading.factor, reading.factor) for x in factors]
            readings = (replace(reading, factor=factor) for factor in tried)
            reading = min(readings, key=self.misfit)
        return reading

    def _fit_robot(self, reading: Reading) -> Array:
        """Return the standard parameters (p,) that fit; the file's where the rows tell nothing."""
        rows = self.rows
        value, share = rows.solve(reading, adjusted=False)
        variance = share * rows.variation * rows.counts / rows.count(reading)
        whitened = []
        for j, weight in enumerate(rows.weights(reading)):
            columns = np.zeros((len(rows.excerpt.y), len(value)))
            columns[:, rows.acts[j]] = rows.columns(j, adjusted=False) @ weight
            whitened.append(columns / np.sqrt(variance[j]))
        R = np.linalg.qr(np.concatenate(whitened), mode="r")
        parameters = np.eye(len(self.structure.columns))
        root = R @ self.structure.G
        share_of_body = PHYSICAL_RULES.body_within
        both = combine_with_file(self.structure, root, R @ value, parameters, share_of_body)
        return np.asarray(both.mean)

    def _fit_offsets(self, reading: Reading) -> Reading:
        """Return a reading with the offsets of each log, and say where they differ most."""
        offsets = self._offsets_by_log()
        offsets = offsets - offsets.mean(0)
        sd = offsets.std(0, ddof=1)
        j = int(np.argmax(sd**2 / self.rows.variation))
        most = f"±{sd[j]:.2g} {self.robot.torque_units[j]} in {self.robot.joints[j]}"
        names = (s.name for s in self.logs.samples)
        return replace(
            reading,
            description=f"{reading.description} by {most}",
            offsets=dict(zip(names, offsets, strict=True)),
        )

    def _offsets_by_log(self) -> Array:
        """Return the torque offset of each joint in each log, (L, n) [N·m or N].

        Rows are whitened: noise of derivatives says little of levels.
        """
        excerpt = self.rows.excerpt
        constant = self.rows.constant
        joints, samples, logs = constant.shape
        columns = excerpt.X.shape[2]
        each = np.einsum("jk,jNl->Njkl", np.eye(joints), constant)
        X = np.append(excerpt.X, each.reshape(samples, joints, -1), 2)
        reversals = with_reversals(self.robot, (), self.structure.present)
        value = Missing(reversals, replace(excerpt, X=X)).values()
        return np.asarray(value[columns:].reshape(joints, logs).T)

    # Step 3: the evidence.

    def judge(self, readings: Sequence[Reading]) -> Reading | None:
        """Return the reading with the best evidence; None if it is too weak.

        Parameters
        ----------
        readings : sequence of Reading
            The one that lowers the error most first.
        """
        if not readings:
            return None
        rows = self.rows_of(readings[0]).count(readings[0])
        literal = self.fit(self.literal, adjusted=True)
        price = 0.5 * float(np.log(self.rows.counts.sum()))

        def log_odds(reading: Reading) -> float:
            gain = float(rows @ (literal - self.fit(reading, adjusted=True)))
            return gain - price * reading.fitted_numbers

        odds = [log_odds(reading) for reading in readings]
        # The first of those within one nat is taken.
        best = int(np.argmax(np.array(odds) > max(odds) - 1.0))
        if odds[best] < RULES.log_odds:
            return None
        return replace(readings[best], log_odds=odds[best])


class PositionScreen:
    """Fits to few samples of the logs, which are moved as a reading says.

    Parameters
    ----------
    logs : MeasuredLogs
    """

    def __init__(self, logs: MeasuredLogs) -> None:
        self.logs = logs
        #: Samples without decimation, as many as an excerpt has rows.
        self.samples = thin_samples(logs)
        #: Whether these are all samples of the logs, as they are fitted.
        self.is_whole = self.samples is logs.samples
        self._last: tuple[bytes, TorqueRows] | None = None
        self._best: list[tuple[float, bytes, TorqueRows]] = []

    @cached_property
    def range(self) -> Array:
        """Range of each joint's positions, (n,) [rad or m]."""
        positions = np.concatenate([s.motion.actuated_q for s in self.samples])
        return np.asarray(np.ptp(positions, axis=0))

    def restart(self) -> None:
        """Forget the rows of earlier readings."""
        self._last = None
        self._best = []

    def find_rows(self, motion: Array) -> TorqueRows | None:
        """Return the rows of a motion, of the last reading or the best ones."""
        key = motion.tobytes()
        last = [] if self._last is None else [self._last]
        kept = [*last, *((k, rows) for _, k, rows in self._best)]
        return next((rows for k, rows in kept if k == key), None)

    def misfit(self, reading: Reading) -> float:
        """Return the sum of half the logs of the residual shares; `OPEN` for open loops."""
        rows = self.find_rows(reading.motion)
        if rows is None:
            try:
                rows = move_rows(self.logs, self.samples, reading.motion)
            except ClosureError:
                return OPEN
        misfit = float(rows.fit(reading).sum())
        self._last = reading.motion.tobytes(), rows
        best = [*self._best, (misfit, *self._last)]
        self._best = sorted(best, key=lambda one: one[0])[:JUDGED]
        return misfit


def thin_samples(logs: MeasuredLogs) -> tuple[Dataset, ...]:
    """Return every so many samples of each log, in all as many as an excerpt has rows."""
    most = excerpt_size(logs.structure)[0]
    count = len(logs.samples)
    steps = [max(1, len(s.tau) * count // most) for s in logs.samples]
    if max(steps) == 1 and all(s.decimation is None for s in logs.samples):
        return logs.samples
    return tuple(s.thin(step) for s, step in zip(logs.samples, steps, strict=True))


def move_rows(logs: MeasuredLogs, samples: Sequence[Dataset], motion: Array) -> TorqueRows:
    """Return the rows of samples along another motion, (n, n + 1) as `Reading.motion`.

    Raises
    ------
    ClosureError
        If loops do not close there.
    """
    moved = tuple(move_samples(logs.robot, s, motion) for s in samples)
    return TorqueRows.of(logs.structure, moved)


def describe_numbers(reading: Reading) -> Reading:
    """Return a reading whose description states its delay, or its one unit."""
    delay = reading.delay[np.argmax(np.abs(reading.delay))]
    factors = reading.factor[reading.rescaled]
    description = reading.description
    if delay:
        side = "late" if delay > 0 else "early"
        description += f" seems to be {1e3 * abs(delay):.3g} ms {side}"
    elif factors.size == 1:
        description += f" is {1.0 / factors[0]:.2g} times as large as its model's"
    return replace(reading, description=description)
