"""The one list of data-quality checks: what each looks at, and what follows from what it says."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import StrEnum
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from identifiability.effects.nominal import gravity_torque, has_masses, rigid_torque
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare.dataset import Dataset, join_motions
from identifiability.regression.structure import Structure
from identifiability.robot import Motion, Robot

# `MeasuredLogs`: what the finders of oddities look at: raw columns, and what the file predicts.


#: Samples, spread over all logs, at which measured torque is compared with the file's.
ENOUGH = 1000

#: Samples at which the bodies' weights are taken one by one.
FEW = 100


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
    """

    structure: Structure
    recordings: tuple[Log, ...]
    samples: tuple[Dataset, ...]

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.structure.robot

    @property
    def joints(self) -> tuple[str, ...]:
        """Its actuated joints."""
        return self.robot.joints

    def windows(self) -> Iterator[tuple[int, Log]]:
        """Yield the columns of every log as they were measured, and the row they begin at.

        Long logs are looked at in the windows that decisions about them are made on.
        """
        for log in self.recordings:
            yield from log.windows()

    @cached_property
    def _thinned(self) -> tuple[Motion, Array, np.ndarray]:
        each = max(1, ENOUGH // len(self.samples))
        few = [s.thin(max(1, s.survey.kept // each)) for s in self.samples]
        tau, weight = (np.concatenate([getattr(s, k) for s in few]) for k in ("tau", "weight"))
        return join_motions([s.motion for s in few]), tau, weight > 0

    @cached_property
    def measured(self) -> np.ndarray:
        """At which joints there is torque that is data, (n,) bool."""
        found: np.ndarray = np.sum([s.survey.rows for s in self.samples], axis=0) > 0
        return found

    @property
    def motion(self) -> Motion:
        """Some samples of all logs."""
        return self._thinned[0]

    @property
    def torque(self) -> Array:
        """Measured torque at them, (N, n) [N·m or N]."""
        return self._thinned[1]

    @property
    def data(self) -> np.ndarray:
        """Where it is data, (N, n) bool."""
        return self._thinned[2]

    @cached_property
    def weighs(self) -> bool:
        """Whether the robot file states masses to compare with."""
        return has_masses(self.robot)

    @cached_property
    def predicted(self) -> Array:
        """Rigid-body torque by the file's masses at the same samples, (N, n)."""
        return rigid_torque(self.robot, self.motion)

    @cached_property
    def gravity(self) -> Array:
        """The part of it that holds the weight, (N, n)."""
        return gravity_torque(self.robot, self.motion, self.robot.gravity)

    @cached_property
    def stated(self) -> Array:
        """Torque by every value that the file states, friction and rotors too, (N, n).

        NaN at joints whose drive the file says nothing of.
        """
        structure = self.structure
        W = structure.model.regressor(self.robot, self.motion)
        tau: Array = W @ structure.nominal
        drives = [n for n, x in zip(structure.columns, structure.nominal, strict=True) if x > 0]
        known = [any(n.startswith(f"{j}.") for n in drives) for j in self.joints]
        return np.where(known, tau, np.nan)

    def ordinary(self, joint: int) -> Array:
        """Return what any drive adds at a joint: friction, rotor inertia, offset, (N, 4)."""
        v, a = self.motion.actuated_v[:, joint], self.motion.actuated_a[:, joint]
        return np.column_stack([np.ones(len(v)), v, np.sign(v), a])


def without(x: Array, known: Array) -> Array:
    """Return what is left of x (N, …) when known columns (N, k) are projected out."""
    size = np.linalg.norm(known, axis=0)
    Q, R = np.linalg.qr(known / np.where(size > 0, size, 1.0))
    kept = np.abs(np.diag(R)) > ROUNDOFF
    Q = Q[:, kept]
    left: Array = x - Q @ (Q.T @ x)
    return left


def unexplained(W: Array, tau: Array) -> float:
    """Return what a regressor (m, n, p) and offsets leave of torque (m, n), as a share."""
    m, n, p = W.shape
    if m * n < 2 * (p + n):
        return 0.0
    A = (W - W.mean(0)).reshape(m * n, p)
    b = (tau - tau.mean(0)).reshape(-1)
    length = np.linalg.norm(A, axis=0)
    A = A[:, length > 0] / length[length > 0]
    square, V = np.linalg.eigh(A.T @ A)
    kept = square > ROUNDOFF * square[-1]
    fit = (V[:, kept].T @ (A.T @ b)) / np.sqrt(square[kept])
    size, explained = float(b @ b), float(fit @ fit)
    return float(max(1.0 - explained / size, 0.0) ** 0.5)


#: Returns sentences that name the column and the remedy, none for sound logs, of `MeasuredLogs`;
#: what mends returns logs that are being read with these sentences (`mends.Reading`).
Find: TypeAlias = Callable[[Any], Any]


class Does(StrEnum):
    """What follows from what a check says."""

    MISREADS = "columns are read as what they are not: no verdict stands"
    EXPLAINS = "whatever else contradicts physics follows from it, and is not said"
    HINTS = "it is said"
    MENDS = "it is mended when logs are read, and said"


@frozen
class Check:
    """A data-quality check.

    Attributes
    ----------
    title : str
        What it looks for.
    does : Does
    find : callable(MeasuredLogs) -> tuple of str, or callable(Reading) -> Reading
    rank : float
        Of two explanations the one of lower rank is given; hints are said in this order.
    always : bool
        Whether it also looks at logs that have nothing to explain; what it says is of the robot
        file, or of all logs together.
    says, means, do : str
        How its sentence begins (… is what changes from log to log), what that means, and the
        remedy, for the page of messages.
    """

    title: str
    does: Does
    find: Find
    rank: float
    always: bool = False
    says: str = ""
    means: str = ""
    do: str = ""


#: All checks, by rank.
CHECKS: list[Check] = []


def check(
    title: str,
    does: Does,
    rank: float,
    *,
    always: bool = False,
    says: str = "",
    means: str = "",
    do: str = "",
) -> Callable[[Find], Find]:
    """Register a check; parameters as in `Check`.

    Example
    -------
    ::

        @check("a brake that stays on", Does.HINTS, 90)
        def find_brake(logs):
            dragging = ...
            return (f"{listing(dragging)} drags: release its brake, and log anew.",)
    """

    def decorate(find: Find) -> Find:
        CHECKS.append(Check(title, does, find, rank, always, says, means, do))
        CHECKS.sort(key=lambda one: one.rank)
        return find

    return decorate
