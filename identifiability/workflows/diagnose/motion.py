"""The motion of a diagnosis: what is fitted, what chooses, what verifies, and how much of it.

An error that was minimised, be it by a fit or by the choice of a name, is no evidence. The motion
on which the gap is quoted therefore does neither. Whole logs are kept apart where there are
enough; else a log is divided into stretches of time, with a pause between that nobody looks at.
A diagnosis asks few rows many questions, so long logs are looked at in evenly spaced stretches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.values import frozen
from identifiability.logs import Log, checks, signals
from identifiability.logs.prepare import Preparation, Samples
from identifiability.logs.prepare.longsamples import prepare_samples
from identifiability.logs.prepare.preparation import make_plan
from identifiability.logs.prepare.samples import check_left, join_motions
from identifiability.logs.prepare.samples import prepare_rows as prepare_stretch
from identifiability.logs.repeats import Recording
from identifiability.logs.spectrum import HIGHEST, LOWEST_CUTOFF, WIDE, bandwidth_of_windows
from identifiability.robot import Robot

#: Stretches that a held-out log is divided into, in turn to choose and to verify.
TURNS = 4
#: A new log in two.
HALVES = (0.0, 0.5, 1.0)
#: What follows the name of a log in that of a part of it.
PART = ", part "
#: Share of a log that verifies where there is no other.
LAST = 0.25
#: Share of a stretch that is left out at each of its inner ends.
PAUSE = 0.05
#: Samples that a stretch must have.
LEAST = 100
#: Samples after decimation that a diagnosis looks at in one log, and in all that are fitted; more
#: are thinned to stretches.
MOST_SAMPLES, MOST_IN_ALL = 6000, 8000
STRETCH = 300
#: Samples of a long log that are read for each of these: of one that is logged far faster than the
#: robot moves fewer are looked at, so that neither time nor memory grow without end.
READ = 40


@frozen
class Roles:
    """Logs by what they are for.

    Attributes
    ----------
    fit : tuple of Log
        What the model is fitted to and the evidence is from.
    choose : tuple of Log
        What judges during the search; none where fitted motion is left out in turn.
    verify : tuple of Log
        What the gap is measured on, and nothing else.
    chosen_by, verified_on : str
        Both in words, to follow "chosen" and "on".
    """

    fit: tuple[Recording, ...]
    choose: tuple[Recording, ...]
    verify: tuple[Recording, ...]
    chosen_by: str
    verified_on: str


def assign_roles(logs: Sequence[Recording], validate: Sequence[Recording]) -> Roles:
    """Return the roles of fitted and held-out logs.

    Several fitted logs choose by leaving one out in turn, and every held-out log verifies. A
    single fitted log needs help to choose: of several held-out logs the first one chooses, a
    single one is divided. Without held-out logs the last log is set aside, or the last part of
    the only one.

    Parameters
    ----------
    logs : sequence of Log
    validate : sequence of Log

    Raises
    ------
    LogError
        If the only log is too short to be divided.
    """
    logs, validate = list(logs), list(validate)
    aside = ""
    if not validate and len(logs) == 1:
        return _one_log(logs[0])
    if not validate:
        *logs, last = logs
        validate, aside = [last], ", which was set aside"
    choose, verify, chosen_by = [], validate, "by leaving out one fitted log at a time"
    verified_on = f"{join([log.name for log in validate])}{aside}"
    if len(logs) == 1 and len(validate) > 1:
        choose, verify = validate[:1], validate[1:]
        chosen_by = f"on {validate[0].name}"
        verified_on = join([log.name for log in verify])
    elif len(logs) == 1 and len(validate[0]) < TURNS * LEAST:
        chosen_by = "by leaving out one stretch of the fitted log at a time"
    elif len(logs) == 1:
        parts = divide(validate[0], np.linspace(0, 1, TURNS + 1))
        choose, verify = parts[::2], parts[1::2]
        odd, even = (join([str(k + 1) for k in range(start, TURNS, 2)]) for start in (0, 1))
        chosen_by = f"on quarters {odd} of {validate[0].name}"
        verified_on = f"quarters {even} of {verified_on}"
    return Roles(tuple(logs), tuple(choose), tuple(verify), chosen_by, verified_on)


def _one_log(log: Recording) -> Roles:
    if len(log) < LEAST / LAST:
        raise LogError(
            f"{log.name} has {len(log)} samples, too few to name effects from one part and verify "
            f"them on another; give a log of at least {LEAST / LAST:.0f} samples, or a second one."
        )
    fit, verify = divide(log, [0, 1 - LAST, 1])
    chosen_by = "by leaving out one stretch of the fitted motion at a time"
    verified_on = f"the last {100 * LAST:.0f} % of {log.name}, set aside"
    return Roles((fit,), (), (verify,), chosen_by, verified_on)


def divide(log: Recording, edges: Sequence[float] | np.ndarray) -> list[Recording]:
    """Return stretches of a log between edges (k + 1,) in shares of its samples.

    A pause of `PAUSE` of a stretch is left out on both sides of every inner edge.
    """
    n, out = len(log), []
    cuts = np.asarray(edges, float) * n
    for k, (low, high) in enumerate(pairwise(cuts.tolist())):
        pause = PAUSE * (high - low)
        first = int(np.ceil(low + (pause if low > 0 else 0)))
        last = int(high - (pause if high < n else 0))
        out.append(log.cut(first, last, f"{log.name}{PART}{k + 1}"))
    return out


def halve_new(logs: Sequence[Recording], known: Sequence[str]) -> list[Recording]:
    """Return logs in which a new one, the only one that is not known, is divided into halves.

    What only it shows could not be predicted from the others, and would be refused: so one half of
    it judges the other.

    Parameters
    ----------
    logs : sequence of Log
    known : sequence of str
        Names of logs, or of parts of them, that were fitted before.
    """
    before = {name.partition(PART)[0] for name in known}
    new = [log for log in logs if log.name not in before]
    if len(new) != 1 or len(new[0]) < 2 * LEAST:
        return list(logs)
    return [part for log in logs for part in (divide(log, HALVES) if log in new else [log])]


def join(names: Sequence[str]) -> str:
    """Return ``a, b and c``."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def samples_each(lengths: Iterable[int]) -> int:
    """Return the samples after decimation that are looked at in each fitted log, of such lengths.

    All have an equal share; what short ones leave of it the longer ones have.
    """
    left, logs = MOST_IN_ALL, sorted(lengths)
    for k, length in enumerate(logs):
        share = left // (len(logs) - k)
        if length >= share:
            break
        left -= length
    return max(STRETCH, min(MOST_SAMPLES, share))


