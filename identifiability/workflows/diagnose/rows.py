"""`Rows`: the regression of a diagnosis after decimation: torque, model columns, dictionary.

A diagnosis asks hundreds of questions of the same few thousand rows, so they are built once:
columns of the base model, then one or more columns for every candidate (family, place, shape).
Most candidates act in one joint: of the columns of an arm five in six entries are zero, and are
neither stored nor filtered. Of motion that only judges few columns are ever looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from identifiability.effects.functions import has_session
from identifiability.estimation.noise import JointRuns, Runs, find_runs
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.regression.columns import Candidate, Entries, Key, compute_entries, pieces_of
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose.known_values import KnownValues, NearFile


@frozen
class Rows:
    """Decimated rows of one or more logs.

    Attributes
    ----------
    tau : (N, n) [N·m or N]
        Torque that the model columns should explain.
    X : (N, n, b)
        Base model, refitted at every step; of a fixed one only values that have errors.
    D : Dictionary
        Columns of the candidates, (N, n, c).
    t : (N,) [s]
    log : (N,) int
        Which log a row comes from.
    runs : sequence of (start, stop)
        Stretches without gaps.
    q, dq, ddq : (N, n)
        Motion of the actuated joints, filtered like the columns.
    measured, raw : (N, n) [N·m or N]
        Measured torque, all of it: filtered like the columns, and as it was measured.
    session : (N,) or None [s]
        Time of the session, where logs share a clock.
    moves : (N, n) bool or None
        Where torque of each joint is data; elsewhere all columns and torque are zero. None where
        all is.
    root : (d, b) or None
        What is known beforehand of the values of the model: observations of zero, each in units of
        its standard deviation. None where nothing is, or they are no question at all.
    """

    tau: Array
    X: Array
    D: Dictionary
    t: Array
    log: np.ndarray
    runs: Runs
    q: Array
    dq: Array
    ddq: Array
    measured: Array
    raw: Array
    root: Array | None = None
    session: Array | None = None
    moves: np.ndarray | None = None

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.tau)

    @property
    def joints(self) -> int:
        """Number of actuated joints."""
        return int(self.tau.shape[1])

    @cached_property
    def data(self) -> np.ndarray:
        """Where torque of each joint is data, (N, n) bool."""
        return np.ones(self.tau.shape, bool) if self.moves is None else self.moves

    @cached_property
    def counts(self) -> np.ndarray:
        """Rows of each joint that are data, one at least, (n,)."""
        rows: np.ndarray = np.maximum(self.data.sum(0), 1)
        return rows

    @property
    def silent(self) -> int:
        """Number of rows of all joints that are no data."""
        return int(self.data.size - self.data.sum())

    @cached_property
    def moving(self) -> JointRuns:
        """Stretches without gaps at which torque of each joint is data."""
        return JointRuns.of(self.runs, self.data)

    def columns(self, chosen: Sequence[Candidate]) -> Array:
        """Return the columns of the model with some candidates, (N, n, b + …)."""
        at = [k for c in chosen for k in c.columns]
        return np.concatenate([self.X, self.D.take(at)], axis=2)

    def along(self, j: int) -> dict[str, Array]:
        """Return what the residual of joint j may depend on, each (N,)."""
        return {
            "velocity": self.dq[:, j],
            "position": self.q[:, j],
            "acceleration": self.ddq[:, j],
            "load": self.measured[:, j],
            "time": self.t,
            "log": self.log,
            **({} if self.session is None else {"session": self.session}),
        }


@frozen
class Table:
    """Rows of some logs to which columns of candidates are added, each computed once.

    Attributes
    ----------
    robot : Robot
    samples : tuple of Samples
    bare : Rows
        Without columns of candidates.
    """

    robot: Robot
    samples: tuple[Samples, ...]
    bare: Rows

    @staticmethod
    def of(
        structure: Structure,
        samples: Sequence[Samples],
        fixed: bool = False,
        known: KnownValues | None = None,
        near: NearFile | None = None,
    ) -> Table:
        """Return the rows of some logs, without candidates; arguments are those of `build_rows`."""
        regression = replace(structure.regression(samples, keep=True), echo=None, instruments=None)
        chunks = [
            (np.full(len(c.tau), c.log), c.W.copy(), c.tau, c.raw, c.data)
            for part in regression.parts()
            for c in part.chunks()
        ]
        log, X, tau, raw, data = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
        target, root = tau, None
        if fixed and known is None:
            target, X = tau - X @ structure.nominal_base, X[:, :, :0]
        elif fixed and known is not None:
            target, X, root = tau - X @ known.values, X[:, :, known.uncertain], known.root
        elif near is not None:
            target, root = tau - X @ near.values, near.root
        D = Dictionary(len(tau), tau.shape[1], 0)
        t = np.concatenate([s.output_times() for s in samples])
        q, dq, ddq = np.split(np.concatenate([_states(s) for s in samples]), 3, axis=1)
        session = None
        if has_session([s.motion for s in samples]):
            session = np.concatenate([s.output_times() + (s.motion.start or 0.0) for s in samples])
        bare = Rows(target, X, D, t, log, find_runs(samples), q, dq, ddq, tau, raw, root)
        return Table(structure.robot, tuple(samples), replace(bare, session=session, moves=data))

    def rows(self, candidates: Sequence[Candidate], *, later: bool = False) -> Rows:
        """Return the rows with the columns of some candidates, by the numbers that these have.

        Parameters
        ----------
        candidates : sequence of Candidate
            Whose columns are those of the dictionary, all of them.
        later : bool
            Whether columns are computed only when they are looked at.
        """
        owner = {k: c for c in candidates for k in c.columns}

        def ask(columns: Sequence[int]) -> Entries:
            wanted = list({id(owner[k]): owner[k] for k in columns}.values())
            self._compute(wanted)
            asked = set(columns)
            return {
                (j, c.columns[k]): x
                for c in wanted
                for (j, k), x in self._known[c.key].items()
                if c.columns[k] in asked
            }

        D = Dictionary(len(self.bare), self.bare.joints, len(owner), ask)
        if not later:
            D.require(range(len(owner)))
        return replace(self.bare, D=D)

    def extend(self, rows: Rows, more: Sequence[Candidate]) -> Rows:
        """Return rows whose dictionary has the columns of further candidates behind its own."""
        self._compute(more)
        D = rows.D
        for c in more:
            D.width = max(D.width, c.columns[-1] + 1)
            for (j, k), x in self._known[c.key].items():
                D.add(j, c.columns[k], x)
        return rows

    def _compute(self, candidates: Iterable[Candidate]) -> None:
        """Compute the columns of candidates that were not asked for before."""
        missing = {c.key: c for c in candidates if c.key not in self._known}
        ends = np.cumsum([0, *(len(c.columns) for c in missing.values())]).tolist()
        parts = [
            (c.part, range(start, start + len(c.columns)))
            for c, start in zip(missing.values(), ends, strict=False)
        ]
        owner = [(key, k) for key, c in missing.items() for k in range(len(c.columns))]
        self._known.update((key, {}) for key in missing)
        for (j, at), x in compute_entries(
            self.robot, parts, [piece for s in self.samples for piece in pieces_of(s)]
        ).items():
            key, k = owner[at]
            self._known[key][j, k] = x

    @cached_property
    def _known(self) -> dict[Key, Entries]:
        """Return what was computed: torque by joint and column among a candidate's own."""
        return {}


