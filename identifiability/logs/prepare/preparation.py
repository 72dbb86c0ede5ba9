"""How a log is turned into motion: what is asked for, and the plan that is made of it once.

Decisions are made on windows of long logs; lost samples are decided upon there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.numbers import percent
from identifiability.foundation.options import Count, Derivatives, Positive, check_fields
from identifiability.foundation.rounding import format_count
from identifiability.foundation.values import frozen
from identifiability.logs import Log, fourier, signals
from identifiability.logs.commands import of_commands
from identifiability.logs.contradictions import check_units
from identifiability.logs.gaps import Gaps, StaleRule, fill
from identifiability.logs.log import too_long
from identifiability.logs.prepare.plan import (
    ORDER,
    Plan,
    Smoothing,
    Stays,
    ever_stand,
    has_motors,
    joint_log,
)
from identifiability.logs.rules import RULES
from identifiability.logs.spectrum import Band, Spectrum, choose_band, spectra_of
from identifiability.robot import Robot

# Where decisions about a log are made, and what is decided about the samples that are lost.


@frozen
class Windows:
    """Where decisions about a log are made.

    Attributes
    ----------
    logs : list of Log
    origins : list of int
        Row at which each begins.
    gaps : Gaps
    stale : StaleRule or None
        By which repeated values were interpolated; None if they were left.
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
                part, filled = log.rows(a, b), partial(fill, at=grid.places(origin + a, origin + b))
                stretches.append(part.each(filled, t=filled(part.t)))
        return stretches


def plan_gaps(plan: Plan, gaps: Gaps, samples: int) -> Plan:
    """Return a plan that bridges short gaps and splits the log at others, and says so."""
    least = 1
    bridged = RULES.gap_bridged / RULES.cutoff_lowest
    longest = max(bridged, RULES.gap_kept * plan.step)  # measured derivatives need no filter
    if plan.band is not None:
        longest = RULES.gap_bridged / plan.band
        gaps.check(samples)
        # Fewest samples between two gaps that are used.
        least = max(4, int(np.ceil(1.0 / (plan.band * plan.step))))
    grid = gaps.divide(longest, least)
    uneven = []
    if plan.cutoff is not None and abs(gaps.drift) > RULES.clock_rounded:
        uneven = [
            f"{gaps.name} is sampled unevenly: the mean step is {percent(gaps.drift, 2)} off the "
            f"usual {gaps.step:.3g} s, and what is differentiated errs by as much: give samples at "
            "even steps, or measured velocities and accelerations."
        ]
    if grid is None:
        return replace(plan, hints=tuple(uneven))
    notes, hints, split = [*plan.notes], uneven, np.isin(gaps.rows + 1, grid.breaks)
    if len(grid.after) and plan.cutoff is not None:
        longest = float(gaps.length[~split].max())
        notes.append(Finding("bridged", gaps.name, rows=int(grid.lost.sum()), longest=longest))
    if len(grid.breaks):
        hints.append(
            f"{gaps.name} lacks samples for {gaps.tell(split)}: it was taken as "
            f"{len(grid.breaks) + 1} stretches, and nothing was computed from one to the next."
        )
        notes.append(Finding("split", gaps.name, parts=len(grid.breaks) + 1))
    return replace(plan, grid=grid, notes=tuple(notes), hints=tuple(hints))


# How a log is turned into motion: what is asked for, and the plan that is made of it once.
#
# Everything that must be the same all along a log (cut-off, sampling step, when a joint stands,
# decimation) is decided on a bounded number of samples, so that a log can then be prepared in any
# parts with the result that it would have as a whole.


#: What a Fourier series is fitted to.
WORDS = {"q": "positions", "dq": "velocities", "ddq": "accelerations"}

#: So few samples do not tell noise from the motion.
SHORT = 4 * ORDER


@frozen
class Preparation:
    """How a log is turned into motion.

    Attributes
    ----------
    derivatives : {"auto", "given", "butterworth", "fourier"}
        Velocity and acceleration: ``auto`` takes the log's own where it has them, else computes
        them by Butterworth.
    cutoff : float or None [Hz]
        Low-pass for computed derivatives [Hz]; by default it is chosen for all logs together, from
        the noise and the bandwidth of the motion.
    period : float or None [s]
        Period of periodic motion [s], for the Fourier fit; by default the whole fraction of the
        duration that fits best.
    harmonics : int
        Harmonics of the Fourier fit.
    decimate : int or None
        Parallel filter of torque and regressor, of which every k-th sample is kept; by default the
        band up to `outputs` where derivatives are computed by Butterworth, else everything.
    outputs : float or None [Hz]
        Up to where torque and regressor are kept where `decimate` does not say it; None for a
        cut-off that is given (torque above it has no acceleration left to explain it), or for 10 ×
        the bandwidth of the motion with one that is chosen.
    keep_rest : bool
        Take the torque of joints that stand, too. Dry friction is anything up to its level there,
        so it is no data for that joint (`identifiability.logs.prepare.plan.DwellRule`), whatever
        model is fitted; of a robot without dry friction it is.
    """

    derivatives: Derivatives = "auto"
    cutoff: Positive | None = None
    period: Positive | None = None
    harmonics: Count = 5
    decimate: Count | None = None
    outputs: Positive | None = None
    keep_rest: bool = False

    def __post_init__(self) -> None:
        check_fields(self)


