"""`Plan`: what was decided about the preparation of a log once, for all its samples; rests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log, fourier, signals
from identifiability.logs.gaps import Grid, fill
from identifiability.logs.log import join_logs
from identifiability.logs.prepare.white_noise import Smoothing
from identifiability.logs.spectrum import bandwidth_of_windows
from identifiability.logs.stale import StaleRule
from identifiability.robot import Robot

#: A joint slower than this share of its largest speed stands still.
REST_SPEED = 0.01


@frozen
class RestRule:
    """When all joints stand still.

    Attributes
    ----------
    limit : (n,) [rad/s or m/s]
        Speed below which a joint stands still.
    least : float [samples]
        Only stops that last longer count; shorter ones are reversals.
    """

    limit: Array
    least: float

    @property
    def reach(self) -> int:
        """Samples on each side that decide whether a sample belongs to a rest."""
        return int(self.least) + 2

    def find(self, dq: Array) -> np.ndarray:
        """Return where all joints stand still, (N,) bool."""
        still: np.ndarray = np.all(np.abs(dq) <= self.limit, axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]])))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            still[start:stop] = stop - start > self.least
        return still


def choose_rest_rule(q: Sequence[Array], dq: Sequence[Array], dt: float) -> RestRule | None:
    """Return what counts as standing still; None where a motion never does, or always.

    A joint stands still below `REST_SPEED` times its largest speed. Only stops that last longer
    than half a period of the fastest motion count (and none that is longer than
    `signals.WINDOW`): friction may be anything up to its Coulomb level there.

    Parameters
    ----------
    q, dq : sequences of (N, n) [rad or m; rad/s or m/s]
        Windows; the longest ones, of equal length, tell the band of the motion.
    dt : float [s]
    """
    high, low = np.max([x.max(0) for x in q], axis=0), np.min([x.min(0) for x in q], axis=0)
    speed = np.max([np.abs(x).max(0) for x in dq], axis=0)
    # A joint that never moves has no largest speed to compare with.
    limit = REST_SPEED * np.where(signals.never_moves(low, high), np.inf, speed)
    still = [np.all(np.abs(x) <= limit, axis=1) for x in dq]
    if all(s.all() for s in still):
        return None
    least = 0.5 / max(bandwidth_of_windows(q, dt) * dt, 1e-300)
    return RestRule(limit, min(least, float(signals.WINDOW)))


@frozen
class Plan:
    """What was decided about a log once, for all its samples.

    Attributes
    ----------
    step : float [s]
        Sampling step.
    cutoff : float or None [Hz]
        Low-pass of computed derivatives; None where there is none.
    series : FourierFit or None
        Motion as a Fourier series, in time since `start`.
    start : float [s]
        First time of the log.
    rest : RestRule or None
        Which samples are left out because nothing moves; None keeps all.
    factor : int
        Decimation; 1 for none.
    notes : tuple of str
        How derivatives are made, for the report.
    remarks : tuple of str
        What seems to be wrong with the columns.
    stale : StaleRule or None
        Which values repeat the sample before and are interpolated; None leaves all as they are.
    grid : Grid or None
        Where samples are missing; None if none are.
    smoothing : Smoothing or None
        Of measured velocities, of which signs are taken; None where there is none.
    hints : tuple of str
        What to say of it where every reader looks.
    """

    step: float
    cutoff: float | None
    series: fourier.FourierFit | None
    start: float
    rest: RestRule | None
    factor: int
    notes: tuple[str, ...]
    remarks: tuple[str, ...] = ()
    stale: StaleRule | None = None
    grid: Grid | None = None
    smoothing: Smoothing | None = None
    hints: tuple[str, ...] = ()

    @property
    def decimation(self) -> signals.Decimation | None:
        """The decimation, if there is any."""
        return signals.Decimation(self.factor) if self.factor > 1 else None

    @property
    def band_notes(self) -> list[str]:
        """What was done about the band, for the report."""
        if self.decimation is None:
            return []
        return [
            f"torque and every column of the regressor were low-passed alike and decimated by "
            f"{self.factor} to {1.0 / (self.step * self.factor):.4g} Hz"
        ]

    @property
    def filter_reach(self) -> int:
        """Samples on each side that derivatives and rests draw on."""
        filtered = 0
        if self.cutoff is not None:
            filtered = signals.settling_rows(self.step, self.cutoff) + 2 * signals.REACH
        elif self.smoothing is not None:
            filtered = signals.settling_rows(self.step, self.smoothing.cutoff)
        return filtered + (0 if self.rest is None else self.rest.reach) + 1

    @property
    def reach(self) -> int:
        """Samples on each side that an output draws on."""
        return self.filter_reach + (0 if self.decimation is None else self.decimation.reach)

    def mend(self, log: Log, origin: int = 0) -> Log:
        """Return a log, as it was recorded, with repeated values interpolated.

        Parameters
        ----------
        log : Log
        origin : int
            Row of its first sample in the whole log.
        """
        if self.stale is None or self.grid is None:
            return log if self.stale is None else self.stale.mend(log)
        return join_logs(
            [self.stale.mend(log.rows(a, b)) for a, b in self.stretches(len(log), origin)]
        )

    def derive(self, log: Log, origin: int = 0) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration of the actuated joints, each (N, n).

        The computed derivatives of a joint that never moves are zero: the sign of what rounding
        leaves there would pass for friction, another one on every processor.

        Parameters
        ----------
        log : Log
        origin : int
            Row of its first sample in the whole log.
        """
        if self.cutoff is None and self.series is None:
            assert log.dq is not None
            assert log.ddq is not None
            return log.q, log.dq, log.ddq
        if self.series is not None:
            q, dq, ddq = self.series.motion(log.t - self.start)
        else:
            stretches = self.stretches(len(log), origin)
            parts = [self._filter(log.rows(a, b), origin + a) for a, b in stretches]
            q, dq, ddq = (np.concatenate(x) for x in zip(*parts, strict=True))
        moves = ~signals.never_moves(log.q.min(0), log.q.max(0))
        return q, np.where(moves, dq, 0.0), np.where(moves, ddq, 0.0)

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
        parts = []
        for a, b in self.stretches(len(log), origin):
            at = np.arange(b - a) if self.grid is None else self.grid.places(origin + a, origin + b)
            parts.append(self.smoothing.apply(fill(log.dq[a:b], at), self.step)[at])
        return np.concatenate(parts)

    def stretches(self, rows: int, origin: int) -> list[tuple[int, int]]:
        """Return the stretches without a long gap of so many rows from `origin` on."""
        return [(0, rows)] if self.grid is None else self.grid.stretches(origin, origin + rows)

    def _filter(self, log: Log, origin: int) -> tuple[Array, Array, Array]:
        """Return the motion of a stretch; short gaps are filled before and forgotten after."""
        assert self.cutoff is not None
        if self.grid is None:
            at = np.arange(len(log))
        elif len(log) < self.grid.least:  # it will be left out
            return log.q, np.zeros_like(log.q), np.zeros_like(log.q)
        else:
            at = self.grid.places(origin, origin + len(log))
        q = signals.lowpass(fill(log.q, at), self.step, self.cutoff)
        if log.dq is None:
            dq = signals.differentiate(q, self.step)
        else:
            dq = signals.lowpass(fill(log.dq, at), self.step, self.cutoff)
        ddq = signals.differentiate(dq, self.step)
        return (q, dq, ddq) if len(q) == len(log) else (q[at], dq[at], ddq[at])


def joint_log(robot: Robot, log: Log) -> Log:
    """Return a log with its joints in the robot's order, motors converted to joints.

    Raises
    ------
    LogError
        If the log has other joints than the robot.
    """
    gear = robot.transmission
    motors = has_motors(robot, log)
    log = log.select(robot.joints, gear.motors if gear else ())
    if gear is None or not motors:
        return log
    q, tau = gear.joint_side(log.q, log.tau)

    def rate(x: Array | None) -> Array | None:
        return None if x is None else gear.joint_rate(x)

    q_ref = None if log.q_ref is None else gear.joint_side(log.q_ref, log.tau)[0]
    log = replace(log, joints=robot.joints, tau=tau, q_ref=q_ref)
    return replace(log, q=q, dq=rate(log.dq), ddq=rate(log.ddq))


def has_motors(robot: Robot, log: Log) -> bool:
    """Return whether a log has the robot's motors instead of its joints."""
    gear = robot.transmission
    return gear is not None and all(m in log.joints for m in gear.motors)
