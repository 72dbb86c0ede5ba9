"""What a diagnosis is asked, its `Setting`; rows, candidates and noise to answer it: `Problem`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from identifiability.effects import find_families
from identifiability.estimation.noise import autocorrelation_time, fit_noise
from identifiability.foundation.linalg import RANK_TOLERANCE, ROUNDING, ROUNDOFF, triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation, Samples
from identifiability.regression.columns import Candidate, Refusal, list_candidates, number
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose.evidence import (
    Options,
    Products,
    View,
    factor_of,
    step_of,
    tempering,
)
from identifiability.workflows.diagnose.hypothesis import FRICTION
from identifiability.workflows.diagnose.known_values import KnownValues, NearFile
from identifiability.workflows.diagnose.motion import Change
from identifiability.workflows.diagnose.rows import Rows, Table
from identifiability.workflows.diagnose.rules import Rules

#: Decimals that count where shares and sizes are compared: those beyond are another processor's
#: rounding, and of what ties the first comes first, in the order of candidates and parameters.
DECIMALS = 9


@frozen
class Setting:
    """What is diagnosed, and from what.

    Attributes
    ----------
    structure : Structure
        The robot under the model that is diagnosed.
    samples, validation : tuple of Samples
        Fitted, and unseen.
    fixed : bool
        Whether the model keeps the values of the robot file.
    known : KnownValues or None
        The values that it keeps, where these have errors.
    near : NearFile or None
        What is believed of values that are refitted.
    rules : Rules
    seed : int
    chosen_by : str
        What chose the names, in words.
    verified_on : str
        Unseen motion, in words: it was not fitted.
    preparation : Preparation
        How logs were turned into motion, with one cut-off.
    left_out : tuple of str
        Logs that disagree with the fitted ones and were left out.
    changes : tuple of Change
        What changed in the middle of fitted logs: what was logged meanwhile was left out.
    commanded : bool
        Whether torque is what servos made of commands.
    """

    structure: Structure
    samples: tuple[Samples, ...]
    validation: tuple[Samples, ...] = ()
    fixed: bool = False
    known: KnownValues | None = None
    near: NearFile | None = None
    rules: Rules = Rules()
    seed: int = 0
    chosen_by: str = ""
    verified_on: str = ""
    preparation: Preparation = Preparation()
    left_out: tuple[str, ...] = ()
    changes: tuple[Change, ...] = ()
    commanded: bool = False


@frozen
class Alias:
    """How much of a candidate the base model does not contain.

    Attributes
    ----------
    family, place : str
    remaining : float
        Root mean square of what is left, as a share of the candidate's own; of several columns
        the largest share of all that they can be.
    behind : tuple of str
        Parameters that make up what is not left, the largest first.
    structural : bool
        Whether it can never be named from this motion.
    """

    family: str
    place: str
    remaining: float
    behind: tuple[str, ...]
    structural: bool


class Problem:
    """Rows, candidates and noise of a setting.

    Parameters
    ----------
    setting : Setting
    effects : iterable of str, optional
        Families that may be named; all by default.

    Attributes
    ----------
    candidates : list of Candidate
        Without the structurally aliased ones; shapes between those of grids are added behind.
    aliases : tuple of Alias
    refusals : tuple of Refusal
    noise : ARNoise
    fitted, unseen : Products
        Of rows that say something of what is missing.
    """

    def __init__(self, setting: Setting, effects: Iterable[str] | None = None) -> None:
        self.setting = setting
        s, fixed = setting.structure, setting.fixed
        logs = [part for part in (setting.samples, setting.validation) if part]
        self.tables = tuple(Table.of(s, part, fixed, setting.known, setting.near) for part in logs)
        families = find_families(effects, commanded=setting.commanded)
        motions = [x.motion for x in setting.samples]
        listed, refused = list_candidates(s.robot, families, s.present, motions, fixed=fixed)
        rows = self.tables[0].rows(listed)
        self.aliases = tuple(find_aliases(rows, listed, s.base.names, setting.rules.alias))
        hidden = {(a.family, a.place) for a in self.aliases if a.structural}
        self.candidates = number([c for c in listed if c.group not in hidden])
        self._curves: dict[tuple[str, str], list[int]] = defaultdict(list)
        self._take_curves(self.candidates)
        self.refusals: tuple[Refusal, ...] = tuple(refused)
        self.given = len(self.candidates)
        rows, *others = (t.rows(self.candidates) for t in self.tables)
        self.noise = fit_noise(
            rows.tau, lambda j: family_blocks(rows, self.candidates, j), rows.moving
        )
        self.fitted = Products(rows, self.noise)
        self.unseen = Products(others[0], self.noise) if others else self.fitted
        self.options, self.fitted.sizes = (
            Options(self.candidates),
            self.typical(self.candidates, rows),
        )

    @property
    def sizes(self) -> Array:
        """Typical values of the columns, (c,)."""
        return self.fitted.sizes

    @property
    def seen(self) -> Rows:
        """Rows of the fitted logs, with the candidates that are computed later."""
        return self.tables[0].rows(self.candidates, later=True)

    @property
    def shown(self) -> Rows:
        """All rows on which errors are stated: of unseen logs, where there are any."""
        return self.tables[-1].rows(self.candidates, later=True)

    @property
    def rows(self) -> Rows:
        """The rows that are fitted."""
        return self.fitted.rows

    def columns(self, parts: Iterable[int]) -> list[int]:
        """Return the columns of some candidates by their numbers."""
        return [at for k in parts for at in self.candidates[k].columns]

    def acts(self, k: int) -> tuple[int, ...]:
        """Return the joints in which a candidate acts."""
        b, at = self.rows.X.shape[2], np.array(self.candidates[k].columns)
        places = (self.fitted.places(j) for j in range(self.rows.joints))
        return tuple(j for j, where in enumerate(places) if (where[1 + b + at] >= 0).any())

    def view(self, parts: Sequence[int], before: View | None = None) -> View:
        """Return the rows weighed as some candidates leave them, from another weighing on."""
        rows = self.rows
        left = self._plain() if before is None else self.residual(rows, parts, before)
        excess = self.noise.misfit(left, rows.counts)
        steps = np.array([
            step_of(x, n.left) for x, n in zip(excess, self.noise.joints, strict=True)
        ])  # fmt: skip
        ones = np.ones(rows.joints)
        view = View(self.fitted, steps, ones if before is None else before.tempered, self.sizes)
        errors = self.errors(self.fitted, parts, view)
        b = rows.X.shape[2] + len(self.columns(parts))
        rules = self.setting.rules
        tempered = tempering(errors, b / rows.joints, rules.lag, rules.usual)
        return replace(view, tempered=tempered, sizes=self.widened(parts, view))

    def widened(self, parts: Sequence[int], view: View) -> Array:
        """Return typical values, those of what is there as large as they are.

        A narrow prior would hold back what is much larger, and other parts would take that on. What
        competes for the same curve is as large: a name must not win for having been there first.
        """
        sizes, (value, _) = self.sizes.copy(), self.solve(parts, view)
        value = value[self.rows.X.shape[2] :]
        for k in parts:
            at, c = list(self.candidates[k].columns), self.candidates[k]
            own, value = np.abs(value[: len(at)]), value[len(at) :]
            ratio = own / np.where(self.sizes[at] > 0, self.sizes[at], np.inf)
            ratio = np.maximum(np.sqrt(np.mean(ratio**2)) if c.family.flexible else ratio, 1.0)
            if not c.family.flexible:
                alike = self._curves[c.place, c.family.against]
                sizes[alike] = np.maximum(sizes[alike], self.sizes[alike] * ratio.max())
            sizes[at] = self.sizes[at] * ratio
        return sizes

    def _take_curves(self, more: Iterable[Candidate]) -> None:
        """Note the columns of names by place and what they are a curve over."""
        for c in more:
            if not c.family.flexible:
                self._curves[c.place, c.family.against] += c.columns

    def settled(self, parts: Sequence[int], before: View | None = None) -> View:
        """Return the rows weighed as some candidates leave them, whatever they were before."""
        return self.view(parts, self.view(parts, before))

    def solve(self, parts: Sequence[int], view: View) -> tuple[Array, Array]:
        """Return the values (b + k,) of the model with some candidates, and their covariance."""
        ridge = [k if self.candidates[k].family.flexible else -1 for k in parts
                 for _ in self.candidates[k].columns]  # fmt: skip
        return view.solve(self.columns(parts), ridge)

    def residual(self, rows: Rows, parts: Sequence[int], view: View) -> Array:
        """Return the errors (N, n) of the model with some candidates, as it is fitted."""
        return self.left(rows, parts, self.solve(parts, view)[0])

    def left(self, rows: Rows, parts: Sequence[int], value: Array) -> Array:
        """Return the errors (N, n) of values (b + k,) of the model with some candidates."""
        b = rows.X.shape[2]
        left: Array = rows.tau - rows.X @ value[:b]
        left -= rows.D.take(self.columns(parts)) @ value[b:]
        return left

    def errors(self, where: Products, parts: Sequence[int], view: View) -> list[Array]:
        """Return the whitened errors of each joint, (R,)."""
        value, _ = self.solve(parts, view)
        at = self.columns(parts)
        whole = np.r_[1.0, -value]
        steps = view.steps.tolist()
        return [where.whitened(j, step, at) @ whole for j, step in enumerate(steps)]

    def triangular(self, parts: Sequence[int], view: View) -> Array:
        """Return the triangular factor of model, some candidates and torque, (b + k + 1, ·)."""
        at, steps = self.columns(parts), view.steps.tolist()
        rows = [
            self.fitted.whitened(j, step, at) / np.sqrt(view.tempered[j])
            for j, step in enumerate(steps)
        ]
        rows.append(np.pad(self._prior(parts, view), ((0, 0), (1, 0))))
        A = np.concatenate(rows)
        return triangular_factor(np.concatenate([A[:, 1:], A[:, :1]], axis=1))

    def weighed(self, parts: Sequence[int], view: View) -> tuple[Array, Array]:
        """Return the values of model and some candidates as an analysis fits them, to be stated.

        Rows are weighed by the errors of their joint. Whitened ones judge better what is missing,
        but of slow noise they keep no levels, and predict worse.

        Returns
        -------
        values : (b + k,)
        factor : (b + k + 1, b + k + 1)
            Triangular, of columns and torque with what is known beforehand.
        """
        rows, at = self.seen, self.columns(parts)
        left = self.residual(rows, parts, view)
        memory, squares = float(autocorrelation_time(left).mean()), np.sum(left**2, axis=0)
        joints = []
        for j in range(rows.joints):
            A = np.concatenate([rows.X[:, j], rows.D.acting(j, at), rows.tau[:, j, None]], axis=1)
            joints.append(triangular_factor(A[rows.data[:, j]]))
        known = np.pad(self._prior(parts, view), ((0, 0), (0, 1)))
        # Rounds in which joints are weighed by what is left of them.
        for _ in range(4):
            variance = np.maximum(squares / rows.counts * memory, 1e-24 * squares.max(initial=0.0))
            scale = np.sqrt(np.where(variance > 0, variance, 1.0)).tolist()
            R = np.concatenate([*(A / s for A, s in zip(joints, scale, strict=True)), known])
            length = np.linalg.norm(R[:, :-1], axis=0)
            length = np.where(length > 0, length, 1.0)
            value = np.linalg.lstsq(R[:, :-1] / length, R[:, -1], rcond=1e-9)[0] / length
            squares = np.array([np.sum((A @ np.r_[value, -1.0]) ** 2) for A in joints])
        return value, triangular_factor(R)

    def _prior(self, parts: Sequence[int], view: View) -> Array:
        """Return what is known beforehand of values, and that functions are of typical size."""
        rows, at = self.rows, self.columns(parts)
        b, out = rows.X.shape[2], []
        if rows.root is not None:
            out.append(np.pad(rows.root, ((0, 0), (0, len(at)))))
        flexible = [self.candidates[k].family.flexible for k in parts
                    for _ in self.candidates[k].columns]  # fmt: skip
        size = view.typical[at]
        some = np.flatnonzero(np.array(flexible, bool) & (size > 0))
        ridge = np.zeros((len(some), b + len(at)))
        ridge[range(len(some)), b + some] = 1.0 / size[some]
        return np.concatenate([*out, ridge])

    def _plain(self) -> Array:
        """Return the errors (N, n) of the model alone, joints weighed by their torque."""
        rows = self.rows
        rms = np.sqrt(np.sum(rows.tau**2, axis=0) / rows.counts)
        moved = rms > ROUNDING * rms.max(initial=0.0)
        scale = np.where(moved, 1.0 / np.where(moved, rms, 1.0), 0.0)
        A = (rows.X * scale[:, None]).reshape(rows.X.shape[0] * rows.joints, rows.X.shape[2])
        F = factor_of(A.T @ A)
        left: Array = rows.tau - rows.X @ (F.T @ (F @ (A.T @ (rows.tau * scale).ravel())))
        return left

    def extend(self, more: Sequence[Candidate]) -> range:
        """Add candidates, and return their numbers."""
        first, start = len(self.candidates), self.rows.D.width
        new = [replace(c, columns=tuple(k + start for k in c.columns)) for c in number(more)]
        self.candidates = [*self.candidates, *new]
        self._take_curves(new)
        for table, own in zip(self.tables, (self.fitted, self.unseen), strict=False):
            own.extend(table.extend(own.rows, new))
        self.fitted.sizes = np.concatenate([self.sizes, self.typical(new, self.rows)])
        self.options = Options(self.candidates)
        return range(first, len(self.candidates))

    def typical(self, candidates: Sequence[Candidate], rows: Rows) -> Array:
        """Return the typical values of columns: a share of the torque where that is least.

        Of friction over speed what it adds to Coulomb friction counts: one curve is as large
        whether it is written with that level in it or without.
        """
        at = [k for c in candidates for k in c.columns]
        torque = np.sqrt(np.sum(rows.measured**2 * rows.data, axis=0) / rows.counts)
        out = np.full(len(at), np.inf)
        present = self.setting.structure.present
        bends = [
            n
            for n, c in enumerate(c for c in candidates for _ in c.columns)
            if c.family.name in FRICTION and ("coulomb_friction", c.place) in present
        ]
        for j in range(rows.joints):
            D, level = rows.D.acting(j, at), np.sign(rows.dq[:, j]) * rows.data[:, j]
            D[:, bends] -= np.outer(level, level @ D[:, bends]) / max(level @ level, 1.0)
            rms = np.sqrt(np.sum(D**2, axis=0) / rows.counts[j])
            seen = rms > 0
            out[seen] = np.minimum(out[seen], self.setting.rules.size * torque[j] / rms[seen])
        first = 0
        for c in candidates:
            own = slice(first, first := first + len(c.columns))
            if c.family.flexible:  # pieces of one curve, reached or not, are alike
                out[own] = out[own].min()
            out[own] /= np.sqrt(len(c.columns))
        sizes: Array = np.where(np.isfinite(out), out, 0.0)
        return sizes


def family_blocks(rows: Rows, candidates: Sequence[Candidate], joint: int) -> list[Array]:
    """Return what acts in a joint of the base model and each family, few columns first, (N, ·)."""
    columns: dict[str, list[int]] = {}
    for c in candidates:
        columns.setdefault(c.family.name, []).extend(c.columns)
    small_first = sorted(columns.values(), key=len)
    block = rows.D.block(joint)
    inside = [np.flatnonzero(np.isin(block.columns, at)) for at in small_first]
    return [rows.X[:, joint], *(block.values[:, at] for at in inside if len(at))]


def find_aliases(
    rows: Rows, candidates: Sequence[Candidate], names: Sequence[str], share: float
) -> list[Alias]:
    """Return one entry for every family and place, that of its most visible shape.

    Of several columns together it is the most visible of all torques that they can make: how much
    of a spring is gravity must not hang on where its position is counted from.

    Parameters
    ----------
    rows : Rows
    candidates : sequence of Candidate
    names : sequence of str
        Of the base columns.
    share : float
        Remaining share below which a candidate is structurally aliased.
    """
    out: dict[tuple[str, str], Alias] = {}
    for _, family in groupby(candidates, key=lambda c: c.family.name):
        for alias in _family_aliases(rows, list(family), names, share):
            known = out.setdefault((alias.family, alias.place), alias)
            if known.remaining < alias.remaining:
                out[alias.family, alias.place] = alias
    for c in candidates:  # what never acts along this motion
        out.setdefault(c.group, Alias(*c.group, 0.0, (), True))
    return list(out.values())


def _family_aliases(
    rows: Rows, candidates: Sequence[Candidate], names: Sequence[str], share: float
) -> Iterator[Alias]:
    """Yield one entry for every candidate of a family that acts along this motion."""
    # Values with known errors hide nothing for ever: a larger effect shows.
    b = rows.X.shape[2] if rows.root is None else 0
    every = [k for c in candidates for k in c.columns]
    G = np.zeros((b + len(every),) * 2)
    for j in range(rows.joints):
        scale = float(np.sqrt(np.sum(rows.tau[:, j] ** 2) / rows.counts[j])) or 1.0
        A = np.concatenate([rows.X[:, j, :b], rows.D.acting(j, every)], axis=1) / scale
        here = np.flatnonzero(A.any(0))  # of many joints few columns act in each
        A = A[:, here]
        G[np.ix_(here, here)] += A.T @ A
    length = np.sqrt(np.maximum(np.diag(G), 1e-300))
    G /= length
    G /= length[:, None]
    F = factor_of(G[:b, :b])
    C = F @ G[:b, b:]
    end = 0
    for c in candidates:
        at = np.arange(end, end := end + len(c.columns))
        values, vectors = np.linalg.eigh(G[np.ix_(b + at, b + at)])
        seen = values > RANK_TOLERANCE * max(float(values[-1]), 1e-300)
        if not seen.any() or not values[-1] > ROUNDOFF:
            continue
        V = vectors[:, seen] / np.sqrt(values[seen])
        inside = C[:, at] @ V
        # Rounding is of squares: of what is wholly hidden a root of it would remain.
        square = round(1.0 - float(np.linalg.eigvalsh(inside.T @ inside)[0]), DECIMALS)
        left = float(np.sqrt(max(0.0, square)))  # no minus before a zero
        size = np.linalg.norm(F.T @ inside, axis=1)
        size = np.round(size / (size.max(initial=0.0) or 1.0), DECIMALS)
        # Parameters that an alias is said to be hidden behind, of this share of the
        # largest at least.
        # Parameters that an alias is said to be hidden behind, of this share of the
        # largest at least.
        order = [k for k in np.argsort(-size, kind="stable")[:3] if size[k] > 0.1]
        behind = tuple(names[k] for k in order)
        yield Alias(*c.group, left, behind, left < share)
