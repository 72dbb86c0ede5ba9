"""`choose_reading`: the reading of the logs that the fitted rows prefer to the literal one.

1. Every candidate is fitted to all rows. Those that lower the error enough stay.
2. The best few get the delay, unit or direction of gravity that fits best.
3. The evidence of adjusted rows, and the file's masses with a few nats, choose among these.
4. Rows that did not choose its numbers verify it (`verification`). A reading that they do not
   confirm is a question, and is not used.

Held-out logs choose nothing. One unit shared by all columns is no reading: a linear model cannot
tell it from other masses.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from identifiability.effects import FAMILIES
from identifiability.effects.measurement import EncoderBias, TorqueOffset
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.errors import ClosureError
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.logs.commands import of_commands
from identifiability.logs.prepare.dataset import Dataset, move_samples
from identifiability.logs.signals import sampling_step
from identifiability.physical.cad_prior import combine_with_file
from identifiability.physical.rules import RULES as PHYSICAL_RULES
from identifiability.quality import MeasuredLogs
from identifiability.regression.columns import list_candidates

from .candidates import CORRECT_ZERO, MOST, ReadingCandidates, list_columns
from .fit import TorqueRows, excerpt_size
from .gravity import FirstZero, find_directions, tune_direction
from .offsets import LogOffsets
from .reading import Reading
from .rules import RULES
from .sensor_side import find_link_side
from .verification import Verification

#: Readings that are judged by the evidence of adjusted rows.
JUDGED = 3
#: Factors between two units or delays that are tried, of several numbers and of one.
BETWEEN = np.geomspace(1 / 3, 3.0, 101)
COARSE = BETWEEN[::5]
#: Factors between two of the coarse ones.
NEAR = BETWEEN[46:55]
#: Sum of the log residuals within which two readings are equally good.
EVEN: Tolerance = 0.02
#: Share of the largest log odds from which two readings explain nearly the same.
ALIKE: Tolerance = 0.8
#: Sum of the logs of the residual where loops do not close.
OPEN = 1000


def choose_reading(logs: MeasuredLogs) -> Reading | None:
    """Return the reading that the fitted rows prefer; None for the literal one.

    `Reading.holds` says whether it is used or only a question. Logs of commands are read literally,
    and so are robots on feet that lift: unknown contact forces mix the rows of joints. The sensor
    of a floating base measures gravity, so that its direction is no question.

    Parameters
    ----------
    logs : MeasuredLogs
        The fitted logs, literally read.
    """
    base = logs.robot.base
    walks = base is not None and any(contact.flag for contact in base.contacts)
    if walks or any(map(of_commands, logs.recordings)):
        return None
    search = ReadingSearch(logs)
    if not search.is_informative:
        return None
    return search.choose() or find_link_side(search.rows, search.literal)


def contradicts(logs: MeasuredLogs, reading: Reading) -> bool:
    """Return whether logs speak against a reading that others of their samples chose.

    Places of torque sensors are judged by functions of the joints alone, and are not checked.
    """
    if reading.link_side.any():
        return False
    return ReadingSearch(logs).weigh(reading) < -RULES.unseen_gain


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
        stands = logs.robot.base is None
        self.rows = TorqueRows.of(logs.structure, logs.samples, columns, turns_gravity=stands)
        named = np.array(list_columns(logs)) != ""
        measured = tuple(np.flatnonzero(named & (self.rows.counts > 0)).tolist())
        self.candidates = ReadingCandidates(logs, self.literal, self.rows.turns_gravity, measured)
        self.tried = 0
        #: Rows of other motions: each regressor is evaluated once.
        self._other_rows: dict[bytes, TorqueRows] = {}

    @property
    def is_informative(self) -> bool:
        """Return whether there are rows enough, and torque that varies in each joint."""
        columns = len(self.structure.base.kept)
        enough = self.rows.counts.sum() >= 2 * columns
        varies = self.rows.variation[self.rows.counts > 0] > 0
        return bool(enough and varies.all())

    def choose(self) -> Reading | None:
        """Return the reading that is used, else the likeliest one as a question, else None.

        One log may have another clock than the others, whose delay the used reading gets as well.
        """
        found = self._choose_of_all()
        held = found if found is not None and found.holds else self.literal
        return self._find_late_log(held) or found

    def _find_late_log(self, held: Reading) -> Reading | None:
        """Return a reading in which the torque of one log is also late or early, if one surely is.

        `held` is the reading of all logs.
        """
        logs = self.logs.samples
        if len(logs) < 2 or not (held.turned or held is self.literal):
            return None
        step = sampling_step(self.rows.excerpt.pieces[0].motion.t)
        plain = replace(held, turned=False)
        self.rows.fit(plain, adjusted=True)  # rows of each log share its smooth functions
        found = []
        for sample in logs:
            subject = f"The torque of {sample.name}"
            first = replace(self.candidates.in_log(subject), gravity=held.gravity, late=sample.name)
            for sign in (-1.0, 1.0):
                self.tried += 1
                near = replace(first, delay=sign * step * first.delay)
                if self.weigh(near, plain) > 0.0:
                    tuned = self.refine(near)
                    odds = self.weigh(tuned, plain)
                    found.append(replace(tuned, log_odds=odds))
        best = max(found, key=lambda reading: reading.log_odds, default=None)
        if best is None or best.log_odds < RULES.log_odds:
            return None
        if self.weigh(replace(best, late=""), plain) > best.log_odds:  # all logs are late
            return None
        # Of the residual of each joint, as the evidence is: one joint's may be much larger.
        less = np.exp(-best.log_odds / self.rows_of(best).count(best).sum())
        best = replace(best, verification=self.verify(best, plain), turned=held.turned)
        if held.turned:
            both = f"{held.description}, and {best.description.replace('The', 'the', 1)}"
            best = replace(best, description=both, remedy=f"{held.remedy}. {best.remedy}")
        ratio = held.error_ratio * float(less)
        best = replace(best, error_ratio=ratio, log_odds=held.log_odds + best.log_odds)
        return best if best.holds else None

    def _choose_of_all(self) -> Reading | None:
        judged = self.judge([*self.refine_screened()])
        verified = (self._with_evidence(reading) for reading in judged)
        readings = list[Reading]()
        for reading in verified:
            if reading.holds and reading.turned and self.has_wrong_zero(reading):
                continue
            readings.append(reading)
            if reading.holds:
                return self.complete(reading)
        return readings[0] if readings else None

    def _with_evidence(self, reading: Reading) -> Reading:
        """Return a reading with its result on other rows, and a load that offsets compete with."""
        load = self.offsets.load if reading.separate_offsets else None
        return replace(reading, verification=self.verify(reading), load=load)

    def has_wrong_zero(self, reading: Reading) -> bool:
        """Return whether one encoder's zero fits better than another direction of gravity.

        Then the mixed model finds that zero. It does so to first order.
        """
        motions = [piece.motion for piece in self.rows.excerpt.pieces]
        inputs = self.robot, [FAMILIES[EncoderBias.name]], self.structure.present, motions
        zeros, _ = list_candidates(*inputs, fixed=False)
        entries = self.rows.excerpt.entries(zeros)
        turned = self.rows.fit(reading)
        independent = self.rows.count(reading)
        for column in {column for _, column in entries}:
            at = {joint: torque for (joint, k), torque in entries.items() if k == column}
            less = turned - self.rows.with_column(at).fit(self.literal)
            if independent @ less >= RULES.unseen_gain:
                return True
        return False

    def rows_of(self, reading: Reading) -> TorqueRows:
        """Return the rows of a reading's motion and offsets.

        Raises
        ------
        ClosureError
            If loops do not close along its motion.
        """
        if reading.late:
            names = [sample.name for sample in self.logs.samples]
            return self.rows.of_late_log(names.index(reading.late))
        if not (reading.separate_offsets or reading.moves_joints or reading.carries):
            return self.rows
        key = bytes([reading.separate_offsets, reading.carries]) + reading.motion.tobytes()
        if key not in self._other_rows:
            self._other_rows[key] = self._make_rows(reading)
        return self._other_rows[key]

    def _make_rows(self, reading: Reading) -> TorqueRows:
        if reading.carries:
            return self.rows.with_payload()
        if not reading.separate_offsets:
            return move_rows(self.logs, self.logs.samples, reading.motion)
        excerpt = self.rows.excerpt
        return TorqueRows(self.structure, excerpt, excerpt.X[..., None], separate_offsets=True)

    def compare_rows(self, reading: Reading) -> tuple[TorqueRows, TorqueRows]:
        """Return the rows of the literal motion and of a reading's.

        The smooth functions of both motions are projected out of both. Else the reading would gain
        because its functions explain other effects that the model lacks.
        """
        rows = self.rows_of(reading)
        return self.rows.beside(rows), rows.beside(self.rows)

    # Step 1: which readings lower the error.

    def screen(self) -> list[Reading]:
        """Return the readings that lower the error most, each with its ratio of errors."""
        literal = self.rows.fit(self.literal)
        squares = np.exp(2 * literal)
        gains = list[tuple[int, Reading]]()
        for reading in self.propose():
            self.tried += 1
            rows = self.rows_of(reading)
            limit = RULES.error_ratio**2 * squares.sum()
            if self._cannot_gain(reading, squares) or rows.least_shares(reading).sum() > limit:
                continue
            misfit = rows.fit(reading)
            if self.robot.base is not None and self._errs_much(misfit):
                continue  # a fault of positions, which are not tried on a floating base
            ratio = float(np.sqrt(np.exp(2 * misfit).sum() / squares.sum()))
            gain = round(float((literal - misfit).sum()) / EVEN)
            if gain > 0 and ratio <= RULES.error_ratio:
                gains.append((gain, replace(reading, error_ratio=ratio)))
        # The first of equally good readings comes first.
        gains.sort(key=lambda pair: -pair[0])
        # Another unit or delay of the same column is no other reading: step 2 finds its number.
        best = dict[tuple[str, str], Reading]()
        for _, reading in gains:
            best.setdefault((reading.description, reading.remedy), reading)
        return list(best.values())[:JUDGED]

    def _cannot_gain(self, reading: Reading, squares: Array) -> bool:
        """Return whether a robot has many joints, and those that change have too small a residual.

        Singles and pairs of many joints are too many fits.
        """
        changed = reading.changes_torque
        if len(changed) <= MOST or not changed.any():
            return False
        most = (1 - RULES.error_ratio**2) * squares.sum()
        return bool(squares[changed].sum() < most)

    def _errs_much(self, misfit: Array) -> bool:
        """Return whether the error of a joint is so large that its positions may be wrong."""
        return float(np.exp(misfit).max()) > ESTIMATION_RULES.grades[1]

    def propose(self) -> Iterator[Reading]:
        """Yield all readings that are tried."""
        longest = self.rows.longest_delay
        readings = self.candidates.of_torque()
        for reading in readings:
            if np.abs(reading.delay).max(initial=0.0) <= longest:
                yield reading
        yield from self.propose_signs()
        if self.rows.turns_gravity:
            yield from self.propose_gravity()
        yield from self.propose_positions()

    def propose_signs(self) -> Iterator[Reading]:
        """Yield other signs of several torques, changed one by one as long as the error falls."""
        shares = np.exp(2 * self.rows.fit(self.literal))
        # No signs lower the error below this.
        least = self.rows.least_shares(self.literal)
        if least.sum() > RULES.error_ratio**2 * shares.sum():
            return

        def misfit(reading: Reading) -> float:
            return float(self.rows.fit(reading).sum())

        reading = self.literal
        error = misfit(reading)
        for _ in self.candidates.measured:
            best = min(self.candidates.sign_reversed(reading), key=misfit, default=reading)
            lower = misfit(best)
            if lower > error - EVEN:
                break
            reading, error = best, lower
        if (reading.factor < 0).sum() > 1:
            yield reading

    def propose_gravity(self) -> Iterator[Reading]:
        """Yield the direction of gravity that fits best, and its opposite."""

        def misfits(gravity: Array) -> Array:
            return self.rows.fit(replace(self.literal, gravity=gravity))

        most = RULES.error_ratio * float(np.linalg.norm(np.exp(misfits(self.robot.gravity))))
        if self.rows.least_shares(self.literal, any_gravity=True).sum() > most**2:
            return
        for gravity in find_directions(self.robot.gravity, misfits, EVEN, most):
            reading = self.candidates.turned(self.rows.acting_gravity(gravity))
            if reading.description:
                yield reading

    def propose_positions(self) -> Iterator[Reading]:
        """Yield readings of positions, where the literal error is large enough."""
        if self.robot.base is not None or not self._errs_much(self.rows.fit(self.literal)):
            return
        samples = thin_samples(self.logs)

        def misfit(reading: Reading) -> float:
            try:
                rows = move_rows(self.logs, samples, reading.motion)
            except ClosureError:
                return OPEN
            # The same motion is read with and without its torque.
            return float(rows.fit(reading).sum())

        screened = [(misfit(reading), reading) for reading in self.candidates.of_positions()]
        screened.sort(key=lambda pair: pair[0])
        yield from (reading for size, reading in screened[:JUDGED] if size < OPEN)

    # Step 2: the numbers of a reading.

    def refine_screened(self) -> Iterator[Reading]:
        """Yield the screened readings with their numbers, where these have a best value.

        The error of a wrong model may fall with the factor of one joint, without end.
        """
        for reading in self.screen():
            tuned = self.refine(reading)
            step = (tuned.factor / reading.factor)[tuned.rescaled]
            if step.size != 1 or BETWEEN[1] < step.item() < BETWEEN[-2]:
                yield tuned

    def refine(self, reading: Reading) -> Reading:
        """Return a reading with the delay, unit or direction that fits best, described."""
        if 1 < (reading.factor < 0).sum() < len(self.candidates.measured):
            return self.confirm_signs(reading)
        tuned = tune_numbers(self.rows_of_numbers(reading), reading)
        return self.describe_direction(tuned) if reading.turned else describe_numbers(tuned)

    def rows_of_numbers(self, reading: Reading) -> TorqueRows:
        """Return the rows that choose the numbers of a reading.

        Torque offsets that the model lacks would turn gravity, so these rows contain none.
        """
        rows = self.rows_of(reading)
        if not reading.turned or TorqueOffset.name in self.structure.model.names:
            return rows
        return TorqueRows(self.structure, rows.excerpt, rows.parts, separate_offsets=True)

    def confirm_signs(self, reading: Reading) -> Reading:
        """Return a reading without the changes of sign that adjusted rows do not confirm."""
        needed = RULES.unseen_gain + float(np.log(len(self.candidates.measured)))
        for joint in np.flatnonzero(reading.factor < 0).tolist():
            at = self.candidates.is_joint(joint)
            fewer = self.candidates.with_signs(np.where(at, 1.0, reading.factor))
            if (fewer.factor < 0).any() and self.weigh(reading, fewer) < needed:
                reading = fewer
        return reading

    def describe_direction(self, reading: Reading) -> Reading:
        """Return a reading whose description states the direction of gravity.

        An encoder zero of the first joint may explain it as well, with one number less. Then it
        states both.
        """
        description = self.candidates.turned(reading.gravity).description

        def misfits(gravity: Array) -> Array:
            return self.rows.fit(replace(reading, gravity=gravity))

        zero = FirstZero.near(self.robot, reading.gravity, misfits)
        if zero is not None:
            turned = replace(reading, gravity=zero.gravity, fitted_numbers=1)
            if self.weigh(turned) >= self.weigh(reading):
                return replace(
                    turned, description=f"{description}, or {zero.text}", remedy=CORRECT_ZERO
                )
        return replace(reading, description=description)

    def complete(self, reading: Reading) -> Reading:
        """Return a reading with the data that `Reading.read` needs: offsets, or the added robot."""
        if reading.separate_offsets:
            return self._with_offsets(reading)
        if not reading.compensated.any():
            return reading
        return replace(reading, parameters=self._fit_robot(reading))

    @cached_property
    def offsets(self) -> LogOffsets:
        """Torque offsets by log, as the mixed model finds them."""
        return LogOffsets.find(self.logs)

    def _with_offsets(self, reading: Reading) -> Reading:
        """Return a reading with the offsets of each log, and describe the largest difference."""
        offsets = self.offsets.values
        sd = offsets.std(0, ddof=1)
        # Torque of a floating base does not vary.
        variation = np.where(self.rows.variation > 0, self.rows.variation, np.inf)
        j = int(np.argmax(sd**2 / variation))
        most = f"±{sd[j]:.2g} {self.robot.torque_units[j]} in {self.robot.joints[j]}"
        names = (s.name for s in self.logs.samples)
        return replace(
            reading,
            description=f"{reading.description} by {most}",
            offsets=dict(zip(names, offsets, strict=True)),
        )

    def _fit_robot(self, reading: Reading) -> Array:
        """Return the fitted standard parameters (p,); the file's where rows give no information."""
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

    # Step 3: the evidence.

    def judge(self, readings: Sequence[Reading]) -> list[Reading]:
        """Return the readings that the evidence of adjusted rows prefers, the likeliest first.

        `verify` counts how many readings were tried.
        """
        judged = [replace(reading, log_odds=self.weigh(reading)) for reading in readings]
        needed = RULES.unseen_gain
        likely = [
            r
            for r in judged
            if r.log_odds + self.vote(r) >= needed and self.gain_of_payload(r) >= needed
        ]
        if not likely:
            return []
        # Of readings that explain nearly the same, the one with fewest numbers comes first.
        alike = ALIKE * max(reading.log_odds for reading in likely)

        def rank(reading: Reading) -> tuple[bool, int, float]:
            # A payload was judged against the same reading without it.
            counts = reading.log_odds >= alike and not reading.carries
            numbers = reading.fitted_numbers if counts else 0
            return reading.log_odds < alike, numbers, -reading.log_odds - self.vote(reading)

        return sorted(likely, key=rank)

    def gain_of_payload(self, reading: Reading) -> float:
        """Return the log odds of a payload's weight [nat]; infinite where the reading has none."""
        without = replace(reading, carries=False)
        return self.weigh(reading, without) if reading.carries else float(np.inf)

    def weigh(self, reading: Reading, other: Reading | None = None) -> float:
        """Return the log odds of a reading against another one, by default the literal [nat]."""
        if reading.separate_offsets:
            return self.offsets.odds
        plain, rows = self.compare_rows(reading)
        less = plain.fit(other or self.literal, adjusted=True) - rows.fit(reading, adjusted=True)
        price = 0.5 * float(np.log(plain.counts.sum()))
        return float(rows.count(reading) @ less) - price * reading.fitted_numbers

    def vote(self, reading: Reading) -> float:
        """Return the nats of the file's masses for a reading, against the literal one."""
        if not self.logs.weighs:
            return 0.0
        less = float((self.surprises(self.literal) - self.surprises(reading)).sum())
        return float(np.clip(less, -RULES.file_vote, RULES.file_vote))

    def surprises(self, reading: Reading) -> Array:
        """Return the nats of the file's masses against the torque of each joint, (n,)."""
        sizes = self.rows_of(reading).sizes_beside_file(reading)
        # Files are wrong by a factor of three at times.
        deviations = np.log(np.maximum(sizes, NEARLY)) / np.log(BETWEEN[-1])
        return np.minimum(0.5 * deviations**2, RULES.file_vote)

    # Step 4: other rows.

    def verify(self, reading: Reading, other: Reading | None = None) -> Verification:
        """Return how numbers chosen by each half of the rows fit the other half.

        They are compared with another reading, by default the literal one.
        """
        if reading.separate_offsets:
            # The mixed model has no numbers that a part would choose.
            odds = self.offsets.odds
            return Verification(odds, odds, odds, self.tried, against=-self.vote(reading))
        plain, moved = self.compare_rows(reading)
        independent = moved.count(reading) / np.maximum(moved.counts, 1)
        parts = list(zip(plain.halves(), moved.halves(), strict=True))
        tuned = [tune_numbers(rows, reading) for _, rows in parts]

        def gain(part: int, numbers: Reading) -> float:
            literal, rows = parts[part]
            less = literal.fit(other or self.literal, adjusted=True) - rows.fit(
                numbers, adjusted=True
            )
            return float((independent * literal.counts) @ less)

        unseen = gain(0, tuned[1]), gain(1, tuned[0])
        seen = gain(0, tuned[0]) + gain(1, tuned[1])
        # A number gains half a nat on the rows that chose it, and loses as much on others.
        numbers = float(reading.fitted_numbers)
        predicted = seen - 2.0 * numbers
        return Verification(
            sum(unseen), min(unseen), predicted, self.tried, against=-self.vote(reading)
        )


