"""The registry of data-quality checks: the input, the order and the consequence of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from enum import StrEnum
from functools import cached_property
from typing import Any, TypeAlias, TypeVar

import numpy as np

from identifiability.effects.nominal import has_masses, rigid_torque
from identifiability.foundation.findings import Finding, sentences
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.commands import of_commands
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.dataset import Dataset, join_motions
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Motion, Robot

#: It returns findings on `MeasuredLogs`, none for sound logs. A correction returns the `RawLogs`
#: after its change, with its findings.
Find: TypeAlias = Callable[..., Any]

#: A log after a correction, with its findings.
Mended = tuple[Log, list[Finding]]

F = TypeVar("F", bound=Find)


class Does(StrEnum):
    """The consequence of a check's finding."""

    MENDS = "logs are repaired when they are read, and the repair is reported"
    MISREADS = "columns have a wrong name, unit or sign: no verdict is given"
    EXPLAINS = "all other contradictions of physics follow from it, and are not reported"
    HINTS = "it is reported"
    WEIGHS = "rows have less weight in the fit. This is reported if it moves a value"


@frozen
class Check:
    """A data-quality check.

    Attributes
    ----------
    key : str
        Key of its sentences in `findings.toml`. The order of keys there is the order of
        corrections, of explanations, and of all other findings.
    does : Does
    find : callable(MeasuredLogs) -> iterable of Finding, or callable(RawLogs) -> RawLogs
    always : bool
        Whether it always runs. Its findings concern the robot file, or all logs together.
    """

    key: str
    does: Does
    find: Find
    always: bool = False

    @property
    def rank(self) -> int:
        """Its place among the sentences; a check without any comes last."""
        return [*sentences(), self.key].index(self.key)


#: All checks, in their order.
CHECKS: list[Check] = []


def check(key: str, does: Does, *, always: bool = False) -> Callable[[F], F]:
    """Register a check; parameters as in `Check`.

    Example
    -------
    ::

        @check("brake", Does.HINTS)
        def find_brake(logs):
            dragging = ...
            return [Finding("brake", joints=dragging)] if dragging else []
    """

    def decorate(find: F) -> F:
        CHECKS.append(Check(key, does, find, always))
        CHECKS.sort(key=lambda one: one.rank)
        return find

    return decorate


# Logs during reading: correctable faults are corrected.


@frozen
class RawLogs:
    """Logs that are being read.

    Attributes
    ----------
    fitted, held_out : tuple of Log
    how : Preparation or None
        How they will be prepared.
    torque : callable(logs) -> logs, or None
        Computes torque from commands, for logs without torque.
    hints : tuple of Finding
        Findings on corrections.
    """

    fitted: tuple[Log, ...]
    held_out: tuple[Log, ...]
    how: Preparation | None = None
    torque: Callable[[list[Log]], list[Log]] | None = None
    hints: Strings = ()

    @property
    def every(self) -> list[Log]:
        """All logs, the fitted ones first."""
        return [*self.fitted, *self.held_out]

    def having(self, every: Iterable[Log], hints: Iterable[str] = ()) -> RawLogs:
        """Return a copy with other logs of the same number, and with further hints."""
        logs = tuple(every)
        n = len(self.fitted)
        return replace(
            self,
            fitted=logs[:n],
            held_out=logs[n:],
            hints=(*self.hints, *hints),
        )

    def each(self, mend: Callable[[Log], Mended]) -> RawLogs:
        """Return the logs after a correction of each."""
        pairs = [mend(log) for log in self.every]
        return self.having((log for log, _ in pairs), (x for _, found in pairs for x in found))


def mend_each(key: str) -> Callable[[F], F]:
    """Register a correction of single logs: it returns a log and its findings."""

    def decorate(change: F) -> F:
        check(key, Does.MENDS)(lambda logs: logs.each(change))
        return change

    return decorate


def mend(logs: RawLogs) -> RawLogs:
    """Return logs with all corrections of the registry, and a finding for each."""
    for one in CHECKS:
        if one.does is Does.MENDS:
            logs = one.find(logs)
    return logs


# Prepared logs: measured columns, and the predictions of the robot file.


#: Samples, spread over all logs, at which measured torque is compared with the file's.
ENOUGH = 1000


