"""`find_bending`: the joints that bend, found one by one, given all rival effects."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from identifiability.foundation.linalg import RANK_TOLERANCE, or_one
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Dataset
from identifiability.regression.structure import Structure

from .result import Bending, ElasticJoint, Response
from .rules import RULES
from .stretch import UNSTABLE, Springs, Stretch, cut_stretches, rotor_names

#: Resonances that are tried [Hz], and the damping ratio at which they are.
FREQUENCIES = np.geomspace(4.0, 40.0, 20)
RATIO: Tolerance = 0.05
#: Multiples of the frequency that was screened at which a fit starts: far from it, it may not move.
STARTS: tuple[Tolerance, ...] = (0.7, 1.0, 1.4)
#: Order of the noise of each joint, as an autoregression.
ORDER = 3
#: Steps of a fit, of a first one and of the last, and how often a step is halved.
STEPS, LAST, HALVINGS = 6, 12, 4
#: Largest changes of the logarithms of a frequency and of a damping ratio in one step.
LARGEST: tuple[Tolerance, ...] = (0.3, 1.0)


#: No joint bends.
NONE = Springs((), np.empty((1, 0)), np.empty((1, 0)))


@frozen
class Fit:
    """Numbers of springs, and of the model that is fitted with them.

    Attributes
    ----------
    springs : Springs
        One set.
    change : (b,)
        Changes of the kept columns from the values of the file.
    rivals : (r,)
        Values of the rivals' columns.
    misfit : float
        Sum of squares of the whitened residual.
    covariance : (2m, 2m)
        Of the logarithms of frequencies and damping ratios.
    """

    springs: Springs
    change: Array
    rivals: Array
    misfit: float
    covariance: Array


class Problem:
    """Torque of some logs under white noise, and the columns that explain it.

    Parameters
    ----------
    stretches : sequence of Stretch
    change : (b,)
        Changes of the kept columns along which rivals are computed.
    """

    def __init__(self, stretches: Sequence[Stretch], change: Array) -> None:
        self.stretches = stretches
        self.change = change
        self.n = len(stretches[0].robot.actuated)
        self.inertia = mean_inertia(stretches[0], change)
        self.torque = [s.kept_rows(s.piece.tau - s.stated_torque) for s in stretches]
        self.columns = [s.kept_rows(s.columns) for s in stretches]
        self.beside = [s.kept_rows(s.rivals(change)) for s in stretches]
        self.filters = self._fit_noise([np.zeros_like(y) for y in self.torque])

    def _fit_noise(self, bent: Sequence[Array]) -> list[tuple[Array, float]]:
        """Return taps and size of the noise of each joint, by the richest model."""
        pairs = zip(self.columns, self.beside, strict=True)
        everything = [np.concatenate(x, 2) for x in pairs]
        rows = np.concatenate([x.reshape(-1, x.shape[2]) for x in everything])
        torque = [y - x for y, x in zip(self.torque, bent, strict=True)]
        target = np.concatenate([y.ravel() for y in torque])
        length = or_one(np.linalg.norm(rows, axis=0))
        values = np.linalg.lstsq(rows / length, target, rcond=RANK_TOLERANCE)[0] / length
        left = [y - x @ values for y, x in zip(torque, everything, strict=True)]
        return [_fit_autoregression([x[:, j] for x in left]) for j in range(self.n)]

    def whiten(self, blocks: Sequence[Array]) -> Array:
        """Return rows (N, n, …) of every stretch as rows of white noise, (R, …).

        The last rows are zero: they are those of the prior of the rivals.
        """
        from scipy.signal import lfilter  # noqa: PLC0415 - a third of a second, for who asks

        out = []
        for joint, (taps, size) in enumerate(self.filters):
            for x in blocks:
                rows = x[:, joint]
                white = lfilter(taps, [1.0], rows, axis=0) if rows.size else rows
                out.append(white[ORDER:] / size)
        known = self.beside[0].shape[2]
        prior = np.zeros((known, *out[0].shape[1:]))
        return np.concatenate([*out, prior])

    def bent(self, springs: Springs, change: Array) -> list[Array]:
        """Return the torque that springs add, kept rows (N, n, S) of every stretch."""
        return [
            s.kept_rows(s.bent_torque(springs, self.inertia, s.values(change)))
            for s in self.stretches
        ]

    # The search for one more joint.

    def screen(self, fit: Fit, joint: int) -> tuple[float, float]:
        """Return the largest gain of one more joint [nat], and its frequency [Hz].

        Its deflection may have another size than the equation says, because the values of the
        rigid model are not yet those of a robot that bends.
        """
        tried = fit.springs.with_each(joint, FREQUENCIES, RATIO)
        y = self.whiten(self.torque)
        x = self.whiten(self.bent(tried, fit.change))
        # Distorted values may make links that are unstable.
        bounded = np.abs(x).max(0) < UNSTABLE * np.abs(y).max()
        x = np.where(bounded, x, 0.0)
        if fit.springs.joints:
            known_torque = self.whiten(self.bent(fit.springs, fit.change))
            x = x - known_torque
            y = y - known_torque[:, 0]
        basis = _orthonormal(self._linear())
        y = y - basis @ (basis.T @ y)
        x = x - basis @ (basis.T @ x)
        square = (x**2).sum(0)
        size = np.clip(y @ x / or_one(square), 0.0, RULES.amplitude)
        gain = size * (y @ x) - 0.5 * size**2 * square
        best = int(np.argmax(gain))
        return float(gain[best]), float(FREQUENCIES[best])

    def _linear(self) -> Array:
        """Return the whitened columns of model and rivals, and the prior of the rivals."""
        columns = self.whiten(self.columns)
        beside = self.whiten(self.beside)
        out = np.concatenate([columns, beside], axis=1)
        rivals = self.beside[0].shape[2]
        sizes = np.repeat(RULES.rivals, self.n)[:rivals]
        if rivals:
            out[-rivals:, -rivals:] = np.diag(1.0 / sizes)
        return out

    # The fit of given joints.

    def fit(self, springs: Springs, change: Array, steps: int = STEPS) -> Fit:
        """Return springs, model and rivals that fit best, by Gauss–Newton steps.

        Parameters
        ----------
        springs : Springs
            The first numbers; of no joint, the rigid model is fitted.
        change : (b,)
            First changes of the kept columns.
        steps : int
        """
        m = len(springs.joints)
        b = len(change)
        y = self.whiten(self.torque)
        linear = self._linear()
        rivals = np.zeros(linear.shape[1] - b)
        shapes = [springs.frequency.ravel(), springs.ratio.ravel()]
        numbers = np.log(np.concatenate(shapes))
        if not m:
            values = _solve(linear, y)
            left = y - linear @ values
            no_covariance = np.zeros((0, 0))
            return Fit(springs, values[:b], values[b:], float(left @ left), no_covariance)
        limit = np.repeat(LARGEST, m)
        left, jacobian = self._linearise(springs.joints, numbers, change, rivals, y, linear)
        if not np.abs(left).max() < UNSTABLE * np.abs(y).max():
            unknown = np.full((2 * m, 2 * m), np.nan)
            return Fit(springs, change, rivals, np.inf, unknown)
        for _ in range(steps):
            change_of = _solve(jacobian, left)
            step = change_of[: 2 * m]
            room = (limit / np.maximum(np.abs(step), 1e-12)).min()
            share = min(1.0, float(room))
            for _ in range(HALVINGS):
                moved_change = change + share * change_of[2 * m : 2 * m + b]
                moved_rivals = rivals + share * change_of[2 * m + b :]
                moved = (
                    numbers + share * step,
                    moved_change,
                    moved_rivals,
                )
                other = self._linearise(springs.joints, *moved, y, linear)
                if other[0] @ other[0] < left @ left:
                    break
                share /= 2.0
            else:
                break
            done = left @ left - other[0] @ other[0] < 0.5
            numbers, change, rivals = moved
            left, jacobian = other
            if done:
                break
        misfit = float(left @ left)
        spread = misfit / max(len(y) - jacobian.shape[1], 1)
        length = or_one(np.linalg.norm(jacobian, axis=0))
        inverse = np.linalg.pinv(jacobian / length, rcond=RANK_TOLERANCE)
        square = inverse[: 2 * m] @ inverse[: 2 * m].T
        scales = np.outer(length, length)[: 2 * m, : 2 * m]
        covariance = square / scales
        frequency = np.exp(numbers[None, :m])
        ratio = np.exp(numbers[None, m:])
        tuned = replace(springs, frequency=frequency, ratio=ratio)
        return Fit(tuned, change, rivals, misfit, covariance * spread)

    def _linearise(
        self,
        joints: tuple[int, ...],
        numbers: Array,
        change: Array,
        rivals: Array,
        y: Array,
        linear: Array,
    ) -> tuple[Array, Array]:
        """Return the whitened residual (R,), and derivatives of the model (R, 2m + b + r)."""
        m = len(joints)
        b = len(change)
        frequency = np.exp(numbers[None, :m])
        ratio = np.exp(numbers[None, m:])
        springs = Springs(joints, frequency, ratio)
        torque = []
        slopes = []
        for s in self.stretches:
            own, by = s.sensitivities(springs, self.inertia, s.values(change))
            torque.append(s.kept_rows(own))
            slopes.append(s.kept_rows(by))
        left = y - linear @ np.concatenate([change, rivals]) - self.whiten(torque)
        jacobian = np.concatenate([self.whiten(slopes), linear[:, b:]], axis=1)
        jacobian[:, 2 * m : 2 * m + b] += linear[:, :b]
        return left, jacobian

    def with_noise_of(self, fit: Fit) -> Problem:
        """Return the problem under the noise that a fit leaves, with rivals along its torque."""
        other = copy(self)
        other.change = fit.change
        other.beside = [s.kept_rows(s.rivals(fit.change)) for s in self.stretches]
        bent = [x[:, :, 0] for x in self.bent(fit.springs, fit.change)]
        other.filters = other._fit_noise(bent)
        return other

    def with_rivals(self, stop: int) -> Problem:
        """Return the problem with the first rivals of each joint's; torque scales are the last n.

        A common scale of torque, bodies and springs changes nothing, so that it hides their size.
        Without any rival, the model predicts other motion best.
        """
        other = copy(self)
        other.beside = [x[:, :, :stop] for x in self.beside]
        return other


# Trials with unstable links overflow, and are refused.
@np.errstate(over="ignore", invalid="ignore")
def find_bending(
    structure: Structure,
    fitted: Sequence[Dataset],
    held_out: Sequence[Dataset],
    band: float,
    bandwidth: float,
) -> tuple[Bending, tuple[Dataset, ...]]:
    """Return the joints of an open chain that bend, and logs without the torque of their springs.

    These logs also lack the torque of the rotors before springs, whose inertia `Bending` has.

    Joints are found one by one: the joint with the largest gain is added, all numbers are fitted
    again, and it stays if the gain exceeds the price of its numbers. Delays, low-passes,
    torque scales and encoder zeros of every joint are fitted with it, so that it gains only where
    these explain less.

    Parameters
    ----------
    structure : Structure
        The robot under a model with rigid bodies.
    fitted, held_out : sequence of Dataset
        Prepared up to the band, without noise of the motion to speak of.
    band, bandwidth : float [Hz]
        Of the torque, and of the motion.
    """
    robot = structure.robot
    stretches = cut_stretches(structure, fitted)
    n = len(robot.actuated)
    if not stretches:
        why = "no log has a stretch that is long enough"
        return Bending((), (), band, bandwidth, np.zeros(n), np.zeros(n), lost=why), ()
    problem, asked = pose_problem(stretches)
    problem, fit = add_joints(problem, asked, band)
    price = _price(problem, len(asked))
    fit = drop_weak(problem, fit, price)
    gains = {j: measure_gain(problem, fit, j) for j in fit.springs.joints}
    fit = tune(problem, fit, band)
    alone = problem.with_rivals(0)
    rigid = alone.fit(NONE, fit.change)
    bent = alone.fit(fit.springs, fit.change, LAST) if fit.springs.joints else rigid
    places = range(len(fit.springs.joints))
    responses = [measure_response(problem, bent, c, band) for c in places]
    joints = tuple(_describe(problem, fit, c, gains, responses[c]) for c in places)
    before, after = (_errors(problem.inertia, stretches, x) for x in (rigid, bent))
    unseen = cut_stretches(structure, held_out)
    values = stretches[0].values(bent.change)
    names = rotor_names(structure, bent.springs)
    rotors = {n: float(values[structure.columns.index(n)]) for n in names}
    asked_joints = tuple(robot.joints[j] for j in asked)
    found = Bending(
        joints=joints,
        asked=asked_joints,
        band=band,
        bandwidth=bandwidth,
        error_before=before,
        error_after=after,
        held_before=_errors(problem.inertia, unseen, rigid) if unseen else None,
        held_after=_errors(problem.inertia, unseen, bent) if unseen else None,
        parameters=rotors,
    )
    if not joints:
        return found, ()
    return found, tuple(s.without(bent.springs, problem.inertia, values) for s in stretches)


def pose_problem(stretches: Sequence[Stretch]) -> tuple[Problem, tuple[int, ...]]:
    """Return the problem about a rigid fit, and the joints that may bend."""
    start = np.zeros(len(stretches[0].kept))
    rigid = Problem(stretches, start).fit(NONE, start)
    problem = Problem(stretches, first_values(stretches[0], rigid.change))
    turns = np.flatnonzero(problem.inertia > 0)
    return problem, tuple(turns.tolist())


def add_joints(problem: Problem, asked: tuple[int, ...], band: float) -> tuple[Problem, Fit]:
    """Return the problem under the noise that is left, and the joints that bend."""
    rigid = problem.fit(NONE, problem.change)
    fit = replace(rigid, change=problem.change, rivals=np.zeros_like(rigid.rivals))
    price = _price(problem, len(asked))
    refused = set[int]()
    while open_ := [j for j in asked if j not in refused and j not in fit.springs.joints]:
        screened = [(*problem.screen(fit, joint), joint) for joint in open_]
        gain, frequency, joint = max(screened)
        if gain < price:
            break
        tried = [fit.springs.with_each(joint, np.array([x * frequency]), RATIO) for x in STARTS]
        fits = [problem.fit(springs, fit.change) for springs in tried]
        heard = (x for x in fits if not _silent(x.springs, band).any())
        found = min(heard, key=lambda x: x.misfit, default=fit)
        if 0.5 * (fit.misfit - found.misfit) < price:
            refused.add(joint)
            continue
        problem = problem.with_noise_of(found)
        fit = problem.fit(found.springs, found.change)
    return problem, fit


def mean_inertia(stretch: Stretch, change: Array) -> Array:
    """Return the mean inertia of the links that each joint moves, (n,)."""
    joints = range(len(stretch.robot.actuated))
    parts = stretch.derivatives(joints, stretch.values(change))
    return np.einsum("kjj->j", parts[2]) / parts.shape[1]


def first_values(stretch: Stretch, rigid: Array) -> Array:
    """Return the changes (b,) with which joints that bend are sought: of the rigid fit, or none.

    Joints that bend distort a rigid fit. If the inertia of a joint is far from that of the robot
    file, the values of the file are the better start.
    """
    stated = mean_inertia(stretch, np.zeros_like(rigid))
    ratio = mean_inertia(stretch, rigid) / or_one(stated)
    near = (ratio > 1.0 / RULES.distorted) & (ratio < RULES.distorted)
    if (stated > 0).all() and not near.all():
        return np.zeros_like(rigid)
    return rigid


def measure_gain(problem: Problem, fit: Fit, joint: int) -> float:
    """Return the gain of one of several joints, given the others [nat]."""
    other = problem.fit(fit.springs.without(joint), fit.change)
    return 0.5 * (other.misfit - fit.misfit)


def drop_weak(problem: Problem, fit: Fit, price: float) -> Fit:
    """Return a fit without the joints that gain less than their price, given the others."""
    while fit.springs.joints:
        gains = {j: measure_gain(problem, fit, j) for j in fit.springs.joints}
        weakest = min(gains, key=lambda j: gains[j])
        if gains[weakest] >= price:
            break
        fit = problem.fit(fit.springs.without(weakest), fit.change)
    return fit


def tune(problem: Problem, fit: Fit, band: float) -> Fit:
    """Return the last numbers of the joints that still resonate, without torque scales."""
    without = problem.with_rivals(-problem.n)
    while fit.springs.joints:
        fit = without.fit(fit.springs, fit.change, LAST)
        silent = _silent(fit.springs, band)
        if not silent.any():
            break
        joint = fit.springs.joints[int(np.argmax(silent))]
        springs = fit.springs.without(joint)
        fit = replace(fit, springs=springs)
    return fit


def _price(problem: Problem, joints: int) -> float:
    """Return the gain that a joint must exceed [nat]: of two numbers, and of all that are tried."""
    rows = sum(y.size for y in problem.torque)
    return float(np.log(rows) + np.log(joints * len(FREQUENCIES)) + RULES.surplus)


def _silent(springs: Springs, band: float) -> Array:
    """Return which joints (m,) of one set have no resonance that the band can show."""
    high = springs.frequency[0] > RULES.highest * band
    return high | (springs.ratio[0] > RULES.damped)


def measure_response(problem: Problem, fit: Fit, at: int, band: float) -> Response:
    """Return the frequency response of a joint that bends, up to the band [Hz]."""
    joint = fit.springs.joints[at]
    rigid = []
    measured = []
    modelled = []
    for s in problem.stretches:
        values = s.values(fit.change)
        load = s.load(values)
        bent = s.bent_torque(fit.springs, problem.inertia, values)[:, :, 0]
        rigid.append(load[s.settled, joint])
        measured.append((s.piece.tau - s.whole(fit.change) + load)[s.settled, joint])
        modelled.append((load + bent)[s.settled, joint])
    length = max(map(len, rigid))
    frequency = np.fft.rfftfreq(length, problem.stretches[0].step)
    shown = (frequency > 0) & (frequency <= band)
    own, *others = (
        np.abs(_cross_spectrum(rigid, other, length))[shown]
        for other in (rigid, measured, modelled)
    )
    return Response(frequency[shown], *(x / own for x in others))


def _cross_spectrum(inputs: Sequence[Array], outputs: Sequence[Array], length: int) -> Array:
    """Return the sum of the cross spectra of some records, smoothed over neighbours.

    Each record is transformed as a whole, and only a tenth of it fades. Short windows would bias a
    resonance through which a motion sweeps.
    """
    from scipy.signal.windows import tukey  # noqa: PLC0415 - a third of a second, for who asks

    total = np.zeros(length // 2 + 1, complex)
    for x, y in zip(inputs, outputs, strict=True):
        taper = tukey(len(x), 0.1)
        first, second = (np.fft.rfft(taper * (z - z.mean()), length) for z in (x, y))
        total += first.conj() * second
    return np.convolve(total, (1 / 6, 2 / 3, 1 / 6), mode="same")


def _describe(
    problem: Problem, fit: Fit, at: int, gains: dict[int, float], response: Response
) -> ElasticJoint:
    joint = fit.springs.joints[at]
    frequency = float(fit.springs.frequency[0, at])
    # A stiffness goes with the square of its frequency.
    variance = fit.covariance[at, at]
    sd = float(np.hypot(2.0 * np.sqrt(variance), RULES.model_error))
    stiffness = float(fit.springs.stiffness(problem.inertia)[0, at])
    # Frequency and damping ratio were those of the first inertia.
    inertia = float(mean_inertia(problem.stretches[0], fit.change)[joint])
    other = float(np.sqrt(problem.inertia[joint] / inertia))
    frequency *= other
    name = problem.stretches[0].robot.joints[joint]
    damping_ratio = other * float(fit.springs.ratio[0, at])
    dampings = fit.springs.damping(problem.inertia)[0, at]
    return ElasticJoint(
        joint=name,
        stiffness=stiffness,
        stiffness_sd=sd * stiffness,
        resonance=frequency,
        resonance_sd=0.5 * sd * frequency,
        damping_ratio=damping_ratio,
        damping=float(dampings),
        inertia=inertia,
        gain=gains[joint],
        response=response,
    )


def _errors(inertia: Array, stretches: Sequence[Stretch], fit: Fit) -> Array:
    """Return the root mean square of each joint's residual torque, (n,)."""
    left = []
    for s in stretches:
        model = s.whole(fit.change)
        if fit.springs.joints:
            values = s.values(fit.change)
            model = model + s.bent_torque(fit.springs, inertia, values)[:, :, 0]
        left.append(s.kept_rows(s.piece.tau - model))
    return np.sqrt(np.mean(np.concatenate(left) ** 2, axis=0))


def _fit_autoregression(left: Sequence[Array]) -> tuple[Array, float]:
    """Return the filter that makes residuals of one joint white, and their size then."""
    rows = []
    for x in left:
        late = [x[ORDER - k : len(x) - k] for k in range(ORDER + 1)]
        rows.append(np.stack(late, 1))
    lagged = np.concatenate(rows)
    weights = np.linalg.lstsq(lagged[:, 1:], lagged[:, 0], rcond=None)[0]
    size = float(np.std(lagged[:, 0] - lagged[:, 1:] @ weights))
    return np.append(1.0, -weights), size or 1.0


def _orthonormal(columns: Array) -> Array:
    """Return an orthonormal basis of columns (N, k)."""
    unit = columns / or_one(np.linalg.norm(columns, axis=0))
    left, size, _ = np.linalg.svd(unit, full_matrices=False)
    return left[:, size > RANK_TOLERANCE * size[0]]


def _solve(columns: Array, target: Array) -> Array:
    """Return the least-squares values of columns, with columns of any unit."""
    length = or_one(np.linalg.norm(columns, axis=0))
    return np.linalg.lstsq(columns / length, target, rcond=RANK_TOLERANCE)[0] / length
