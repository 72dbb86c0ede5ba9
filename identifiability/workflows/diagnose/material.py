"""`Material`: rows, candidates and noise, all that naming reads."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from identifiability.effects import find_families
from identifiability.estimation.noise.ar_noise import ARNoise, fit_noise
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose.aliases import Alias, find_aliases
from identifiability.workflows.diagnose.evidence import Bench, Whitened
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.real_robot import RealRobot
from identifiability.workflows.diagnose.rows import (
    Candidate,
    Refusal,
    Rows,
    build_rows,
    list_candidates,
)
from identifiability.workflows.diagnose.rules import Rules

#: Simulated noises.
DRAWS = 199


@frozen
class Material:
    """Everything that naming reads: rows, candidates, noise.

    Attributes
    ----------
    structure : Structure
        The robot under the base model.
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

    structure: Structure
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
    structure: Structure,
    train: Sequence[Samples],
    choose: Sequence[Samples],
    rng: np.random.Generator,
    *,
    effects: Iterable[str] | None = None,
    fixed: bool = False,
    rules: Rules | None = None,
    draws: int = DRAWS,
    verify: Sequence[Samples] = (),
) -> Material:
    """Return rows, candidates, aliases and noise: all that naming reads.

    Parameters
    ----------
    structure : Structure
        The robot under the base model.
    train : sequence of Samples
        What is fitted.
    choose : sequence of Samples
        What judges while names are chosen; none to leave out fitted motion in turn.
    rng : numpy.random.Generator
    effects, fixed, rules, draws
        As for `diagnose`.
    verify : sequence of Samples
        What takes no part in fitting or choosing.
    """
    rules = rules or Rules()
    robot, model = structure.robot, structure.model
    motions = [s.motion for s in train]
    listed, refused = list_candidates(robot, find_families(effects), model.names, motions,
                                      fixed=fixed)  # fmt: skip
    rows = build_rows(structure, listed, train, fixed)
    choosing, verifying = (
        build_rows(structure, listed, part, fixed) if part else None for part in (choose, verify)
    )
    bodies = "rigid_body" in model.names and not fixed
    real = RealRobot.of(structure) if bodies else None
    aliases = find_aliases(rows, listed, structure.base.names, rules.alias)
    hidden = {(a.family, a.place) for a in aliases if a.structural}
    candidates = tuple(c for c in listed if c.group not in hidden)
    noise = fit_noise(rows.tau, family_blocks(rows, candidates), rows.runs())
    bench = Bench.of(rows, noise, draws, rng)
    return Material(
        structure, rows, HeldOut(rows, choosing, verifying, real), candidates,
        tuple(aliases), tuple(refused), bench, bench.whiten(),
    )  # fmt: skip


def family_blocks(rows: Rows, candidates: Sequence[Candidate]) -> list[Array]:
    """Return the columns of the base model and of each family, families with few columns first."""
    columns: dict[str, list[int]] = {}
    for c in candidates:
        columns.setdefault(c.family.name, []).extend(c.columns)
    small_first = sorted(columns.values(), key=len)
    return [rows.X, *(rows.D[:, :, at] for at in small_first)]