@frozen
class SettledPreparation(Preparation):
    """The same with a cut-off for several logs.

    Attributes
    ----------
    band : Band or None
        What it lets through.
    stands : bool or None
        Whether joints ever stand in any of the logs; None asks each log.
    """

    band: Band | None = None
    stands: bool | None = None


def settle_cutoff(
    robot: Robot,
    logs: Sequence[Log],
    how: Preparation | None,
) -> Preparation:
    """Return a preparation with one cut-off for all logs: what is compared has one band.

    Parameters
    ----------
    robot : Robot
    logs : sequence of Log
        That decide: the fitted ones. What is held out has no say in what is fitted.
    how : Preparation or None

    Raises
    ------
    LogError
        If a log does not fit the robot.
    """
    how = how or Preparation()
    raw = [Windows.of(log, mend=_is_filtered(log, how)) for log in logs]
    computed = [x for log, x in zip(logs, raw, strict=True) if _is_filtered(log, how)]
    if computed:
        how = _settle(robot, computed, how)
    if how.keep_rest or not logs:
        return how
    stays = [_find_stays(robot, log, x, how) for log, x in zip(logs, raw, strict=True)]
    return SettledPreparation(**{**vars(how), "stands": ever_stand(stays)})


def _settle(robot: Robot, logs: Sequence[Windows], how: Preparation) -> SettledPreparation:
    """Return the preparation for logs, from windows of each."""
    band = _choose_band(robot, logs, how.cutoff)
    own = {"cutoff": band.cutoff, "outputs": how.outputs or band.outputs, "band": band}
    return SettledPreparation(**{**vars(how), **own})


def _is_filtered(log: Log, how: Preparation) -> bool:
    """Return whether derivatives of a log are computed after a low-pass."""
    have = {"dq", "ddq"} <= set(log.channels)
    return how.derivatives == "butterworth" or (how.derivatives == "auto" and not have)


def _choose_band(robot: Robot, logs: Sequence[Windows], cutoff: float | None) -> Band:
    """Return the band of what is differentiated."""
    spectra: list[Spectrum] = []
    for raw in logs:
        windows = [joint_log(robot, w) for w in raw.even(RULES.gap_bridged / RULES.cutoff_lowest)]
        source, order = ([w.q for w in windows], 2)
        if windows[0].dq is not None:
            source, order = [w.dq for w in windows if w.dq is not None], 1
        spectra += spectra_of(source, raw.gaps.step, order)
    return choose_band(spectra, [robot.is_prismatic(int(k)) for k in robot.actuated], cutoff)


def make_plan(robot: Robot, log: Log, how: Preparation) -> Plan:
    """Decide how a log is prepared.

    Raises
    ------
    LogError
        If the log does not fit the robot or what is asked for.
    """
    filtered = _is_filtered(log, how)
    raw = Windows.of(log, mend=filtered)
    windows, stale = [joint_log(robot, w) for w in raw.logs], raw.stale
    notes: list[str] = []
    if has_motors(robot, raw.logs[0]):
        notes.append("motor positions and torques were converted to the joint side")
    check_units(robot, windows)
    if not (log.torque or log.motion_alone or robot.base is not None):
        raise LogError(
            f"{log.name}: all torques are zero; nothing was measured, check the columns."
        )
    if filtered and how.cutoff is None:
        how = _settle(robot, [raw], how)
    plan = _plan_motion(robot, log, raw, how)
    if plan.cutoff is None and plan.series is None:
        plan = replace(plan, smoothing=_choose_smoothing(windows, plan.step))
    if stale is not None:
        notes += [stale.note] if stale.note else []
    if len(windows) > 1:
        notes.append(
            f"what holds for the whole log was decided on {len(windows)} windows of "
            f"{signals.WINDOW} samples, evenly spaced in time"
        )
    if robot.known_torque:
        known = "; ".join(k.text for k in robot.known_torque)
        notes.append(f"known torque was taken off the measured one: {known}")
    if robot.torque.compensated:
        notes.append(
            "what holds the weight by the file was added to the measured torque, which lacks it "
            "(compensated): what gravity tells of masses is the file's"
        )
    plan = replace(plan, factor=_choose_factor(plan, how), stale=stale)
    if plan.cutoff is not None and robot.base is None:  # a base's own sensor is not low-passed
        spare = RULES.cutoff_highest / (plan.cutoff * plan.step)
        plan = replace(plan, spare=int(spare * (1 + ROUNDOFF)))
    dwells = None
    if not how.keep_rest:
        stays = Stays.of(plan, windows, raw.origins)
        stands = how.stands if isinstance(how, SettledPreparation) else None
        stands = ever_stand([stays]) if stands is None else stands
        # What friction does as a joint turns, a rollout does, too, and calibrated torque lacks.
        dwells = stays.rule().masking(stands and not of_commands(log))
    return replace(plan, dwells=dwells, notes=(*plan.notes, *notes))