def _states(samples: Samples) -> Array:
    """Return position, velocity and acceleration of the actuated joints at the outputs, (N, 3n)."""
    at, m = samples.output_times(), samples.motion
    both = np.concatenate([m.actuated_q, m.actuated_v, m.actuated_a], axis=1)
    return np.stack([np.interp(at, m.t, column) for column in both.T], axis=1)


@frozen
class Block:
    """The columns that act in one joint.

    Attributes
    ----------
    columns : (k,) int
        Rising.
    values : (N, k) [N·m or N per unit]
    """

    columns: np.ndarray
    values: Array


@dataclass
class Dictionary:
    """Columns of candidates along some rows.

    Attributes
    ----------
    rows, joints, width : int
        N, n and the number of columns c.
    ask : callable(columns) -> Entries, optional
        Says what columns are that were not looked at yet, where they act; without it they are zero.
    """

    rows: int
    joints: int
    width: int
    ask: Callable[[Sequence[int]], Entries] | None = None
    _columns: list[dict[int, Array]] = field(init=False)
    _known: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._columns = [{} for _ in range(self.joints)]

    @staticmethod
    def of(columns: Array) -> Dictionary:
        """Return the dictionary of columns (N, n, c) that are there."""
        acts: np.ndarray = np.any(columns, axis=0)

        def ask(asked: Sequence[int]) -> Entries:
            found = [(j, k) for k in asked for j in np.flatnonzero(acts[:, k]).tolist()]
            return {(j, k): columns[:, j, k] for j, k in found}

        N, n, c = columns.shape
        return Dictionary(N, n, c, ask)

    def block(self, joint: int) -> Block:
        """Return all columns that act in a joint."""
        at, own = self.columns(joint), self._columns[joint]
        values = np.empty((self.rows, len(at)))
        for place, k in enumerate(at.tolist()):
            values[:, place] = own[k]
        return Block(at, values)

    def columns(self, joint: int) -> np.ndarray:
        """Return the numbers of all columns that act in a joint, rising."""
        self.require(range(self.width))
        return np.array(sorted(self._columns[joint]), int)

    def acting(self, joint: int, columns: Iterable[int]) -> Array:
        """Return some columns in one joint in their order, (N, k)."""
        at = [*columns]
        self.require(at)
        out, own = np.zeros((self.rows, len(at))), self._columns[joint]
        for place, k in enumerate(at):
            if k in own:
                out[:, place] = own[k]
        return out

    def take(self, columns: Iterable[int]) -> Array:
        """Return some columns in their order, (N, n, k)."""
        at = [*columns]
        self.require(at)
        out = np.zeros((self.rows, self.joints, len(at)))
        for j, own in enumerate(self._columns):
            for place, k in enumerate(at):
                if k in own:
                    out[:, j, place] = own[k]
        return out

    def rms(self) -> Array:
        """Return the root mean square of each column in each joint, (n, c)."""
        self.require(range(self.width))
        out = np.zeros((self.joints, self.width))
        for j, own in enumerate(self._columns):
            for k, x in own.items():
                out[j, k] = np.sqrt(np.mean(x**2))
        return out

    def add(self, joint: int, column: int, values: Array) -> None:
        """Take what a further column is in a joint."""
        self._columns[joint][column] = values
        self._known.add(column)

    def require(self, columns: Iterable[int]) -> None:
        """Ask for columns that were not looked at yet."""
        if isinstance(columns, range) and len(columns) == len(self._known) == self.width:
            return
        missing = sorted(set(columns) - self._known)
        self._known.update(missing)
        if missing and self.ask is not None:
            for (j, k), x in self.ask(missing).items():
                self._columns[j][k] = x
