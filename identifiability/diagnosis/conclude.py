"""From named candidates to a `Diagnosis`: refit, stress, verify on unseen motion, what is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability import signals
from identifiability.diagnosis.confusable import find_rivals
from identifiability.diagnosis.evidence import solve_values
from identifiability.diagnosis.find import find_discrepancies
from identifiability.diagnosis.material import Material
from identifiability.diagnosis.named_effect import Curve, NamedEffect, Placement
from identifiability.diagnosis.naming import Naming
from identifiability.diagnosis.remainder import find_remainder
from identifiability.diagnosis.result import Diagnosis
from identifiability.diagnosis.roles import Roles
from identifiability.diagnosis.rows import Rows, build_rows, thin
from identifiability.diagnosis.rules import Rules
from identifiability.diagnosis.stress import (
    Survival,
    Variation,
    list_variations,
    stress_effects,
)
from identifiability.effects import Placed
from identifiability.ladder import nominal_base
from identifiability.log import Log
from identifiability.model import Model
from identifiability.names import Array
from identifiability.samples import Preparation, Samples, prepare_samples


def stress_named(
    material: Material,
    naming: Naming,
    logs: Sequence[Log],
    train: Sequence[Samples],
    preparation: Preparation | None,
    fixed: bool,
    rng: np.random.Generator,
) -> list[list[Survival]]:
    """Return how the named effects fare when the motion is made anew."""
    if not naming.chosen:
        return []
    robot, m = material.robot, material
    values = nominal_base(robot, m.base) if fixed else None
    how = preparation or Preparation()
    computed = train[0].decimation is not None and logs[0].dq is None
    cutoff = signals.choose_cutoff(logs[0].t, logs[0].q) if computed else None
    factor = train[0].decimation.factor if train[0].decimation is not None else None

    def build(variation: Variation) -> Rows:
        _, change_log, change_how = variation
        changed = [
            thin(prepare_samples(robot, change_log(log), change_how(replace(how, decimate=factor))))
            for log in logs
        ]
        return build_rows(robot, m.model, m.base.kept, naming.chosen, changed, values)

    found = solve_values(m.white, m.white.columns(naming.chosen))[0][m.train.X.shape[2] :]
    first = np.cumsum([0, *(len(c.columns) for c in naming.chosen)])[:-1]
    return stress_effects(
        build, list_variations(cutoff), m.noise, naming.chosen, [found[k] for k in first], rng
    )


def conclude(
    m: Material,
    naming: Naming,
    stress: list[list[Survival]] | None,
    train: Sequence[Samples],
    verify: Sequence[Samples],
    roles: Roles,
    rules: Rules,
    fixed: bool,
    seed: int,
    rng: np.random.Generator,
) -> Diagnosis:
    """Return the diagnosis: refit, rungs of added effects, errors on unseen motion, remainder."""
    titles = {c.family.name: c.family.title for c in naming.chosen}
    order = list(titles)
    rungs = [[c for c in naming.chosen if c.family.name in order[:k]]
             for k in range(len(order) + 1)]  # fmt: skip
    gap, fitted = m.held.gap(rungs), m.held.fitted_gap(rungs)
    errors = gap.relative_error()
    placements = _place(m, naming, stress, rules)
    effects = tuple(
        NamedEffect(
            name, titles[name],
            tuple(p for c, p in zip(naming.chosen, placements, strict=True)
                  if c.family.name == name),
            float(errors[k]), float(errors[k + 1]), gap.interval(k, k + 1, rng),
        )
        for k, name in enumerate(order)
    )  # fmt: skip
    residual = fitted.residual
    remainder = find_remainder(
        m.train, residual[:, :, -1], m.white, m.noise, naming.chosen, m.candidates,
        naming.steps[-1].critical if naming.steps else 8.0, rng,
    )  # fmt: skip
    parts = [Placed([c.part for c in naming.chosen if c.family.name == name]) for name in order]
    joints = m.robot.joints
    return Diagnosis(
        robot=m.robot, base=m.model.names, fixed=fixed, effects=effects,
        error_before=float(fitted.relative_error()[0]),
        error_after=float(fitted.relative_error()[-1]),
        held_before=float(errors[0]), held_after=float(errors[-1]),
        interval=gap.interval(0, len(rungs) - 1, rng), held_kind=f"on {roles.verified_on}",
        discrepancies=tuple(find_discrepancies(m.train, residual[:, :, 0], joints)),
        discrepancies_after=tuple(find_discrepancies(m.train, residual[:, :, -1], joints)),
        aliases=m.aliases, refusals=m.refusals, steps=naming.steps, remainder=remainder,
        model=Model((*m.model.effects, *parts)), samples=tuple(train), validation=tuple(verify),
        gap=gap, curves=tuple(_curves(m, naming, residual[:, :, -1])), rules=rules, seed=seed,
    )  # fmt: skip


def _place(
    m: Material, naming: Naming, stress: list[list[Survival]] | None, rules: Rules
) -> list[Placement]:
    """Return what is known of every named candidate."""
    chosen = naming.chosen
    value, error = solve_values(m.white, m.white.columns(chosen))
    start = m.train.X.shape[2]
    out = []
    for k, c in enumerate(chosen):
        at = slice(start, start + len(c.columns))
        start = at.stop
        added = m.train.D[:, :, list(c.columns)] @ value[at]
        parameters = Placed.part_parameters(m.robot, c.part)
        rivals = find_rivals(m.white, c, [o for o in chosen if o is not c], m.candidates,
                             rules.confusable)  # fmt: skip
        out.append(
            Placement(
                c.place, c.shape, naming.p_values.get(c.group, float("nan")),
                tuple(p.name for p in parameters), tuple(p.unit for p in parameters),
                value[at], error[at], float(np.sqrt(np.mean(added**2, axis=0)).max()),
                tuple(rivals), tuple(stress[k]) if stress else (),
            )
        )  # fmt: skip
    return out


def _curves(m: Material, naming: Naming, residual: Array) -> list[Curve]:
    """Return what each named candidate was learned to be."""
    value, error = solve_values(m.white, m.white.columns(naming.chosen))
    start = m.train.X.shape[2]
    out = []
    for c in naming.chosen:
        at = slice(start, start + len(c.columns))
        start = at.stop
        D = m.train.D[:, :, list(c.columns)]
        added = D @ value[at]
        spread = np.sqrt((D**2) @ error[at] ** 2)
        j = int(np.argmax(np.abs(added).sum(0)))
        position = c.family.name in (
            "position_ripple",
            "joint_stiffness",
            "gravity_tilt",
            "payload",
        )
        x = (m.train.q if position else m.train.dq)[:, j]
        out.append(
            Curve(
                c.family.title, j, "position" if position else "velocity", x, added[:, j],
                spread[:, j], residual[:, j] + added[:, j],
            )
        )  # fmt: skip
    return out