def prepare_rows(
    robot: Robot, log: Recording, how: Preparation | None, most: int = MOST_SAMPLES
) -> Samples:
    """Return a log ready for a diagnosis: decimated to its band, thinned if it is very long.

    Measured derivatives do not need a filter, but questions need few rows: torque and columns are
    low-passed alike to ten times the band of the motion.
    """
    windows = [log.rows(a, b) for a, b in signals.spread_windows(len(log))]
    step = float(np.median(np.concatenate([np.diff(w.t) for w in windows])))
    even = log.clock.longest.length < 1.5 * step  # no filter reaches across a gap
    if how is None and even and {"dq", "ddq"} <= set(log.channels):
        band = WIDE * bandwidth_of_windows([w.q for w in windows], step)
        factor = int(0.5 / (min(max(band, LOWEST_CUTOFF), HIGHEST / step) * step))
        # Of a short part of a log enough must be left.
        while factor > 1 and signals.Decimation(factor).outputs(len(log)) < checks.FEWEST:
            factor -= 1
        how = Preparation(decimate=max(factor, 1))
    return prepare_thin(robot, log, how or Preparation(), most=most)


def thin(samples: Samples, most: int = MOST_SAMPLES) -> Samples:
    """Return evenly spaced stretches of samples that are more than a diagnosis needs."""
    if samples.outputs <= most:
        return samples
    windows = _stretches(samples.decimation, len(samples.tau), most)
    rows = np.concatenate([np.arange(a, b) for a, b in windows])
    notes = (*samples.notes, _note(len(windows)))
    return replace(samples.take(rows), notes=notes)


def _stretches(
    decimation: signals.Decimation | None, samples: int, most: int
) -> list[tuple[int, int]]:
    """Return evenly spaced stretches (start, stop) with about `most` outputs in all."""
    length = STRETCH
    if decimation is not None:
        length = STRETCH * decimation.factor + 2 * decimation.reach
    count = max(1, min(most // STRETCH, samples // length))
    starts = np.linspace(0, samples - length, count).astype(int)
    return [(int(s), int(s) + length) for s in starts]


def _note(count: int) -> str:
    return f"{count} stretches of {STRETCH} samples, evenly spaced in time, were looked at"


def prepare_thin(
    robot: Robot,
    log: Recording,
    how: Preparation,
    change: Callable[[Log], Log] = lambda log: log,
    *,
    most: int = MOST_SAMPLES,
) -> Samples:
    """Return a log ready for a diagnosis; of a long one only the stretches looked at are read.

    Parameters
    ----------
    robot : Robot
    log : Log or LogFile
    how : Preparation
    change : callable(Log) -> Log, optional
        Done to the samples first; it may take some away at the end.
    most : int
        Samples after decimation that are looked at.

    Raises
    ------
    LogError, ClosureError
    """
    if isinstance(log, Log):
        return thin(prepare_samples(robot, change(log), how), most)
    plan = make_plan(robot, log, how)
    d = plan.decimation
    most = max(STRETCH, int(most * min(1.0, READ / plan.factor)))
    every = (len(log) if d is None else d.outputs(len(log))) <= most
    windows = [(0, len(log))] if every else _stretches(d, len(log), most)
    edge = plan.filter_reach
    reach = plan.reach - edge
    parts = []
    for first, last in windows:
        origin = max(0, first - edge)
        raw = change(log.rows(origin, min(len(log), last + edge)))
        own = (first + reach, last - reach)
        parts.append(prepare_stretch(robot, raw, origin, plan, own))
    motion = join_motions([p.motion for p in parts])
    tau = np.concatenate([p.tau for p in parts])
    notes = (*plan.notes, *plan.band_notes)
    notes = notes if every else (*notes, _note(len(windows)))
    check_left(log.name, len(motion), sum(b - a for a, b in windows), notes)
    samples = Samples(log.name, motion, tau, plan.decimation, notes, log.sha256)
    dwells = [p.dwells for p in parts if p.dwells is not None]
    samples = replace(samples, dwells=np.concatenate(dwells) if dwells else None)
    return replace(samples, cutoff=plan.cutoff, breaks=parts[0].breaks, hints=plan.hints)
