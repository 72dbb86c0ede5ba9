"""What a diagnosis is asked, its `Setting`; rows, candidates and noise to name from: `Material`."""

from collections.abc import Iterable, Sequence
from dataclasses import field
from typing import Annotated

import numpy as np

from identifiability.effects import find_families
from identifiability.estimation.noise.ar_noise import ARNoise, fit_noise
from identifiability.foundation.names import Array
from identifiability.foundation.options import Share, at_least, check_fields
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation, Samples
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose.evidence import Bench, Whitened
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.known_values import KnownValues
from identifiability.workflows.diagnose.lookalikes import Alias, find_aliases
from identifiability.workflows.diagnose.real_fit import RealRobot
from identifiability.workflows.diagnose.rows import (
    Candidate,
    Finer,
    Refusal,
    Rows,
    build_rows,
    list_candidates,
)

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
class Material:
    """Everything that naming reads: rows, candidates, noise.

    Attributes
    ----------
    setting : Setting
    train : Rows
    held : HeldOut
    candidates : tuple of Candidate
        Without the structurally aliased ones.
    aliases : tuple of Alias
    refusals : tuple of Refusal
    bench : Bench
        Rows with their noise and simulated noise.
    white : Whitened
        Rows whitened by the noise alone.
    """

    setting: Setting
    train: Rows
    held: HeldOut
    candidates: tuple[Candidate, ...]
    aliases: tuple[Alias, ...]
    refusals: tuple[Refusal, ...]
    bench: Bench
    white: Whitened

    @property
    def noise(self) -> ARNoise:
        """Noise of every joint."""
        return self.bench.noise


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
    structure, fixed, known = setting.structure, setting.fixed, setting.known
    motions = [s.motion for s in setting.samples]
    families = find_families(effects)
    listed, refused = list_candidates(
        structure.robot,
        families,
        structure.present,
        motions,
        fixed=fixed,
        finer=setting.finer,
    )
    rows = build_rows(structure, listed, setting.samples, fixed, known=known)
    choosing, verifying = (
        build_rows(structure, listed, part, fixed, known=known, later=True) if part else None
        for part in (choose, setting.validation)
    )
    bodies = "rigid_body" in structure.model.names and not fixed
    real = RealRobot.of(structure) if bodies else None
    aliases = find_aliases(rows, listed, structure.base.names, setting.rules.alias)
    hidden = {(a.family, a.place) for a in aliases if a.structural}
    candidates = tuple(c for c in listed if c.group not in hidden)
    noise = fit_noise(rows.tau, lambda j: family_blocks(rows, candidates, j), rows.runs)
    bench = Bench.of(rows, noise, draws, rng)
    held = HeldOut.weighed(rows, choosing, verifying, real, noise)
    return Material(
        setting, rows, held, candidates, tuple(aliases), tuple(refused), bench, bench.whiten()
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
