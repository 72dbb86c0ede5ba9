"""From `Log` to `Samples`, and from `LogFile` to `LongSamples`.

A log that does not fit in memory is prepared anew for each pass.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field, replace
from functools import reduce
from itertools import pairwise
from operator import add

import numpy as np

from identifiability.foundation.engines.mapping import Engine, Steps
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.options import checked
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.log import join_logs
from identifiability.logs.logfile import LogFile
from identifiability.logs.prepare.plan import Plan, joint_log
from identifiability.logs.prepare.preparation import Preparation, make_plan
from identifiability.logs.prepare.samples import (
    Piece,
    Samples,
    Survey,
    check_left,
    join_motions,
    prepare_rows,
)
from identifiability.logs.rules import RULES
from identifiability.logs.tables import is_parquet
from identifiability.robot import KnownRobot, Motion, Robot, complete_motion

#: Samples that are prepared at a time, at least; and in units of what filters draw on.
PIECE, MARGINS = 8_192, 4

#: Stretches that a log is divided into, at most, and the fewest samples of one.
STRETCHES, SHORTEST = 64, 65_536


@frozen
class Stretch:
    """Consecutive rows of a long log and all that it takes to prepare them: one task of a pass.

    Attributes
    ----------
    robot : Robot
    file : LogFile
    plan : Plan
    first, last : int
        Rows [first, last).
    piece : int
        Samples that are prepared at a time.
    outputs : int
        Samples after decimation; -1 before they were counted.
    """

    robot: Robot
    file: LogFile
    plan: Plan
    first: int
    last: int
    piece: int
    outputs: int = -1

    def parts(self) -> Iterator[Samples]:
        """Yield the rows prepared, some thousand at a time.

        Raises
        ------
        LogError
            If the file changed meanwhile.
        """
        rows, reach = (self.first, self.last), self.plan.reach
        for first, last, origin, log in self.file.overlapping(*rows, self.piece, reach):
            own = (first, last)
            yield prepare_rows(self.robot, log, origin, self.plan, own, anywhere=False)

    def pieces(self, size: int) -> Iterator[Piece]:
        """Yield pieces of about `size` samples of the motion."""
        for part in self.parts():
            yield from part.pieces(size)


@frozen
class LongSamples:
    """A prepared log that is read and prepared again whenever it is gone through.

    Attributes
    ----------
    name : str
    stretches : tuple of Stretch
    survey : Survey
    sketch : Samples
        Some of its samples, evenly spaced, without decimation.
    notes : tuple of str
    sha256 : str
    hints : tuple of str
        What seems to be wrong with the log.
    path : str
        As of the log.
    """

    name: str
    stretches: tuple[Stretch, ...]
    survey: Survey
    sketch: Samples = field(repr=False)
    notes: tuple[str, ...]
    sha256: str
    hints: tuple[str, ...] = ()
    path: str = ""

    @property
    def outputs(self) -> int:
        """Number of samples after decimation."""
        return self.survey.outputs

    @property
    def starts(self) -> tuple[int, ...]:
        """The outputs with which a stretch begins: the first, and those behind a long gap."""
        grid = self.stretches[0].plan.grid
        if grid is None:
            return (0,)
        before = np.cumsum([0, *(s.outputs for s in self.stretches)])
        at = [b for s, b in zip(self.stretches, before, strict=False) if s.first in grid.breaks]
        return (0, *(int(k) for k in np.unique(at) if 0 < k < before[-1]))

    @property
    def decimation(self) -> signals.Decimation | None:
        """Applied alike to regressor and torque."""
        return self.stretches[0].plan.decimation

    @property
    def cutoff(self) -> float | None:
        """Low-pass of computed derivatives [Hz]; None where there is none."""
        return self.stretches[0].plan.cutoff

    @property
    def band(self) -> float | None:
        """Up to where torque and regressor are kept beside computed derivatives [Hz]."""
        return self.stretches[0].plan.band

    def pieces(self, size: int) -> Iterator[Piece]:
        """Yield pieces of about `size` samples of the motion."""
        for stretch in self.stretches:
            yield from stretch.pieces(size)

    def thin(self, step: int) -> Samples:
        """Return about every `step`-th sample, of those that are kept; without decimation."""
        rows = self.stretches[-1].last
        return self.sketch.thin(max(1, round(step * len(self.sketch.tau) / rows)))


#: A log ready for the regression, in memory or not.
Prepared = Samples | LongSamples


@checked
def prepare_samples(robot: KnownRobot, log: Log, how: Preparation | None = None) -> Samples:
    """Turn a log into samples: pick the joints, make derivatives, close the loops.

    Raises
    ------
    LogError, ClosureError
    """
    how = how or Preparation()
    plan = make_plan(robot, log, how)
    samples = prepare_rows(robot, log, 0, plan, (0, len(log)))
    notes = _check_survey(robot, samples.survey, plan, log)
    while plan.factor > 1 and samples.outputs < RULES.fewest:
        if how.decimate is not None:
            raise _too_short(log, plan)
        plan = replace(plan, factor=plan.factor - 1)
        samples = replace(samples, decimation=plan.decimation)
    return replace(samples, notes=(*notes, *plan.band_notes), own=None)


def prepare_log(
    robot: Robot,
    log: Log | LogFile,
    how: Preparation | None = None,
    *,
    engine: Engine,
    progress: Steps | None = None,
) -> Prepared:
    """Turn a log into samples, in memory or, for a file, ready to be read again and again.

    Parameters
    ----------
    robot : Robot
    log : Log or LogFile
    how : Preparation, optional
    engine : Engine
        Where the parts of a file are surveyed.
    progress : callable(int, int), optional

    Raises
    ------
    LogError, ClosureError
    """
    if isinstance(log, Log):
        return prepare_samples(robot, log, how)
    plan = make_plan(robot, log, how or Preparation())
    stretches = divide(robot, log, plan)
    if robot.closed:
        _try_loops(robot, log)
    found = list(engine.map(survey_stretch, stretches, progress=progress))
    survey = reduce(add, (s for s, *_ in found))
    notes = _check_survey(robot, survey, plan, log)
    if survey.outputs < RULES.fewest:
        raise _too_short(log, plan)
    motion = join_motions([m for _, m, *_ in found if len(m)])
    tau = np.concatenate([tau for _, _, tau, _ in found])
    dwells = None if plan.dwells is None else np.concatenate([d for *_, d in found])
    return LongSamples(
        name=log.name,
        stretches=tuple(
            replace(s, outputs=part.outputs) for s, (part, *_) in zip(stretches, found, strict=True)
        ),
        survey=survey,
        sketch=Samples(log.name, motion, tau, None, (), log.sha256, dwells=dwells),
        notes=(*notes, *plan.band_notes),
        sha256=log.sha256,
        hints=plan.hints,
        path=log.path,
    )


def _check_survey(robot: Robot, survey: Survey, plan: Plan, log: Log | LogFile) -> list[str]:
    """Return what there is to say of a prepared log; refuse one of which nothing is left."""
    notes = [*plan.notes, *survey.notes(len(log)), *survey.dwells(robot.joints)]
    check_left(log.name, survey.kept, len(log), notes)
    return [*notes, *plan.remarks]


def _too_short(log: Log | LogFile, plan: Plan) -> LogError:
    return LogError(
        f"{log.name} is too short to be decimated by {plan.factor}: of its {len(log)} samples "
        f"fewer than {RULES.fewest} are left; give a longer log or a smaller decimation."
    )


def divide(robot: Robot, file: LogFile, plan: Plan) -> tuple[Stretch, ...]:
    """Return the stretches of a log; they depend on the file alone, not on who works on them."""
    rows = len(file)
    most = STRETCHES
    if is_parquet(file.table.path):
        # Rows inside a group are reached by reading all that come before them.
        groups = [row for row, _ in file.table.pieces]
        # Times a log that may be read to reach the rows of its stretches, before these
        # become fewer.
        if max(b - a for a, b in pairwise(groups)) * STRETCHES > 4 * rows:
            most = max(8, min(STRETCHES, 2 * (len(groups) - 1)))
    count = min(most, max(1, rows // SHORTEST))
    edges = np.linspace(0, rows, count + 1).astype(int).tolist()
    if plan.grid is not None:
        edges = sorted({*edges, *plan.grid.breaks.tolist()})
    piece = max(PIECE, MARGINS * plan.reach)
    return tuple(Stretch(robot, file, plan, a, b, piece) for a, b in pairwise(edges))


def survey_stretch(stretch: Stretch) -> tuple[Survey, Motion, Array, np.ndarray]:
    """Return the survey of a stretch, and motion, torque and dwells of some of its samples."""
    # Samples of the whole log that are kept, evenly spaced.
    step = max(1, len(stretch.file) // 4096)
    surveys, motions, taus, dwells = [], [], [], []
    for part in stretch.parts():
        assert part.own is not None
        surveys.append(part.survey)
        kept = part.motion.kept
        shown = (kept % step == 0) & (kept >= part.own[0]) & (kept < part.own[1])
        motions.append(part.motion[np.flatnonzero(shown)])
        taus.append(part.tau[shown])
        some = np.zeros(part.tau.shape, bool) if part.dwells is None else part.dwells
        dwells.append(some[shown])
    found = reduce(add, surveys), join_motions(motions)
    return *found, np.concatenate(taus), np.concatenate(dwells)


def _try_loops(robot: Robot, file: LogFile) -> None:
    """Raise the error of loops that close nowhere before a long time is spent on it."""
    middles = [(a + b) // 2 for a, b in signals.spread_windows(len(file))]
    # Samples in the middle of each window whose loops are tried first.
    log = joint_log(robot, join_logs([file.rows(m, m + 64) for m in middles]))
    complete_motion(robot, log.t, log.q, 0 * log.q, 0 * log.q)