@frozen
class MeasuredLogs:
    """Logs as they were measured, and the same prepared.

    Attributes
    ----------
    structure : Structure
    recordings : tuple of Log
        As they were measured.
    samples : tuple of Dataset
        The same prepared, in the same order.
    columns : Regression or None
        Columns of the base parameters along them, if they were computed already.
    """

    structure: Structure
    recordings: tuple[Log, ...]
    samples: tuple[Dataset, ...]
    columns: Regression | None = None

    @cached_property
    def regression(self) -> Regression:
        """Columns of the base parameters along the prepared logs."""
        return self.columns or self.structure.regression(self.samples)

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.structure.robot

    @property
    def joints(self) -> Strings:
        """Its actuated joints."""
        return self.robot.joints

    @cached_property
    def measured(self) -> list[Log]:
        """Rows as recorded, of logs whose torque was measured; some windows of long logs.

        Their columns are those of `Log.joints`, without axes of a floating base.
        """
        return [log.shown for log in self.recordings if not of_commands(log)]

    @cached_property
    def _thinned(self) -> tuple[Motion, Array]:
        # Torque of drives alone is compared with no bodies.
        whole = [s for s in self.samples if not s.motion.drives_alone]
        each = max(1, ENOUGH // len(whole))
        few = [s.thin(max(1, s.survey.kept // each)) for s in whole]
        return join_motions([s.motion for s in few]), np.concatenate([s.tau for s in few])

    @property
    def motion(self) -> Motion:
        """Some samples of all logs."""
        return self._thinned[0]

    @property
    def torque(self) -> Array:
        """Measured torque at them, (N, n) [N·m or N]."""
        return self._thinned[1]

    @cached_property
    def weighs(self) -> bool:
        """Return whether the robot file states masses to compare with."""
        return has_masses(self.robot)

    @cached_property
    def predicted(self) -> Array:
        """Rigid-body torque by the file's masses at the same samples, (N, n)."""
        return rigid_torque(self.robot, self.motion)

    @cached_property
    def stated(self) -> Array:
        """Return the torque by all values of the file, with friction and rotors, (N, n).

        It is NaN at joints without a drive in the file.
        """
        structure = self.structure
        W = structure.model.regressor(self.robot, self.motion)
        tau = W @ structure.nominal
        drives = [n for n, x in zip(structure.columns, structure.nominal, strict=True) if x > 0]
        known = [any(n.startswith(f"{j}.") for n in drives) for j in self.joints]
        return np.where(known, tau, np.nan)

    def ordinary(self, joint: int) -> Array:
        """Return the columns of any drive at a joint: friction, rotor inertia, offset, (N, 4)."""
        v = self.motion.actuated_v[:, joint]
        a = self.motion.actuated_a[:, joint]
        return np.column_stack([np.ones(len(v)), v, np.sign(v), a])


def without(x: Array, known: Array) -> Array:
    """Return the residual of x (N, …) after projection on known columns (N, k)."""
    size = np.linalg.norm(known, axis=0)
    Q, R = np.linalg.qr(known / np.where(size > 0, size, 1.0))
    kept = np.abs(np.diag(R)) > ROUNDOFF
    Q = Q[:, kept]
    return x - Q @ (Q.T @ x)


@frozen
class Oddities:
    """The data-quality problems of logs.

    Attributes
    ----------
    hints : tuple of Finding
    explains : bool
        Whether the first of them explains all other contradictions.
    misread : bool
        Whether columns have the wrong sign, unit or joint, so that the values are those of another
        robot.
    """

    hints: Strings = ()
    explains: bool = False
    misread: bool = False


def find_oddities(logs: MeasuredLogs, *, explained: bool = False) -> Oddities:
    """Return the data-quality problems of logs; one explanation is enough, if none is known.

    Checks for wrong columns run in any case.
    """
    beside = [x for c in CHECKS if c.does is Does.HINTS and not c.always for x in c.find(logs)]
    # Torque that servos made of commands has no column that could be another one.
    commanded = any(map(of_commands, logs.recordings))
    kinds = (Does.MISREADS,) if explained else (Does.MISREADS, Does.EXPLAINS)
    asked = [] if commanded else [c for c in CHECKS if c.does in kinds]
    found = ((c, [*c.find(logs)]) for c in asked)
    which, first = next((pair for pair in found if pair[1]), (None, ()))
    misread = which is not None and which.does is Does.MISREADS
    return Oddities((*first, *beside), bool(first), misread)


def find_always(logs: MeasuredLogs) -> Strings:
    """Return the problems of the robot file and of all logs together, in every case."""
    return tuple(text for c in CHECKS if c.always for text in c.find(logs))
