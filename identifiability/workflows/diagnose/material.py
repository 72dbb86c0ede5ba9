"""What a diagnosis is asked, its `Setting`; rows, candidates and noise to name from: `Material`."""

from collections.abc import Iterable, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Annotated

import numpy as np

from identifiability.effects import find_families
from identifiability.estimation.noise import ARNoise, fit_noise
from identifiability.foundation.names import Array
from identifiability.foundation.options import Share, at_least, check_fields
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation, Samples
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose.evidence import Bench, Whitened
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.known_values import KnownValues
from identifiability.workflows.diagnose.leftover import Remains
from identifiability.workflows.diagnose.lookalikes import Alias, find_aliases
from identifiability.workflows.diagnose.predictive import Predictive
from identifiability.workflows.diagnose.real_fit import RealRobot
from identifiability.workflows.diagnose.rows import (
    Candidate,
    Finer,
    Refusal,
    Rows,
    list_candidates,
    number,
)
from identifiability.workflows.diagnose.table import Table

#: Simulated noises.
DRAWS = 199


@frozen
class Rules:
    """Thresholds of naming.

    Attributes
    ----------
    level : float
        Family-wise error of each step.
    gain : float
        Least relative fall of the held-out error, joints weighted by their own.
    alias : float
        A candidate of which less than this share is outside the model is structurally aliased.
    confusable : float
        Canonical correlation from which on two names are given.
    most : int
        Steps at most.
    patience : int
        Steps without a fall of the held-out error after which the search ends.
    """

    level: Share = 0.05
    gain: Share = 0.002
    alias: Share = 0.03
    confusable: Share = 0.9
    most: Annotated[int, at_least(1)] = 40
    patience: Annotated[int, at_least(1)] = 4

    def __post_init__(self) -> None:
        check_fields(self)


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
    rules : Rules
    seed : int
    chosen_by : str
        What judged while names were chosen, in words.
    verified_on : str
        Unseen motion, in words: neither fitted nor used to choose.
    preparation : Preparation
        How logs were turned into motion, with one cut-off.
    left_out : tuple of str
        Logs that disagree with the fitted ones and were left out.
    finer : mapping of (family, place) to tuple of float
        More shapes that are tried.
    """

    structure: Structure
    samples: tuple[Samples, ...]
    validation: tuple[Samples, ...] = ()
    fixed: bool = False
    known: KnownValues | None = None
    rules: Rules = Rules()
    seed: int = 0
    chosen_by: str = ""
    verified_on: str = ""
    preparation: Preparation = Preparation()
    left_out: tuple[str, ...] = ()
    finer: Finer = field(default_factory=dict)


@frozen
class Tables:
    """The rows of all logs of a setting, of which every column is computed once.

    Attributes
    ----------
    train : Table
    choosing, verifying : Table or None
    real : RealRobot or None
    """

    train: Table
    choosing: Table | None
    verifying: Table | None
    real: RealRobot | None

    @staticmethod
    def of(setting: Setting, choose: Sequence[Samples]) -> "Tables":
        """Return the rows of a setting and of what judges while names are chosen."""
        structure, fixed = setting.structure, setting.fixed
        train, choosing, verifying = (
            Table.of(structure, part, fixed, setting.known) if part else None
            for part in (setting.samples, choose, setting.validation)
        )
        assert train is not None
        bodies = "rigid_body" in structure.model.names and not fixed
        return Tables(train, choosing, verifying, RealRobot.of(structure) if bodies else None)

    def held(self, candidates: Sequence[Candidate], noise: ARNoise | None) -> HeldOut:
        """Return what fits and judges some candidates; of what judges few are ever looked at."""
        choosing, verifying = (
            None if table is None else table.rows(candidates, later=True)
            for table in (self.choosing, self.verifying)
        )
        return HeldOut(self.train.rows(candidates), choosing, verifying, self.real, noise)


@frozen
class Material:
    """Everything that naming reads: rows, candidates, noise.

    Attributes
    ----------
    setting : Setting
    tables : Tables
        Where rows are from.
    held : HeldOut
    candidates : tuple of Candidate
        Without the structurally aliased ones.
    aliases : tuple of Alias
    refusals : tuple of Refusal
    bench : Bench
        Rows with their noise and simulated noise.
    """

    setting: Setting
    tables: Tables
    held: HeldOut
    candidates: tuple[Candidate, ...]
    aliases: tuple[Alias, ...]
    refusals: tuple[Refusal, ...]
    bench: Bench

    @property
    def train(self) -> Rows:
        """The rows that are fitted."""
        return self.held.train

    @property
    def noise(self) -> ARNoise:
        """Noise of every joint."""
        return self.bench.noise

    @property
    def white(self) -> Whitened:
        """Rows whitened by the noise alone."""
        return self.bench.plain

    def remains(self, chosen: Sequence[Candidate]) -> Remains:
        """Return what some names leave: one answer, however many ask for the same names."""
        key = tuple(chosen)
        if key not in self._remains:
            self._remains[key] = Remains(self.held, self.bench, key)
        return self._remains[key]

    @cached_property
    def _remains(self) -> dict[tuple[Candidate, ...], Remains]:
        return {}

    def unseen(self, chosen: Sequence[Candidate]) -> Predictive:
        """Return what the motion that verifies adds to the fitted one, beside some names."""
        key = tuple(chosen)
        if key not in self._unseen:
            self._unseen[key] = self.held.predictive(key, self.noise)
        return self._unseen[key]

    @cached_property
    def _unseen(self) -> dict[tuple[Candidate, ...], Predictive]:
        return {}

    def extended(self, more: Sequence[Candidate], beside: "Material | None" = None) -> "Material":
        """Return the same with further candidates behind its own.

        Candidates have new numbers; `find_same` finds those that were named. The noise stays: it is
        theirs who are tested beside one another. Or it is that `beside` which these were named:
        where they may not say what is slow, that is taken for noise, and a drift for nothing.
        """
        every, noisy = tuple(number([*self.candidates, *more])), beside or self
        held = self.tables.held(every, noisy.held.noise)
        held = held.recall(noisy.held) if noisy.tables is self.tables else held
        bench = replace(noisy.bench, rows=held.train)
        return replace(self, held=held, candidates=every, bench=bench)

    def finer(self, finer: Finer) -> "Material":
        """Return the same with more shapes of some families at some places."""
        listed, _ = _list(
            replace(self.setting, finer=finer), dict.fromkeys(name for name, _ in finer)
        )
        more = [c for c in listed if c.shape in finer.get(c.group, ())]
        return replace(self.extended(more), setting=replace(self.setting, finer=finer))

    def anew(
        self, rng: np.random.Generator, effects: Iterable[str], draws: int = DRAWS
    ) -> "Material":
        """Return the candidates of other families along the same rows, with noise beside them."""
        return _gather(self.setting, self.tables, rng, effects, draws)


def gather(
    setting: Setting,
    choose: Sequence[Samples],
    rng: np.random.Generator,
    effects: Iterable[str] | None = None,
    draws: int = DRAWS,
) -> Material:
    """Return rows, candidates, aliases and noise: all that naming reads.

    Parameters
    ----------
    setting : Setting
    choose : sequence of Samples
        What judges while names are chosen; none to leave out fitted motion in turn.
    rng : numpy.random.Generator
    effects, draws
        As for `diagnose`.
    """
    return _gather(setting, Tables.of(setting, choose), rng, effects, draws)


def _gather(
    setting: Setting,
    tables: Tables,
    rng: np.random.Generator,
    effects: Iterable[str] | None,
    draws: int,
) -> Material:
    listed, refused = _list(setting, effects)
    rows = tables.train.rows(listed)
    aliases = find_aliases(rows, listed, setting.structure.base.names, setting.rules.alias)
    hidden = {(a.family, a.place) for a in aliases if a.structural}
    candidates = tuple(number([c for c in listed if c.group not in hidden]))
    held = tables.held(candidates, None)
    rows = held.train
    noise = fit_noise(rows.tau, lambda j: family_blocks(rows, candidates, j), rows.moving)
    bench = Bench.of(rows, noise, draws, rng)
    held = HeldOut.weighed(rows, held.choosing, held.verifying, held.real, noise)
    return Material(setting, tables, held, candidates, tuple(aliases), tuple(refused), bench)


def _list(setting: Setting, effects: Iterable[str] | None) -> tuple[list[Candidate], list[Refusal]]:
    """Return every candidate of some families, and those that make no sense somewhere."""
    return list_candidates(
        setting.structure.robot,
        find_families(effects),
        setting.structure.present,
        [s.motion for s in setting.samples],
        fixed=setting.fixed,
        finer=setting.finer,
    )


def family_blocks(rows: Rows, candidates: Sequence[Candidate], joint: int) -> list[Array]:
    """Return what acts in a joint of the base model and each family, few columns first, (N, ·)."""
    columns: dict[str, list[int]] = {}
    for c in candidates:
        columns.setdefault(c.family.name, []).extend(c.columns)
    small_first = sorted(columns.values(), key=len)
    block = rows.D.block(joint)
    inside = [np.flatnonzero(np.isin(block.columns, at)) for at in small_first]
    return [rows.X[:, joint], *(block.values[:, at] for at in inside if len(at))]
