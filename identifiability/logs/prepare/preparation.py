"""Turn a log into motion: the requested options, and the plan that follows from them.

Decisions on long logs are made on windows, also those on lost samples. `DwellRule` finds the rows
in which joints stand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from math import gcd

import numpy as np
import scipy
from scipy.special import bdtrc

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.options import Count, Derivatives, Positive, check_fields
from identifiability.foundation.rounding import percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.base import ACC, GYRO
from identifiability.logs.commands import of_commands
from identifiability.logs.contradictions import check_units
from identifiability.logs.gaps import Gaps, Grid, StaleRule, fill
from identifiability.logs.log import join_logs, too_long
from identifiability.logs.rows import WINDOW
from identifiability.logs.rules import RULES
from identifiability.logs.series import KINDS, smooth_log
from identifiability.logs.spectrum import (
    ORDER,
    Band,
    Spectrum,
    bandwidth_of_windows,
    choose_band,
    noise_at_rest,
    noise_level,
    spectra_of,
)
from identifiability.robot import Robot
from identifiability.robot.floating import BASE_JOINTS, SIX, base_acceleration

# Noisy measured velocities are smoothed before their signs are used.


@frozen
class Smoothing:
    """The smoothing of noisy measured velocities, for their signs.

    Attributes
    ----------
    cutoff : float [Hz]
        Cut-off of the low-pass.
    sd : (n,) [rad/s or m/s]
        Standard deviation of the smoothed velocities.
    raw : (n,) bool
        Velocities that are not smoothed. Near rest they have less noise than smoothed ones, for
        example if noise is in proportion to the speed.
    """

    cutoff: float
    sd: Array
    raw: Array

    @staticmethod
    def choose(windows: Sequence[Array], dt: float) -> Smoothing | None:
        """Return the smoothing of velocities; None if noise is negligible.

        The low-pass leaves the band of the motion alone.

        Parameters
        ----------
        windows : sequence of (N, n)
            Velocities, of equal length.
        dt : float [s]
        """
        level = np.sqrt(np.mean([noise_level(x) ** 2 for x in windows], axis=0))
        size = np.sqrt(np.mean([x.var(0) for x in windows], axis=0))
        noisy = level > RULES.negligible * size
        if not noisy.any():
            return None
        widths = Spectrum.of(windows, dt, 1).bandwidths()
        band = float(widths.max(initial=0.0))
        cutoff = min(max(RULES.cutoff_wide * band, RULES.cutoff_lowest), 0.45 / dt)
        sd = np.sqrt(2 * cutoff * dt) * level
        at_rest = np.sqrt(np.mean([noise_at_rest(x) for x in windows], axis=0))
        # Noise at rest below this share of that in motion (rms) counts as none.
        at_rest[~noisy | (at_rest < 0.3 * level)] = 0.0
        raw = at_rest <= sd
        if not at_rest.any():
            return None
        return Smoothing(cutoff, np.minimum(at_rest, sd), raw)

    def apply(self, x: Array, dt: float) -> Array:
        """Return velocities x (N, n) smoothed, and their standard deviation, (N, 2, n)."""
        smooth = np.where(self.raw, x, signals.lowpass(x, dt, self.cutoff))
        return np.stack([smooth, np.broadcast_to(self.sd, x.shape)], axis=1)


# `Plan`: decisions about the preparation of a log; `DwellRule`: joints at rest.


#: Below this number of standard deviations the sign of a speed is uncertain.
UNSURE: Tolerance = 3.0

#: Samples of a dwell at least.
SEVERAL = 3


@frozen
class DwellRule:
    """The rule for joints at rest: a joint stays about zero speed for longer than any reversal.

    Dry friction holds a resting joint, with any torque up to its level. Its motor torque then
    carries no information on the robot. The duration of a reversal follows from its acceleration.
    Its torque is data if no joint ever stands. If joints stand, friction may stick at reversals,
    too. The low-passed motion shows neither the instant at which friction changes its sign nor a
    short stick. A few such rows are off by tens of standard errors.

    Attributes
    ----------
    creep : (k, n) [rad/s or m/s]
        Speeds below which a joint may stand, the largest first.
    slow : (k, n) [samples]
        Shortest stay below these speeds that counts as rest.
    beside : int
        Samples on each side whose speed and acceleration the low-pass mixes with a dwell.
    turning : int
        Samples on each side of a reversal that are no data; 0 if reversals are data.
    """

    creep: Array
    slow: Array
    beside: int
    turning: int = 0

    @property
    def reach(self) -> int:
        """Samples on each side that decide whether a joint dwells."""
        return int(self.slow.max()) + max(self.beside, self.turning) + 1

    def find(self, dq: Array) -> Array:
        """Return where each joint dwells, (N, n) bool; dq (N, n) are the speeds that are used."""
        out = np.zeros(dq.shape, bool)
        speed = np.abs(dq)
        for creep, slow in zip(self.creep, self.slow, strict=True):
            for j, least in enumerate(slow.tolist()):
                out[:, j] |= _lasting(speed[:, j] <= creep[j], least)
        # A dwell lasts as long as the joint creeps.
        line = np.array([[0, 1, 0]] * 3)
        mask = out | (speed <= self.creep[0])
        out = scipy.ndimage.binary_propagation(out, line, mask=mask)
        out = _reached(out, self.beside)
        if self.turning:
            return out | _reached(_reversals(dq), self.turning)
        return out


def _reversals(dq: Array) -> Array:
    """Return the samples behind which the speeds dq (N, n) cross zero, (N, n) bool."""
    turns = np.zeros(dq.shape, bool)
    turns[:-1] = np.sign(dq[:-1]) != np.sign(dq[1:])
    return turns


def _lasting(x: Array, window: int) -> Array:
    """Return a mask of x (N,) bool that is true for at least a window around some sample."""
    size = 2 * (window // 2) + 1  # an opening, in a time that does not grow with the window
    slow = scipy.ndimage.minimum_filter1d(x.astype(np.uint8), size, mode="constant")
    return scipy.ndimage.maximum_filter1d(slow, size, mode="constant") > 0


@frozen
class Stays:
    """Durations of dwells about zero speed in windows of a log, in excess of reversals.

    Attributes
    ----------
    plan : Plan
        Plan of the log, with its decimation.
    speeds : tuple of (N, n) [rad/s or m/s]
        Speeds that the rule uses.
    creep : (k, n) [rad/s or m/s]
        Speeds below which a joint may stand.
    typical : (n,) [rad/s² or m/s²]
        Standard deviation of the acceleration.
    never : (n,) bool
        Whether a joint never moves.
    """

    plan: Plan
    speeds: tuple[Array, ...]
    creep: Array
    typical: Array
    never: Array

    @staticmethod
    def of(plan: Plan, windows: Sequence[Log], origins: Sequence[int]) -> Stays:
        """Return those in windows whose first samples are these rows of the whole log."""
        parts = [plan.derive(w, k) for w, k in zip(windows, origins, strict=True)]
        q, dq, ddq = map(np.concatenate, zip(*parts, strict=True))
        creep = RULES.creep * np.abs(dq).max(0)
        moving = np.where(np.abs(dq) > creep, np.abs(ddq), np.nan)
        constant = signals.never_moves(q.min(0), q.max(0))
        never = constant | np.isnan(moving).all(0)
        typical = np.full(len(never), np.inf)  # of a Gaussian the median is .67 of its spread
        typical[~never] = np.nanmedian(moving[:, ~never], axis=0) / 0.6745
        typical = np.where(typical > 0, typical, np.inf)
        # Number of halvings of the speed at rest; noise of the record hides slower ones.
        halvings = 2.0 ** np.arange(6)[:, None]
        floor = 4.0 * plan.speed_noise(windows)
        creep = np.maximum(creep / halvings, floor)
        creep[:, never] = np.inf
        return Stays(plan, tuple(v for _, v, _ in parts), creep, typical, never)

    def rule(self, rare: int = 1) -> DwellRule:
        """Return the rule that takes 5 % / `rare` of reversals of Gaussian motion for dwells."""
        step = self.plan.step
        cutoff = self.plan.cutoff
        # Rayleigh distributed: a share p of reversals is slower than in proportion to its root;
        # slower ones of Gaussian motion are 5 %: √(−2 ln .95) [Rice 1944].
        slowest = 0.32 / np.sqrt(rare) * np.where(self.never, np.inf, self.typical)
        crossing = 2 * np.where(self.never, 0.0, self.creep) / slowest
        blurred = 0.0 if cutoff is None else 1.0 / cutoff
        told = crossing >= blurred  # the filter cannot resolve slower ones
        told[0] = True
        creep, crossing = (np.where(told, x, x[0]) for x in (self.creep, crossing))
        longer = np.maximum(np.ceil(crossing / step), SEVERAL).astype(int)
        return DwellRule(creep, longer, int(np.ceil(0.5 * blurred / step)))

    def count(self, rare: int = 1) -> tuple[int, int]:
        """Return how many stays of all joints there are by a rule, and how many reversals."""
        rule = replace(self.rule(rare), beside=0)
        stays = 0
        reversals = 0
        for v in self.speeds:
            dwells = rule.find(v)[:, ~self.never]
            stays += int(
                (
                    np.diff(
                        dwells,
                        axis=0,
                        prepend=False,
                    )
                    & dwells
                ).sum()
            )
            reversals += int((_reversals(v)[:, ~self.never] & ~dwells).sum())
        return stays, stays + reversals


def ever_stand(logs: Sequence[Stays]) -> bool:
    """Return whether joints ever stand in any of some logs that are used together.

    One in twenty reversals of smooth motion is as slow as a dwell. Joints stand if dwells are more
    frequent than chance explains. They also stand if one dwell lasts longer than the slowest of all
    reversals.
    """
    slower = 0.05
    found, reversals = np.sum([x.count() for x in logs], axis=0)
    if not reversals:  # nor any stay, which would be counted among them
        return False
    if bdtrc(found - 1, reversals, slower) <= slower:
        return bool(found)
    return any(x.count(int(reversals))[0] for x in logs)


#: Samples of the motion for each output of which columns are computed, if there are so many.
NODES = 8


@frozen
class Plan:
    """Decisions about a log, which hold for all its samples.

    Attributes
    ----------
    step : float [s]
        Sampling step.
    cutoff : float or None [Hz]
        Low-pass of computed derivatives; None without one.
    dwells : DwellRule or None
        Rule for joints at rest, whose torque is no data; None keeps all torque.
    factor : int
        Decimation; 1 for none.
    notes : tuple of str
        Notes on derivatives, for the report.
    stale : StaleRule or None
        Rule for repeated values, which are interpolated; None keeps all values.
    grid : Grid or None
        Positions of missing samples; None if none are missing.
    smoothing : Smoothing or None
        Smoothing of measured velocities for their signs; None without one.
    hints : tuple of str
        Hints on it for every reader.
    band : float or None [Hz]
        Upper limit of the kept band of torque and columns with computed derivatives; else None.
    every : int
        Columns are computed at every so many samples if that divides the decimation.
    """

    step: float
    cutoff: float | None
    dwells: DwellRule | None
    factor: int
    notes: Strings
    stale: StaleRule | None = None
    grid: Grid | None = None
    smoothing: Smoothing | None = None
    hints: Strings = ()
    band: float | None = None
    every: int = 1

    @property
    def decimation(self) -> signals.Decimation | None:
        """The decimation, if there is any."""
        if self.factor > 1:
            return signals.Decimation(self.factor, gcd(self.factor, self.every))
        return None

    @property
    def reach(self) -> int:
        """Samples on each side that an output draws on: for derivatives, dwells and decimation."""
        found = 1
        if self.cutoff is not None:
            found += signals.settling_rows(self.step, self.cutoff) + 2 * signals.REACH
        elif self.smoothing is not None:
            found += signals.settling_rows(self.step, self.smoothing.cutoff)
        found += 0 if self.dwells is None else self.dwells.reach
        return found + (0 if self.decimation is None else self.decimation.reach)

    def speed_noise(self, windows: Sequence[Log]) -> Array:
        """Return the standard deviation of noise in the speeds that are used, (n,)."""
        recorded = all(w.dq is not None for w in windows)
        records = [w.dq if w.dq is not None and recorded else w.q for w in windows]
        levels = [noise_level(x, w.t) ** 2 for x, w in zip(records, windows, strict=True)]
        sd = np.sqrt(np.mean(levels, axis=0))
        if not recorded:  # white noise up to the cut-off, differentiated
            sd *= 2 * np.pi * np.sqrt(2 / 3 * self.step * (self.cutoff or 0.0) ** 3)
        return sd

    def mend(self, log: Log, origin: int = 0) -> Log:
        """Return a log, as it was recorded, with repeated values interpolated.

        Parameters
        ----------
        log : Log
        origin : int
            Row of its first sample in the whole log.
        """
        if self.stale is None or self.grid is None:
            if self.stale is None:
                return log
            return self.stale.mend(log)
        ends = self.grid.stretches(origin, origin + len(log))
        return join_logs([self.stale.mend(log.rows(a, b)) for a, b in ends])

    def derive(self, log: Log, origin: int = 0) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration of the actuated joints, each (N, n).

        The computed derivatives of a joint that never moves are zero. Else the sign of rounding
        errors would pass for friction, and differ between processors. The derivatives of a stretch
        that is too short are zero, too, because it will be left out.

        Parameters
        ----------
        log : Log
        origin : int
            Row of its first sample in the whole log.
        """
        if self.cutoff is None:
            assert log.dq is not None
            assert log.ddq is not None
            q = log.q
            dq = log.dq
            ddq = log.ddq
        else:
            q = np.array(log.q)
            dq, ddq = np.zeros((2, *log.q.shape))
            for rows, at in self._stretches(len(log), origin):
                x = signals.lowpass(fill(log.q[rows], at), self.step, self.cutoff)
                if log.dq is None:
                    v = signals.differentiate(x, self.step)
                else:
                    v = signals.lowpass(fill(log.dq[rows], at), self.step, self.cutoff)
                q[rows] = x[at]
                dq[rows] = v[at]
                ddq[rows] = signals.differentiate(v, self.step)[at]
            still = signals.never_moves(log.q.min(0), log.q.max(0))
            dq[:, still] = ddq[:, still] = 0.0
        if log.base is None:
            return q, dq, ddq
        q = np.array(q)
        dq = np.array(dq)
        ddq = np.array(ddq)
        for rows, at in self._stretches(len(log), origin):
            # Not low-passed: it enters the columns linearly, and those are, as torque is.
            record = fill(log.base[rows, :6], at)
            alpha = signals.differentiate(record[:, GYRO], self.step)[at]
            dq[rows, 3:6] = record[at, GYRO]
            ddq[rows, :SIX] = base_acceleration(record[at, ACC], record[at, GYRO], alpha)
        return q, dq, ddq

    def smooth_speed(self, log: Log, origin: int = 0) -> Array | None:
        """Return smoothed velocities and their standard deviation, (N, 2, n); None if not needed.

        Parameters
        ----------
        log : Log
        origin : int
            Row of its first sample in the whole log.
        """
        if self.smoothing is None or log.dq is None:
            return None
        out = np.zeros((len(log), 2, log.dq.shape[1]))
        for rows, at in self._stretches(len(log), origin):
            out[rows] = self.smoothing.apply(fill(log.dq[rows], at), self.step)[at]
        return out

    def _stretches(self, rows: int, origin: int) -> Iterator[tuple[slice, Array]]:
        """Yield the stretches of `rows` rows from `origin` on without long gaps; skip short ones.

        Each comes with the sampling times of its rows, in steps after the first.
        """
        if self.grid is None:
            yield slice(0, rows), np.arange(rows)
            return
        for a, b in self.grid.stretches(origin, origin + rows):
            if b - a >= self.grid.least:
                yield slice(a, b), self.grid.places(origin + a, origin + b)

    @staticmethod
    def undirected(log: Log) -> np.ndarray | None:
        """Return a mask of rows in which a joint of a series has no sure direction, (N, n) bool.

        The sign of friction would be wrong there, at the same rows of every period.
        """
        if log.speed_error is None or log.dq is None:
            return None
        return np.abs(log.dq) < UNSURE * log.speed_error

    def lacking(self, unmeasured: Array) -> Array:
        """Return the rows where torque is no data after decimation, (N, n) bool.

        The argument marks unmeasured torque. A decimation filter mixes it with neighbouring
        samples. Gaps shorter than the step of outputs are bridged by their neighbours.
        """
        if self.factor == 1:
            return unmeasured
        short = _reached(~_reached(~unmeasured, self.factor // 2), self.factor // 2) & unmeasured
        return _reached(short, self.factor)


def _reached(x: Array, reach: int) -> Array:
    """Return (N, n) bool that is true within `reach` samples of any true value."""
    return scipy.ndimage.maximum_filter1d(x, 2 * min(reach, len(x)) + 1, axis=0)


def joint_log(robot: Robot, log: Log) -> Log:
    """Return a log with its joints in the robot's order, motors converted to joints.

    Raises
    ------
    LogError
        If the log has other joints than the robot.
    """
    if log.joints == robot.joints:
        return log
    gear = robot.transmission
    motors = has_motors(robot, log)
    log = log.select(robot.motor_joints or BASE_JOINTS[:1], gear.motors if gear else ())
    if not (gear and motors):
        return _on_base(robot, log)
    q, tau = gear.joint_side(log.q, log.tau)

    def rate(x: Array | None) -> Array | None:
        return None if x is None else gear.joint_rate(x)

    q_ref = None if log.q_ref is None else gear.joint_side(log.q_ref, log.tau)[0]
    gone = log.unmeasured
    unmeasured = None if gone is None else gone @ (gear.coupling != 0)
    changed = replace(
        log,
        joints=robot.motor_joints,
        q=q,
        dq=rate(log.dq),
        ddq=rate(log.ddq),
        tau=tau,
        q_ref=q_ref,
        dq_ref=rate(log.dq_ref),
        tau_ff=None,
        # Torque of a joint is the sum over its motors.
        unmeasured=unmeasured,
    )
    return _on_base(robot, changed)


def _on_base(robot: Robot, log: Log) -> Log:
    """Return a log with the six undriven joints of a floating base.

    Raises
    ------
    LogError
        If the log was read for a robot with a fixed base.
    """
    if robot.base is None:
        return log
    if log.base is None:
        raise LogError(
            f"{log.name} was read without its columns of the floating base: read it with "
            "Conventions.of(robot), or give its file."
        )
    before = np.zeros((len(log), SIX))
    own = len(robot.motor_joints)
    found = log.each(lambda x: np.hstack([before, x[:, :own]]), joints=robot.joints)
    return replace(found, base=log.base)


def has_motors(robot: Robot, log: Log) -> bool:
    """Return whether a log has the robot's motors instead of its joints."""
    gear = robot.transmission
    return gear is not None and all(m in log.joints for m in gear.motors)


# The windows of a log for decisions, and the decisions about lost samples.


@frozen
class Windows:
    """The windows of a log on which decisions are made.

    Attributes
    ----------
    logs : list of Log
    origins : list of int
        First row of each window.
    gaps : Gaps
    stale : StaleRule or None
        Rule by which repeated values were interpolated; None if they were kept.
    """

    logs: list[Log]
    origins: list[int]
    gaps: Gaps
    stale: StaleRule | None

    @staticmethod
    def of(log: Log, *, mend: bool) -> Windows:
        """Return the windows of a log, with repeated values interpolated or as they are."""
        at, raw = map(list, zip(*log.windows(), strict=True))
        gaps = Gaps.of(log.name, log.clock, [w.t for w in raw])
        rule = StaleRule.of(raw) if mend else None
        logs = raw if rule is None else [rule.mend(w) for w in raw]
        return Windows(logs, at, gaps, rule)

    def even(self, longest: float) -> list[Log]:
        """Return stretches of even steps: short gaps are filled, others split the windows."""
        grid = self.gaps.divide(longest)
        if grid is None:
            return self.logs
        stretches = []
        for log, origin in zip(self.logs, self.origins, strict=True):
            for a, b in grid.stretches(origin, origin + len(log)):
                part = log.rows(a, b)
                at = grid.places(origin + a, origin + b)
                filled = partial(fill, at=at)
                stretches.append(part.each(filled, t=filled(part.t)))
        return stretches


def plan_gaps(plan: Plan, gaps: Gaps, samples: int) -> Plan:
    """Return a plan that bridges short gaps and splits the log at others, with notes."""
    least = 1
    bridged = 0.5 / RULES.cutoff_lowest
    longest = max(bridged, RULES.lost * plan.step)  # measured derivatives need no filter
    if plan.band is not None:
        longest = 0.5 / plan.band
        gaps.check(samples)
        # Fewest samples between two gaps that are used.
        least = max(4, int(np.ceil(1.0 / (plan.band * plan.step))))
    grid = gaps.divide(longest, least)
    hints = [*plan.hints]
    if plan.cutoff is not None and abs(gaps.drift) > RULES.small:
        hints.append(
            f"{gaps.name} is sampled unevenly: the mean step is {percent(gaps.drift, 2)} off the "
            f"usual {gaps.step:.3g} s, and derivatives err by as much: give samples at "
            "even steps, or measured velocities and accelerations."
        )
    if grid is None:
        return replace(plan, hints=tuple(hints))
    notes = [*plan.notes]
    split = np.isin(gaps.rows + 1, grid.breaks)
    if len(grid.after) and plan.cutoff is not None:
        longest = float(gaps.length[~split].max())
        notes.append(
            Finding(
                "bridged",
                gaps.name,
                rows=int(grid.lost.sum()),
                longest=longest,
            )
        )
    if len(grid.breaks):
        hints.append(
            Finding("split", gaps.name, where=gaps.tell(split), parts=len(grid.breaks) + 1)
        )
    return replace(
        plan,
        grid=grid,
        notes=tuple(notes),
        hints=tuple(hints),
    )


# Turn a log into motion: the requested options, and the plan that follows from them.
#
# Some decisions must hold all along a log: cut-off, sampling step, joints at rest, decimation. They
# are made on a bounded number of samples. A log can then be prepared in any parts, with the same
# result as for the whole log.


#: Fewer samples do not separate noise from motion.
SHORT = 4 * ORDER


@frozen
class Preparation:
    """Options for turning a log into motion.

    Attributes
    ----------
    derivatives : {"auto", "given", "butterworth", "fourier", "spline"}
        Velocity and acceleration: ``auto`` takes those of the log, or else computes them by
        Butterworth. ``fourier`` and ``spline`` replace the motion by a series that is fitted to all
        its measured channels (`identifiability.logs.series`).
    cutoff : float or None [Hz]
        Low-pass for computed derivatives. By default it follows from the noise and the bandwidth of
        the motion, for all logs together.
    decimate : int or None
        Parallel filter of torque and regressor, which keeps every k-th sample. By default it keeps
        the band up to `outputs` if derivatives are computed by Butterworth, and else everything.
    outputs : float or None [Hz]
        Upper limit of the band of torque and regressor if `decimate` is not given. None means a
        given cut-off, because no acceleration above it explains torque. Without a given cut-off,
        None means 10 × the bandwidth of the motion.
    keep_rest : bool
        Whether to keep the torque of joints at rest. Dry friction has any value up to its level
        there, so this torque is no data for that joint
        (`identifiability.logs.prepare.preparation.DwellRule`). For a robot without dry friction it
        is data.
    """

    derivatives: Derivatives = "auto"
    cutoff: Positive | None = None
    decimate: Count | None = None
    outputs: Positive | None = None
    keep_rest: bool = False

    def __post_init__(self) -> None:
        check_fields(self)


@frozen
class CommonPreparation(Preparation):
    """Options of a preparation, with a cut-off for several logs.

    Attributes
    ----------
    band : Band or None
        Band that the cut-off keeps.
    stands : bool or None
        Whether joints ever stand in any of the logs; None decides for each log.
    common : float or None [Hz]
        The cut-off of the fitted logs, if this log cannot use it and has another band.
    reason : str
        Reason for a series, if the program chose it; empty if the user requested it. A log without
        such a series then gets another one.
    """

    band: Band | None = None
    stands: bool | None = None
    common: float | None = None
    reason: str = ""


def choose_cutoff(
    robot: Robot,
    logs: Sequence[Log],
    how: Preparation | None,
) -> Preparation:
    """Return a preparation with one cut-off for all logs, so that they share one band.

    Parameters
    ----------
    robot : Robot
    logs : sequence of Log
        The fitted logs, which decide. Held-out logs have no influence.
    how : Preparation or None

    Raises
    ------
    LogError
        If a log does not fit the robot.
    """
    how = how or Preparation()
    how = with_series_band(how, [log for log in logs if log.ddq is None])
    logs = [smoothed(robot, log, how) for log in logs]
    raw = [Windows.of(log, mend=is_filtered(log, how)) for log in logs]
    computed = [x for log, x in zip(logs, raw, strict=True) if is_filtered(log, how)]
    if computed:
        how = _with_band(robot, computed, how)
    if how.keep_rest or not logs:
        return how
    bands = [fit_band(robot, log, how) or how for log in logs]  # `make_plan` refuses fitted logs
    items = zip(logs, raw, bands, strict=True)
    stays = [
        Stays.of(_plan_motion(log, x, band), [joint_log(robot, w) for w in x.logs], x.origins)
        for log, x, band in items
    ]
    return CommonPreparation(**{**vars(how), "stands": ever_stand(stays)})


def smoothed(robot: Robot, log: Log, how: Preparation) -> Log:
    """Return a log whose motion is the series that its preparation requests.

    Raises
    ------
    LogError
        If the log is too long for memory, or its motion must repeat and does not.
    """
    if how.derivatives not in KINDS or log.speed_error is not None:
        return log
    if log.long:
        raise too_long(log.name)
    chosen = bool(isinstance(how, CommonPreparation) and how.reason)
    return smooth_log(joint_log(robot, log), how.derivatives, strict=not chosen)


def with_series_band(how: Preparation, logs: Sequence[Log]) -> Preparation:
    """Return a preparation with the band of torque for series through positions.

    Parameters
    ----------
    how : Preparation
    logs : sequence of Log
        Those without measured accelerations: with these, all torque is kept.
    """
    if how.derivatives not in KINDS or how.decimate or how.outputs or not logs:
        return how
    steps = [signals.sampling_step(log.t) for log in logs]
    bands = [bandwidth_of_windows([log.q], dt) for log, dt in zip(logs, steps, strict=True)]
    wide = max(RULES.cutoff_wide * max(bands), RULES.cutoff_lowest)
    outputs = min(wide, RULES.cutoff_highest / max(steps))
    return replace(how, outputs=outputs)


def _with_band(robot: Robot, logs: Sequence[Windows], how: Preparation) -> CommonPreparation:
    """Return the preparation with one band for derivatives, from windows of each log."""
    spectra = []
    for raw in logs:
        windows = [joint_log(robot, w) for w in raw.even(0.5 / RULES.cutoff_lowest)]
        source = [w.q for w in windows]
        order = 2
        if windows[0].dq is not None:
            source = [w.dq for w in windows if w.dq is not None]
            order = 1
        spectra += spectra_of(source, raw.gaps.step, order)
    sliding = [robot.is_prismatic(int(k)) for k in robot.actuated]
    band = choose_band(spectra, sliding, how.cutoff)
    own = {"cutoff": band.cutoff, "outputs": how.outputs or band.outputs, "band": band}
    return CommonPreparation(**{**vars(how), **own})


def fit_band(robot: Robot, log: Log, how: Preparation | None) -> Preparation | None:
    """Return the preparation of a log that did not influence the cut-off.

    A log that cannot use the cut-off, for example because it is sampled more slowly, gets another
    band.

    Parameters
    ----------
    robot : Robot
    log : Log
        A held-out log, or one that is new to a result.
    how : Preparation or None
        Preparation of the fitted logs.

    Raises
    ------
    LogError
        If the log does not fit the robot.
    """
    if how is None or how.cutoff is None or not is_filtered(log, how):
        return how
    raw = Windows.of(log, mend=True)
    common = _motion_cutoff(raw.gaps, how)
    if _lets_through(log, raw.gaps, common):
        return how
    free = replace(how, cutoff=None, outputs=None)
    return replace(_with_band(robot, [raw], free), common=common)


def is_filtered(log: Log, how: Preparation) -> bool:
    """Return whether derivatives of a log are computed after a low-pass."""
    have = {"dq", "ddq"} <= set(log.channels)
    return how.derivatives == "butterworth" or (how.derivatives == "auto" and not have)


def make_plan(robot: Robot, log: Log, how: Preparation) -> Plan:
    """Decide how a log is prepared.

    Raises
    ------
    LogError
        If the log does not fit the robot or the requested options.
    """
    log = smoothed(robot, log, how)
    filtered = is_filtered(log, how)
    raw = Windows.of(log, mend=filtered)
    windows = [joint_log(robot, w) for w in raw.logs]
    stale = raw.stale
    notes = ["motor positions and torques were converted to the joint side"]
    notes *= has_motors(robot, raw.logs[0])
    check_units(robot, windows)
    if not (log.torque or log.motion_alone or robot.base is not None):
        raise LogError(
            f"{log.name}: all torques are zero; nothing was measured, check the columns."
        )
    if filtered and how.cutoff is None:
        how = _with_band(robot, [raw], how)
    plan = _plan_motion(log, raw, how)
    if plan.cutoff is None and log.speed_error is None:
        speeds = [w.dq for w in windows if w.dq is not None]
        if len(speeds[0]) > SHORT:
            plan = replace(plan, smoothing=Smoothing.choose(speeds, plan.step))
    if stale is not None and stale.note:
        notes += [stale.note]
    if len(windows) > 1:
        notes.append(
            f"settings of the whole log were decided on {len(windows)} windows of "
            f"{WINDOW} samples, evenly spaced in time"
        )
    if robot.known_torque:
        known = "; ".join(k.text for k in robot.known_torque)
        notes.append(f"known torque was taken off the measured one: {known}")
    if robot.torque.compensated:
        notes.append(
            "the gravity torque of the file was added to the measured torque, which lacks it "
            "(compensated): information of gravity about masses comes from the file"
        )
    own = 1 if plan.band is None else max(1, int(0.5 / (plan.band * plan.step)))
    # Signs are averaged joint by joint, and the sensor of a base is not low-passed.
    mixes = any(axis.mixed for axis in robot.axes)
    simple = not (robot.base or robot.transmission or robot.passive_axes or mixes)
    most = simple * own / NODES
    if plan.cutoff is not None:
        most = min(most, RULES.cutoff_highest / (plan.cutoff * plan.step))
    # An odd number has as many samples on either side.
    every = max(1, 2 * int(0.5 * most + 0.5) - 1)
    factor = own - own % every if how.decimate is None else how.decimate
    plan = replace(plan, factor=factor, every=every, stale=stale)
    dwells = None
    if not how.keep_rest:
        stays = Stays.of(plan, windows, raw.origins)
        stands = how.stands if isinstance(how, CommonPreparation) else None
        stands = ever_stand([stays]) if stands is None else stands
        dwells = stays.rule()
        # Reversals are data unless a joint ever stands. For commanded robots they are always data:
        # a rollout has the same friction at reversals, so calibrated torque lacks it.
        if stands and not of_commands(log):
            dwells = replace(dwells, turning=max(1, dwells.beside))
    return replace(
        plan,
        dwells=dwells,
        notes=(*plan.notes, *notes),
    )


def _plan_motion(log: Log, raw: Windows, how: Preparation) -> Plan:
    """Return how the motion of a log is derived, gap by gap."""
    return plan_gaps(_plan_derivatives(log, raw.gaps, how), raw.gaps, len(log))


def _plan_derivatives(log: Log, gaps: Gaps, how: Preparation) -> Plan:
    have = {"dq", "ddq"} <= set(log.channels)
    if how.derivatives == "given" and not have:
        raise LogError(
            f"{log.name} does not have '<joint>.dq' and '<joint>.ddq' for every joint; add them, "
            "or let the derivatives be computed (derivatives = auto)."
        )
    plan = Plan(gaps.step, None, None, 1, ())
    if log.speed_error is not None:
        return replace(plan, notes=log.notes[-1:], band=how.outputs)
    if have and how.derivatives in ("auto", "given"):
        return replace(plan, notes=("velocity and acceleration are the log's own",))
    return _plan_filter(log, gaps, plan, how)


def _motion_cutoff(gaps: Gaps, how: Preparation) -> float:
    """Return the low-pass of a log's motion [Hz]: it never ends below the band of torque."""
    assert how.cutoff is not None
    if how.outputs is None:
        return how.cutoff
    highest = RULES.cutoff_highest / gaps.step  # others may be sampled faster
    return max(how.outputs, min(how.cutoff, highest))


def _lowest_cutoff(log: Log) -> float:
    """Return the frequency of one oscillation over the length of a log [Hz]."""
    return 1.0 / (log.clock.last - log.clock.first)


def _lets_through(log: Log, gaps: Gaps, cutoff: float) -> bool:
    """Return whether a log is long enough and sampled fast enough for a cut-off [Hz]."""
    return _lowest_cutoff(log) <= cutoff < 0.5 / gaps.step


def _state_own_band(log: Log, dt: float, how: Preparation) -> tuple[Finding, ...]:
    """Return a note on the band of a log; empty if it is that of the fitted logs."""
    if not isinstance(how, CommonPreparation) or how.common is None:
        return ()
    bands = {"band": how.outputs, "cutoff": how.common}
    span = log.clock.last - log.clock.first
    return (Finding("own_band", log.name, rate=1.0 / dt, span=span, **bands),)


def _plan_filter(log: Log, gaps: Gaps, plan: Plan, how: Preparation) -> Plan:
    dt = gaps.step
    jitter = ""
    cutoff = _motion_cutoff(gaps, how)
    if gaps.jitter > RULES.small:
        jitter = f" (time stamps jitter by {100 * gaps.jitter:.0f} % of a step; taken as even)"
    if not _lets_through(log, gaps, cutoff):
        lowest = _lowest_cutoff(log)
        raise LogError(
            f"The cut-off {cutoff:g} Hz does not lie between one over the length of {log.name} "
            f"({lowest:.3g} Hz) and half its sampling rate ({0.5 / dt:g} Hz)."
        )
    source = "given velocities" if "dq" in log.channels else "positions"
    band = how.band if isinstance(how, CommonPreparation) else None
    outputs = how.outputs or cutoff
    kept = f", and torque is kept up to {outputs:.3g} Hz" if outputs != cutoff else ""
    reason = f" ({band.reason})" if band and band.reason else ""
    note = (
        f"velocity and acceleration are derivatives of the {source} after a zero-phase "
        f"4th-order Butterworth low-pass at {cutoff:.3g} Hz{kept}{reason}{jitter}"
    )
    hints = _state_own_band(log, dt, how)
    return replace(
        plan,
        step=dt,
        cutoff=cutoff,
        band=outputs,
        notes=(note,),
        hints=hints,
    )
