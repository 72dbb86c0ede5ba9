"""From named candidates to a `Diagnosis`: refit, verify on unseen motion, what is left."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from identifiability.effects import Part, Placed
from identifiability.foundation.names import Array
from identifiability.regression.regression import Model
from identifiability.robot import Robot
from identifiability.workflows.diagnose.findings import (
    Curve,
    NamedEffect,
    Placement,
    Verified,
)
from identifiability.workflows.diagnose.gap import Gap
from identifiability.workflows.diagnose.gates import Naming, keep_surviving
from identifiability.workflows.diagnose.lookalikes import find_rivals, leave_to_model
from identifiability.workflows.diagnose.material import Material
from identifiability.workflows.diagnose.payload import fit_body, is_body
from identifiability.workflows.diagnose.predictive import Told
from identifiability.workflows.diagnose.residual import (
    Remainder,
    find_discrepancies,
    smallest_sizes,
)
from identifiability.workflows.diagnose.result import Diagnosis
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.shown import Both, Shown
from identifiability.workflows.diagnose.unnamed import SHARE
from identifiability.workflows.diagnose.values import measure_strength, solve_chosen, undetermined

#: Score that an effect must reach where no step was made that says so.
CRITICAL = 8.0
CONTRADICTED = "the motion that verifies contradicts it"


def conclude(m: Material, naming: Naming, rng: np.random.Generator) -> Diagnosis:
    """Return the diagnosis: refit, rungs of added effects, errors on unseen motion, remainder.

    What the motion that verifies surely contradicts, or makes what noise does too often, all of a
    family or at one of its places, is taken out, one after the other. What the fitted motion leaves
    in doubt was asked of it alone, and is not called refuted.
    """
    structure, refuted = m.setting.structure, []
    (apart,) = rng.spawn(1)
    while True:
        found = _verify(m, naming, rng, apart)
        against = [e for e in (*found.effects, *_each_place(m, naming, found, apart)) if e.refuted]
        if not against:
            break
        worst = max(against, key=lambda e: e.joints_interval[0])
        if not worst.doubted:  # that was never given
            refuted.append(worst)
        gone = [c for c in naming.chosen if c.group in {(worst.name, j) for j in worst.joints}]
        why = "the motion that verifies does not show it" if worst.doubted else CONTRADICTED
        naming = keep_surviving(naming, gone, structure.present, why)
    chosen, joints = naming.chosen, structure.robot.joints
    before, after = (m.held.fitted_residual(c) for c in ((), chosen))
    rms = np.sqrt(np.sum(after**2, axis=0) / m.train.counts)
    critical = naming.steps[-1].critical if naming.steps else CRITICAL
    sizes = smallest_sizes(m.train, m.white, chosen, m.candidates, critical, rms)
    robot, parts = structure.robot, []
    for effect in found.effects:
        own = [c.part for c in chosen if c.family.name == effect.name]
        parts.append(Placed(own, [_write_part(robot, part) for part in own]))
    return Diagnosis(
        **vars(m.setting),
        **vars(found),
        refuted=tuple(refuted),
        interval=found.gap.interval(0, -1, rng),
        discrepancies=tuple(find_discrepancies(m.train, before, joints)),
        discrepancies_after=tuple(find_discrepancies(m.train, after, joints)),
        aliases=m.aliases,
        refusals=m.refusals,
        steps=naming.steps,
        remainder=Remainder(rms, sizes, m.remains(chosen).joints),
        model=Model((*structure.model.effects, *parts)),
    )


def _verify(
    m: Material, naming: Naming, rng: np.random.Generator, apart: np.random.Generator
) -> Verified:
    """Return every named family with its errors on the motion that verifies."""
    order = list(dict.fromkeys(c.family.name for c in naming.chosen))
    rungs = [
        [c for c in naming.chosen if c.family.name in order[:k]] for k in range(len(order) + 1)
    ]
    gap = m.held.gap(rungs)
    fitted = np.stack([m.held.fitted_residual(chosen) for chosen in rungs], axis=2)
    errors, joints = gap.relative_error().tolist(), gap.error_over_joints().tolist()
    before = Gap(m.train, fitted).relative_error().tolist()
    real = [float("nan")] * len(rungs)
    if m.held.real is not None:
        real = m.held.gap(rungs, real=True).relative_error().tolist()
    placed = _place(m, naming, fitted[:, :, -1])
    effects = []
    for k, name in enumerate(order):
        own = [at for at, c in enumerate(naming.chosen) if c.family.name == name]
        places = [placed[at][0] for at in own]
        unnamed = naming.chosen[own[0]].family.unnamed
        told = _tell(m, naming.chosen, {naming.chosen[at].group for at in own})
        effect = NamedEffect(
            name=name,
            title=naming.chosen[own[0]].family.title,
            placements=tuple(places),
            before=errors[k],
            after=errors[k + 1],
            interval=gap.interval(k, k + 1, rng),
            joints_before=joints[k],
            joints_after=joints[k + 1],
            joints_interval=gap.interval_over_joints(k, k + 1, rng),
            shown=_show(gap, m, places, k, k + 1, apart, told),
            real=(real[k], real[k + 1]),
            unnamed=unnamed,
            rare=unnamed or naming.chosen[own[0]].family.late,
            nearest=tuple(n for at in own for n in naming.nearest.get(naming.chosen[at].group, ())),
            both=Both(
                p_value=max(p.p_value for p in places),
                evidence=told.evidence,
                level=m.setting.rules.level * (SHARE if unnamed else 1.0),
                within_noise=m.unseen(naming.chosen).within_noise,
            ),
        )
        if effect.doubted:  # the p-value that is told is that of both motions
            both = tuple(replace(p, p_value=effect.p_value) for p in places)
            effect = replace(effect, placements=both)
        effects.append(effect)
    return Verified(
        effects=tuple(effects),
        curves=tuple(curve for _, curve in placed),
        gap=gap,
        error_before=before[0],
        error_after=before[-1],
        held_before=errors[0],
        held_after=errors[-1],
        real_before=real[0],
        real_after=real[-1],
    )


def _each_place(
    m: Material, naming: Naming, found: Verified, rng: np.random.Generator
) -> list[NamedEffect]:
    """Return each place of the families that are named at several, by what it adds to all else."""
    units = [(e, place) for e in found.effects for place in e.joints if len(e.joints) > 1]
    if not units:
        return []
    rests = [[c for c in naming.chosen if c.group != (e.name, place)] for e, place in units]
    own = [[p for p in e.placements if p.place == place] for e, place in units]
    gap, last = m.held.gap([*rests, naming.chosen]), len(rests)
    told = [_tell(m, naming.chosen, {(e.name, place)}) for e, place in units]
    errors, joints = gap.relative_error().tolist(), gap.error_over_joints().tolist()
    return [
        replace(
            e,
            placements=tuple(own[k]),
            before=errors[k],
            after=errors[last],
            interval=gap.interval(k, last, rng),
            joints_before=joints[k],
            joints_after=joints[last],
            joints_interval=gap.interval_over_joints(k, last, rng),
            shown=_show(gap, m, own[k], k, last, rng, told[k]),
            real=(float("nan"), float("nan")),
            both=replace(
                e.both,
                p_value=max(p.p_value for p in own[k]),
                evidence=told[k].evidence,
            ),
        )
        for k, (e, _) in enumerate(units)
    ]


def _show(
    gap: Gap,
    m: Material,
    placements: Sequence[Placement],
    first: int,
    second: int,
    rng: np.random.Generator,
    told: Told,
) -> Shown:
    """Return what a gap shows from one model to another at the joints of some places."""
    own = gap.at(_seen(m, placements))
    errors = own.error_over_joints().tolist()
    return Shown(
        before=errors[first],
        after=errors[second],
        interval=own.interval_over_joints(first, second, rng),
        expected=own.expected_change(first, second),
        strength=float(np.linalg.norm([p.strength for p in placements])),
        news=told.news,
    )


def _seen(m: Material, placements: Sequence[Placement]) -> list[int]:
    """Return the joints of some places; of what is at no single joint it is all joints."""
    joints, places = m.setting.structure.robot.joints, [p.place for p in placements]
    at = [k for k, joint in enumerate(joints) if joint in places]
    return at if set(places) <= set(joints) else list(range(len(joints)))


def _tell(m: Material, chosen: Sequence[Candidate], groups: Collection[tuple[str, str]]) -> Told:
    """Return what the motion that verifies tells of some names beside all that was chosen."""
    every = [c.group for c in chosen for _ in c.columns]
    own = [k for k, group in enumerate(every, m.train.X.shape[2]) if group in groups]
    return m.unseen(chosen).of_effect(own)


def _place(m: Material, naming: Naming, residual: Array) -> list[tuple[Placement, Curve]]:
    """Return what is known of every named candidate, and what it was learned to be.

    Parameters
    ----------
    m : Material
    naming : Naming
    residual : (N, n) [N·m or N]
        Of the fitted motion beside all that was named.
    """
    out, start = [], m.white.X.shape[1]
    alone = ~undetermined(m.white.columns(naming.chosen))
    for c, found in zip(naming.chosen, solve_chosen(m.white, naming.chosen), strict=True):
        D = m.train.D.take(c.columns)
        rest = [other for other in naming.chosen if other is not c]
        value, error = found
        if is_body(c):
            # What the bounds of a body move is not known any better than without them.
            body = fit_body(m.white, rest, c)
            value, error = body, np.hypot(error, body - value)
        if c.family.flexible:
            value, error = leave_to_model(m.white, rest, c, value, m.setting.rules.alias)
        added, spread = D @ value, np.sqrt((D**2) @ error**2)
        parameters = Placed.part_parameters(m.setting.structure.robot, c.part)
        own = alone[start : start + len(c.columns)]
        start += len(c.columns)
        rivals = []
        if not c.family.unnamed:
            rivals = find_rivals(m.white, c, rest, m.candidates, m.setting.rules.confusable)
        placement = Placement(
            place=c.place,
            shape=c.shape,
            p_value=naming.p_values.get(c.group, float("nan")),
            parameters=tuple(p.name for p in parameters),
            units=tuple(p.unit for p in parameters),
            values=value,
            errors=error,
            rms=float(np.sqrt(np.mean(added**2, axis=0)).max()),
            rivals=tuple(rivals),
            stress=naming.stress.get(c.slot, ()),
            open=tuple(p.name for p, known in zip(parameters, own, strict=True) if not known),
            strength=measure_strength(m.white, rest, c, value),
        )
        j = int(np.argmax(np.abs(added).sum(0)))
        of = c.family.drawn_over(c.effect, m.setting.structure.robot, j)
        curve = Curve(
            title=c.family.title,
            joint=j,
            of=of,
            against=c.family.against,
            x=m.train.along(of)[c.family.against],
            learned=added[:, j],
            spread=spread[:, j],
            data=residual[:, j] + added[:, j],
        )
        out.append((placement, curve))
    return out


def _write_part(robot: Robot, part: Part) -> str:
    """Return an effect at its place, with its shape, as a model file writes it."""
    name = part.effect.name
    shape = part.effect.shapes(robot).get(f"{part.owner}.{name}")
    return f"{name}@{part.owner}" if shape is None else f"{name}@{part.owner}:{float(shape)!r}"
