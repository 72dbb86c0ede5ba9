"""From named candidates to a `Diagnosis`: refit, stress, verify on unseen motion, what is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from identifiability.effects import Placed
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.preparation import Preparation, make_plan
from identifiability.regression.regression import Model
from identifiability.workflows.diagnose.confusable import find_rivals
from identifiability.workflows.diagnose.evidence import solve_values
from identifiability.workflows.diagnose.find import find_discrepancies
from identifiability.workflows.diagnose.held_out import Gap
from identifiability.workflows.diagnose.material import Material
from identifiability.workflows.diagnose.named_effect import Curve, NamedEffect, Placement
from identifiability.workflows.diagnose.naming import Naming, keep_surviving
from identifiability.workflows.diagnose.remainder import find_remainder
from identifiability.workflows.diagnose.result import Diagnosis
from identifiability.workflows.diagnose.roles import Recording, Roles
from identifiability.workflows.diagnose.rows import Rows, build_rows
from identifiability.workflows.diagnose.rules import Rules
from identifiability.workflows.diagnose.stress import (
    Survival,
    Variation,
    list_variations,
    stress_effects,
)
from identifiability.workflows.diagnose.thinning import prepare_thin


def stress_named(
    material: Material,
    naming: Naming,
    logs: Sequence[Recording],
    train: Sequence[Samples],
    preparation: Preparation | None,
    fixed: bool,
    rng: np.random.Generator,
) -> tuple[Naming, list[list[Survival]]]:
    """Make the motion anew; return what survives, and how each of it fares."""
    if not naming.chosen:
        return naming, []
    robot, m = material.structure.robot, material
    how = preparation or Preparation()
    computed = train[0].decimation is not None and "dq" not in logs[0].channels
    cutoff = make_plan(robot, logs[0], how).cutoff if computed else None
    d = train[0].decimation
    factor = None if d is None else d.factor

    def prepare(log: Recording, limit: float | None, change: Callable[[Log], Log]) -> Samples:
        changed = how if limit is None else replace(how, cutoff=limit)
        return prepare_thin(robot, log, replace(changed, decimate=factor), change)

    def build(variation: Variation) -> Rows:
        changed = [variation.build(log, s) for log, s in zip(logs, train, strict=True)]
        return build_rows(m.structure, naming.chosen, changed, fixed)

    found = solve_values(m.white, m.white.columns(naming.chosen))[0][m.train.X.shape[2] :]
    first = np.cumsum([0, *(len(c.columns) for c in naming.chosen)])[:-1]
    survivals = stress_effects(
        build, list_variations(cutoff, prepare, rng), m.noise, naming.chosen,
        [found[k] for k in first], rng,
    )  # fmt: skip
    pairs = list(zip(naming.chosen, survivals, strict=True))
    refuted = [c for c, fares in pairs if any(s.refutes for s in fares)]
    kept = keep_surviving(
        naming,
        refuted,
        m.structure.model.names,
        "it does not survive another preparation of the motion",
    )
    return kept, [fares for c, fares in pairs if c in kept.chosen]


def conclude(
    m: Material,
    naming: Naming,
    stress: list[list[Survival]],
    train: Sequence[Samples],
    verify: Sequence[Samples],
    roles: Roles,
    rules: Rules,
    fixed: bool,
    seed: int,
    rng: np.random.Generator,
) -> Diagnosis:
    """Return the diagnosis: refit, rungs of added effects, errors on unseen motion, remainder."""
    naming, stress, found, refuted = _keep_verified(m, naming, stress, rules, rng)
    gap, fitted, errors, real = found.gap, found.fitted, found.errors, found.real
    residual = fitted.residual
    remainder = find_remainder(
        m.train, residual[:, :, -1], m.white, m.noise, naming.chosen, m.candidates,
        naming.steps[-1].critical if naming.steps else 8.0, rng,
    )  # fmt: skip
    parts = [
        Placed([c.part for c in naming.chosen if c.family.name == e.name]) for e in found.effects
    ]
    joints = m.structure.robot.joints
    return Diagnosis(
        structure=m.structure, fixed=fixed, effects=found.effects, refuted=refuted,
        error_before=float(fitted.relative_error()[0]),
        error_after=float(fitted.relative_error()[-1]),
        held_before=float(errors[0]), held_after=float(errors[-1]),
        interval=gap.interval(0, len(errors) - 1, rng), real_before=float(real[0]),
        real_after=float(real[-1]), chosen_by=roles.chosen_by, verified_on=roles.verified_on,
        discrepancies=tuple(find_discrepancies(m.train, residual[:, :, 0], joints)),
        discrepancies_after=tuple(find_discrepancies(m.train, residual[:, :, -1], joints)),
        aliases=m.aliases, refusals=m.refusals, steps=naming.steps, remainder=remainder,
        model=Model((*m.structure.model.effects, *parts)), samples=tuple(train),
        validation=tuple(verify),
        gap=gap, curves=tuple(_curves(m, naming, residual[:, :, -1])), rules=rules, seed=seed,
    )  # fmt: skip


@frozen
class _Verified:
    """What adding each family does, on fitted motion and on the motion that verifies.

    `errors` and `real` are ε_RA before and after each family, the latter of real robots.
    """

    effects: tuple[NamedEffect, ...]
    gap: Gap
    fitted: Gap
    errors: Array
    real: Array


def _keep_verified(
    m: Material,
    naming: Naming,
    stress: list[list[Survival]],
    rules: Rules,
    rng: np.random.Generator,
) -> tuple[Naming, list[list[Survival]], _Verified, tuple[NamedEffect, ...]]:
    """Take out, one after the other, what the motion that verifies surely contradicts."""
    refuted: list[NamedEffect] = []
    while True:
        found = _verify(m, naming, stress, rules, rng)
        worst = max(
            (e for e in found.effects if e.refuted), key=lambda e: e.interval[0], default=None
        )
        if worst is None:
            return naming, stress, found, tuple(refuted)
        refuted.append(worst)
        gone = [c for c in naming.chosen if c.family.name == worst.name]
        kept = keep_surviving(
            naming, gone, m.structure.model.names, "the motion that verifies contradicts it"
        )
        pairs = zip(naming.chosen, stress, strict=True)
        naming, stress = kept, [fares for c, fares in pairs if c in kept.chosen]


def _verify(
    m: Material,
    naming: Naming,
    stress: list[list[Survival]],
    rules: Rules,
    rng: np.random.Generator,
) -> _Verified:
    """Return every named family with its errors on the motion that verifies."""
    titles = {c.family.name: c.family.title for c in naming.chosen}
    order = list(titles)
    rungs = [[c for c in naming.chosen if c.family.name in order[:k]]
             for k in range(len(order) + 1)]  # fmt: skip
    gap, fitted = m.held.gap(rungs), m.held.fitted_gap(rungs)
    errors = gap.relative_error()
    real = np.full(len(rungs), np.nan)
    if m.held.real is not None:
        real = m.held.gap(rungs, real=True).relative_error()
    placements = _place(m, naming, stress, rules)
    effects = tuple(
        NamedEffect(
            name, titles[name],
            tuple(p for c, p in zip(naming.chosen, placements, strict=True)
                  if c.family.name == name),
            float(errors[k]), float(errors[k + 1]), gap.interval(k, k + 1, rng),
            (float(real[k]), float(real[k + 1])),
        )
        for k, name in enumerate(order)
    )  # fmt: skip
    return _Verified(effects, gap, fitted, errors, real)


def _place(
    m: Material, naming: Naming, stress: list[list[Survival]], rules: Rules
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
        parameters = Placed.part_parameters(m.structure.robot, c.part)
        rivals = find_rivals(m.white, c, [o for o in chosen if o is not c], m.candidates,
                             rules.confusable)  # fmt: skip
        out.append(
            Placement(
                c.place, c.shape, naming.p_values.get(c.group, float("nan")),
                tuple(p.name for p in parameters), tuple(p.unit for p in parameters),
                value[at], error[at], float(np.sqrt(np.mean(added**2, axis=0)).max()),
                tuple(rivals), tuple(stress[k]),
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
        x = {"velocity": m.train.dq[:, j], "position": m.train.q[:, j], "time": m.train.t,
             "load": m.train.measured[:, j]}[c.family.against]  # fmt: skip
        out.append(
            Curve(
                c.family.title, j, c.family.against, x, added[:, j],
                spread[:, j], residual[:, j] + added[:, j],
            )
        )  # fmt: skip
    return out
