"""`Table`: the rows of some logs, and every column that was ever asked for along them.

A diagnosis asks several times, each time for more candidates: for shapes between those of a grid,
for late families, for functions without a name. The base model's columns and those of candidates
that were there before stay what they are.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from identifiability.effects import Part
from identifiability.effects.functions import has_session
from identifiability.effects.gravity import ForcesOnBodies
from identifiability.estimation.noise import find_runs
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose.dictionary import Dictionary, Entries, compute_entries
from identifiability.workflows.diagnose.known_values import KnownValues
from identifiability.workflows.diagnose.rows import Candidate, Key, Rows


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

    def rows_with(self, candidates: Sequence[Candidate], samples: Sequence[Samples]) -> Rows:
        """Return the rows of some candidates along the same motion, with the torque of samples."""
        pieces = [piece for s in samples for piece in s.pieces(max(len(s.tau), 1))]
        measured = np.concatenate([piece.torque for piece in pieces])
        raw = np.concatenate([piece.raw for piece in pieces])
        tau = measured - (self.bare.measured - self.bare.tau)
        return replace(self.rows(candidates), tau=tau, measured=measured, raw=raw)

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
        for (j, at), x in compute_entries(self.robot, parts, self.samples).items():
            key, k = owner[at]
            self._known[key][j, k] = x

    @property
    def forces(self) -> Array:
        """Torque of forces on the bodies in any direction, (N, n, k)."""
        found = self._forces.reshape(*self._forces.shape[:2], -1)
        return found[:, :, found.any(axis=(0, 1))]

    @property
    def field(self) -> Array:
        """Torque of another gravity of all bodies, along each axis of the base, (N, n, 3)."""
        total: Array = self._forces.sum(3)
        return total

    @cached_property
    def _forces(self) -> Array:
        """Torque of forces along each axis of the base on each of b bodies, (N, n, 3, b)."""
        effect = ForcesOnBodies()
        named = effect.parameters(self.robot)
        parts = [(Part(effect, p.owner, (p.kind,)), [k]) for k, p in enumerate(named)]
        found = np.zeros((len(self.bare), self.bare.joints, len(named)))
        for (j, k), x in compute_entries(self.robot, parts, self.samples).items():
            found[:, j, k] = x
        return found.reshape(*found.shape[:2], 3, -1)

    @cached_property
    def _known(self) -> dict[Key, Entries]:
        """Return what was computed: torque by joint and column among a candidate's own."""
        return {}


def build_rows(
    structure: Structure,
    candidates: Sequence[Candidate],
    samples: Sequence[Samples],
    fixed: bool = False,
    *,
    known: KnownValues | None = None,
    later: bool = False,
) -> Rows:
    """Return the rows of some logs.

    Parameters
    ----------
    structure : Structure
        The robot under the base model.
    candidates : sequence of Candidate
        Whose columns are those of the dictionary, all of them.
    samples : sequence of Samples
    fixed : bool
        Whether the base parameters keep the values of the robot file.
    known : KnownValues, optional
        The values that they keep, with their errors; those of the file, exact, by default.
    later : bool
        Whether columns of candidates are computed only when they are looked at.
    """
    return Table.of(structure, samples, fixed, known).rows(candidates, later=later)


def _states(samples: Samples) -> Array:
    """Return position, velocity and acceleration of the actuated joints at the outputs, (N, 3n)."""
    at, m = samples.output_times(), samples.motion
    both = np.concatenate([m.actuated_q, m.actuated_v, m.actuated_a], axis=1)
    return np.stack([np.interp(at, m.t, column) for column in both.T], axis=1)