def _find_stays(robot: Robot, log: Log, raw: Windows, how: Preparation) -> Stays:
    """Return how long joints of a log stay about zero speed."""
    plan = _plan_motion(robot, log, raw, how)
    return Stays.of(plan, [joint_log(robot, w) for w in raw.logs], raw.origins)


def _plan_motion(robot: Robot, log: Log, raw: Windows, how: Preparation) -> Plan:
    """Return how the motion of a log is derived, gap by gap."""
    return plan_gaps(_plan_derivatives(robot, log, raw.gaps, how), raw.gaps, len(log))


def _plan_derivatives(robot: Robot, log: Log, gaps: Gaps, how: Preparation) -> Plan:
    have = {"dq", "ddq"} <= set(log.channels)
    if how.derivatives == "given" and not have:
        raise LogError(
            f"{log.name} does not have '<joint>.dq' and '<joint>.ddq' for every joint; add them, "
            "or let the derivatives be computed (derivatives = auto)."
        )
    plan = Plan(gaps.step, None, None, float(log.clock.first), None, 1, ())
    if have and how.derivatives in ("auto", "given"):
        return replace(plan, notes=("velocity and acceleration are the log's own",))
    if how.derivatives == "fourier":
        return _plan_series(robot, log, plan, how)
    return _plan_filter(log, gaps, plan, how)


def _plan_filter(log: Log, gaps: Gaps, plan: Plan, how: Preparation) -> Plan:
    dt, jitter, cutoff = gaps.step, "", how.cutoff
    if gaps.jitter > RULES.clock_rounded:
        jitter = f" (time stamps jitter by {100 * gaps.jitter:.0f} % of a step; taken as even)"
    assert cutoff is not None
    if how.outputs is not None:  # chosen for logs of which some are sampled faster
        cutoff = max(how.outputs, min(cutoff, RULES.cutoff_highest / dt))
    lowest = 1.0 / (log.clock.last - log.clock.first)
    if not lowest <= cutoff < 0.5 / dt:
        raise LogError(
            f"The cut-off {cutoff:g} Hz does not lie between one over the length of {log.name} "
            f"({lowest:.3g} Hz) and half its sampling rate ({0.5 / dt:g} Hz)."
        )
    source = "given velocities" if "dq" in log.channels else "positions"
    band = how.band if isinstance(how, SettledPreparation) else None
    outputs = how.outputs or cutoff
    kept = f", and torque is kept up to {outputs:.3g} Hz" if outputs != cutoff else ""
    reason = f" ({band.reason})" if band and band.reason else ""
    note = (
        f"velocity and acceleration are derivatives of the {source} after a zero-phase "
        f"4th-order Butterworth low-pass at {cutoff:.3g} Hz{kept}{reason}{jitter}"
    )
    return replace(plan, step=dt, cutoff=cutoff, band=outputs, notes=(note,))


def _plan_series(robot: Robot, log: Log, plan: Plan, how: Preparation) -> Plan:
    count = 2 * how.harmonics + 1
    if 2 * count > len(log):
        raise LogError(
            f"{log.name} has {format_count(len(log), 'sample')}, too few for the "
            f"{count} coefficients of {how.harmonics} harmonics; give fewer harmonics."
        )
    low, high = 4 * how.harmonics * plan.step, 2 * (log.clock.last - log.clock.first)
    if how.period is not None and not low <= how.period <= high:
        raise LogError(
            f"The period {how.period:g} s does not fit {log.name}: with {how.harmonics} harmonics "
            f"it must lie between {low:.4g} s (its sampling) and {high:.4g} s (its length)."
        )
    if log.long:
        raise too_long(log.name)
    own = joint_log(robot, log)
    period = how.period or fourier.find_period(own.t - plan.start, own.q, how.harmonics)
    fit = fourier.fit_fourier(own.t - plan.start, own.q, period, how.harmonics, own.dq, own.ddq)
    left = float(np.sqrt(np.mean((fit.motion(own.t - plan.start)[0] - own.q) ** 2)))
    words = [WORDS[c] for c in ("q", "dq", "ddq") if c in log.channels]
    fitted = " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
    note = (
        f"{fitted} were fitted by a Fourier series of {how.harmonics} harmonics with period "
        f"{period:.6g} s (rms residual {left:.2g}) and differentiated analytically"
    )
    return replace(plan, series=fit, notes=(note,))


def _choose_smoothing(windows: Sequence[Log], dt: float) -> Smoothing | None:
    """Return how measured velocities are smoothed, for their signs."""
    speeds = [w.dq for w in windows if w.dq is not None]
    return Smoothing.choose(speeds, dt) if len(speeds[0]) > SHORT else None


def _choose_factor(plan: Plan, how: Preparation) -> int:
    """Return the decimation asked for, or the one that suits the cut-off."""
    if how.decimate is not None:
        return how.decimate
    if plan.band is None:
        return 1
    factor = max(1, int(0.5 / (plan.band * plan.step)))
    return factor - factor % max(1, factor // signals.DENSE)  # for `Decimation.every`
