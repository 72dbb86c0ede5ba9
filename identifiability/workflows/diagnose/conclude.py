"""From a `Naming` to a `Diagnosis`: values, rivals, errors on unseen motion, what is left."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.effects import Part as EffectPart
from identifiability.effects import Placed, title_of
from identifiability.estimation.alternatives import place_of
from identifiability.estimation.mixed_model import EVERYWHERE
from identifiability.foundation.names import Array
from identifiability.regression.regression import Model
from identifiability.robot import Robot, complete_motion
from identifiability.workflows.diagnose.findings import Curve, NamedEffect, Odds, Placement, Rival
from identifiability.workflows.diagnose.naming import Naming, Part
from identifiability.workflows.diagnose.result import Diagnosis
from identifiability.workflows.diagnose.rows import Gap, find_discrepancies


def conclude(naming: Naming, rng: np.random.Generator) -> Diagnosis:
    """Return the diagnosis.

    Parameters
    ----------
    naming : Naming
        What is missing.
    rng : numpy.random.Generator
        For intervals.
    """
    setting, parts = naming.setting, naming.parts
    structure, robot = setting.structure, setting.structure.robot
    families = list(dict.fromkeys(p.candidate.family.name for p in parts))
    own = [[k for k, p in enumerate(parts) if p.candidate.family.name == f] for f in families]
    submodels = [[k for some in own[:n] for k in some] for n in range(len(own) + 1)]
    fits = [naming.fit(some) for some in submodels]
    fitted, unseen = (
        np.stack(
            [naming.left(s, v, unseen=where) for s, v in zip(submodels, fits, strict=True)], axis=2
        )
        for where in (False, True)
    )
    gap = Gap(naming.unseen, unseen)
    errors = gap.prediction.relative_error()
    before = Gap(naming.fitted, fitted).prediction.relative_error()
    placed = [_place(naming, k, fits[-1]) for k in range(len(parts))]
    effects = [
        _effect(naming, gap, some, [placed[k] for k in some], n, rng) for n, some in enumerate(own)
    ]
    left, after = fitted[:, :, -1], {t.key: t.odds for t in naming.after}
    added = [
        Placed(placing, [_write_part(robot, part) for part in placing])
        for placing in ([parts[k].candidate.part for k in some] for some in own)
    ]
    return Diagnosis(
        **vars(setting),
        effects=tuple(effects),
        curves=tuple(_curve(naming, fits[-1], k, p) for k, p in enumerate(placed)),
        gap=gap,
        error_before=float(before[0]),
        error_after=float(before[-1]),
        held_before=float(errors[0]),
        held_after=float(errors[-1]),
        refuted=tuple(
            Odds(t.group.family, place_of(t), t.odds, unseen=x) for t, x in naming.refuted
        ),
        interval=gap.interval(0, -1, rng),
        discrepancies=find_discrepancies(naming.fitted, left, robot.joints),
        refusals=naming.refusals,
        evidence=tuple(
            Odds(t.group.family, place_of(t), t.odds, after.get(t.key, float("nan")))
            for t in naming.before
        ),
        values=setting.known.moved(fits[-1][: len(setting.known.free)]),
        model=Model((*structure.model.effects, *added)),
    )


def _effect(
    naming: Naming,
    gap: Gap,
    own: Sequence[int],
    placements: Sequence[Placement],
    n: int,
    rng: np.random.Generator,
) -> NamedEffect:
    """Return an effect with what unseen motion shows of it where it is."""
    parts = [naming.parts[k] for k in own]
    family, errors = parts[0].candidate.family, gap.prediction.relative_error().tolist()
    places = family.places(naming.setting.structure.robot)
    return NamedEffect(
        name=family.name,
        title=family.title,
        placements=tuple(placements),
        before=errors[n],
        after=errors[n + 1],
        interval=gap.interval(n, n + 1, rng),
        everywhere=1 < len(places) == len(placements),
        unnamed=family.unnamed,
        nearest=tuple(dict.fromkeys(title_of(t.group.family) for p in parts for t in p.nearest)),
    )


def _place(naming: Naming, k: int, fitted: Array) -> Placement:
    """Return what is known of a part."""
    part, robot = naming.parts[k], naming.setting.structure.robot
    c = part.candidate
    value, covariance = naming.values(k)
    first = len(fitted) - sum(len(p.candidate.columns) for p in naming.parts[k:])
    own = fitted[first : first + len(value)]
    parameters = Placed.part_parameters(robot, c.part)
    added = [naming.columns([k], j) @ value for j in naming.acts(k)]
    return Placement(
        place=c.place,
        shape=c.shape,
        parameters=tuple(x.name for x in parameters),
        units=tuple(x.unit for x in parameters),
        values=value,
        errors=np.sqrt(np.maximum(np.diag(covariance), 0.0)),
        fitted=own,
        rms=max((float(np.sqrt(np.mean(x**2))) for x in added), default=0.0),
        rivals=tuple(_rivals(part)),
        weight=part.weight,
        odds=part.term.odds,
        unseen=part.unseen,
    )


def _rivals(part: Part) -> list[Rival]:
    """Return what the name cannot be told from, each once; what is everywhere is here, too."""
    own, every = part.candidate.place, (r.group for r in part.rivals)
    at = (Rival(g.family, own if g.place == EVERYWHERE else g.place) for g in every)
    return list(dict.fromkeys(at))


def _curve(naming: Naming, values: Array, k: int, placed: Placement) -> Curve:
    """Return what a part was learned to be, along the fitted motion."""
    c, rows = naming.parts[k].candidate, naming.fitted
    joints, robot = naming.acts(k), naming.setting.structure.robot
    columns = {j: naming.columns([k], j) for j in joints}
    j = max(joints, key=lambda j: float(np.abs(columns[j] @ placed.values).sum()))
    left, law = naming.left(range(len(naming.parts)), values), columns[j]
    added, of = law @ placed.values, c.family.drawn_over(c.effect, robot, j)
    if c.family.against in ("velocity", "position") and not (c.family.remembers or robot.closed):
        # As it is, not as the low-pass leaves it, which depends on where the motion came from.
        every = np.zeros((*rows.measured.shape, law.shape[1]))
        Placed([c.part]).fill(robot, complete_motion(robot, rows.t, *rows.states), every)
        law = every[:, j]
    return Curve(
        title=c.family.title,
        joint=j,
        of=of,
        against=c.family.against,
        x=rows.along(of)[c.family.against],
        learned=law @ placed.values,
        spread=np.sqrt(law**2 @ placed.errors**2),
        data=left[:, j] + added,
    )


def _write_part(robot: Robot, part: EffectPart) -> str:
    """Return an effect at its place, with its shape, as a model file writes it."""
    name = part.effect.name
    shape = part.effect.shapes(robot).get(f"{part.owner}.{name}")
    return f"{name}@{part.owner}" if shape is None else f"{name}@{part.owner}:{float(shape)!r}"