def tune_numbers(rows: TorqueRows, reading: Reading) -> Reading:
    """Return a reading with the delay, unit and direction of gravity that fit some rows best."""

    def misfit(other: Reading) -> float:
        return float(rows.fit(other).sum())

    if reading.delay.any():
        step = sampling_step(rows.excerpt.pieces[0].motion.t)
        # A shift by whole samples smooths no noise.
        for factors in (COARSE, NEAR):
            delay = float(np.abs(reading.delay).max())
            sought = np.minimum(factors * delay, rows.longest_delay)
            shifts = {round(x / step) for x in sought.tolist()}
            delays = [np.sign(reading.delay) * step * shift for shift in sorted(shifts)]
            reading = min((replace(reading, delay=delay) for delay in delays), key=misfit)
        sample = np.sign(reading.delay) * step
        steps = (-1, 0, 1)
        near = [misfit(replace(reading, delay=reading.delay + k * sample)) for k in steps]
        reading = replace(reading, delay=reading.delay + find_vertex(near) * sample)
    for joint in np.flatnonzero(reading.rescaled).tolist():
        at = np.arange(len(reading.factor)) == joint
        # One column has another unit; the gears of several need a finer search.
        factors = COARSE if reading.rescaled.sum() == 1 else BETWEEN
        tried = [np.where(at, x * reading.factor, reading.factor) for x in factors]
        reading = min((replace(reading, factor=factor) for factor in tried), key=misfit)
    if reading.turned:
        turned = tune_direction(reading.gravity, lambda g: rows.fit(replace(reading, gravity=g)))
        reading = replace(reading, gravity=rows.acting_gravity(turned))
    return reading


def find_vertex(values: Sequence[float]) -> float:
    """Return where a parabola through values at −1, 0 and 1 is least; zero if nowhere."""
    before, here, after = values
    bend = before - 2.0 * here + after
    return float(np.clip((before - after) / (2.0 * bend), -0.5, 0.5)) if bend > 0.0 else 0.0


def thin_samples(logs: MeasuredLogs) -> tuple[Dataset, ...]:
    """Return every k-th sample of each log, in total as many rows as an excerpt."""
    most = excerpt_size(logs.structure)[0]
    count = len(logs.samples)
    steps = [max(1, len(s.tau) * count // most) for s in logs.samples]
    if max(steps) == 1 and all(s.decimation is None for s in logs.samples):
        return logs.samples
    return tuple(s.thin(step) for s, step in zip(logs.samples, steps, strict=True))


def move_rows(logs: MeasuredLogs, samples: Sequence[Dataset], motion: Array) -> TorqueRows:
    """Return the rows of samples along another motion, (n, n) as `Reading.motion`.

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
