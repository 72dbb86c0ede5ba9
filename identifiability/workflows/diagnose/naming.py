"""Name what is missing: forward selection with family-wise error, backward elimination, gates.

At each step every option (a family at one place, or at all its places) is scored beside the
current model; the largest score is compared with the largest that simulated noise reaches over
the same options and shapes [Westfall & Young 1993]. After each addition every choice is searched
again. What does not predict motion better that did not choose it is taken out at the end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.evidence import Bench, Whitened, score_candidates
from identifiability.workflows.diagnose.gates import keep_possible, keep_useful
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.rules import Rules, Step

#: Rounds in which shapes are searched again after an addition.
ROUNDS = 3
#: Price of an effect that only some joints have, beside one that every joint has.
SPECIAL = 1.5
#: The place of an option that is in all places of its family.
EVERYWHERE = "all joints"

Say = Callable[[str, float], None]


@frozen
class Naming:
    """The outcome: candidates in order of addition, their p-values, and every step."""

    chosen: tuple[Candidate, ...]
    p_values: dict[tuple[str, str], float]
    steps: tuple[Step, ...]


@frozen
class Option:
    """What a step can add: one candidate, or a family in all its places.

    Attributes
    ----------
    members : tuple of Candidate
    scored : Candidate
        The columns of all members together.
    """

    members: tuple[Candidate, ...]
    scored: Candidate

    @property
    def group(self) -> tuple[str, str]:
        """Family and place."""
        return self.scored.group

    @property
    def price(self) -> float:
        """What its fit is divided by: columns at a place, and more for what is not in every joint.

        Between two that explain about the same, the simpler one goes first; it is dropped again if
        the other one turns out to be needed in its stead.
        """
        return len(self.scored.kinds) * (1.0 if self.scored.family.basic else SPECIAL)


def list_options(candidates: Sequence[Candidate]) -> list[Option]:
    """Return every candidate by itself, then every family and shape in all its places."""
    out = [Option((c,), c) for c in candidates]
    shared: dict[tuple[str, tuple[str, ...], int], list[Candidate]] = {}
    count: dict[tuple[str, str, tuple[str, ...]], int] = {}
    for c in candidates:
        at = count[*c.group, c.kinds] = count.get((*c.group, c.kinds), -1) + 1
        shared.setdefault((c.family.name, c.kinds, at), []).append(c)
    for members in shared.values():
        if len(members) > 1:
            columns = tuple(k for c in members for k in c.columns)
            scored = replace(members[0], place=EVERYWHERE, columns=columns)
            out.append(Option(tuple(members), scored))
    return out


@dataclass
class _Search:
    bench: Bench
    white: Whitened
    candidates: Sequence[Candidate]
    held: HeldOut
    rules: Rules
    present: frozenset[str]
    chosen: list[Candidate] = field(default_factory=list)
    needed: dict[tuple[str, str], float] = field(default_factory=dict)
    p_values: dict[tuple[str, str], float] = field(default_factory=dict)
    steps: list[Step] = field(default_factory=list)

    def eligible(self, beside: Sequence[Candidate]) -> list[Candidate]:
        """Return what may stand beside some choices: not yet there, and what it refines is."""
        taken = {(*c.group, c.kinds) for c in beside}
        groups = {c.group for c in beside}
        return [
            c
            for c in self.candidates
            if (*c.group, c.kinds) not in taken
            and (
                not c.family.needs
                or c.family.needs in self.present
                or (c.family.needs, c.place) in groups
            )
        ]

    def step(self) -> bool:
        """Try to add one effect; return whether one was added."""
        options = list_options(self.eligible(self.chosen))
        if not options:
            return False
        residual = self.held.fitted_residual(self.chosen)
        self.white = self.bench.whiten(self.bench.misfit(residual))
        model = self.white.columns(self.chosen)
        scores = score_candidates(self.white, model, [o.scored for o in options])
        highest, top = scores.null.max(0), float(scores.data.max())
        if top == -np.inf:  # all that could be added is in the model already
            return False
        p = float((1 + np.count_nonzero(highest >= top)) / (1 + len(highest)))
        critical = float(np.quantile(highest, 1 - self.rules.level))
        # Of what stands out from the noise, the best fit for its columns at a place has the name.
        price = np.array([o.price for o in options])
        fit = np.where(scores.data >= min(critical, top), scores.fit / price, -np.inf)
        best = options[int(np.argmax(fit))]
        step = Step(
            best_by_group(options, scores.data), critical, best.group, p, float("nan"), False,
            "no candidate stands out from the noise",
        )  # fmt: skip
        if p > self.rules.level:
            self.steps.append(step)
            return False
        # A member of a family that was added everywhere needs to stand out among these only.
        several = len(best.members) > 1
        limit = float(-np.log(self.rules.level / len(best.members))) if several else critical
        for c in best.members:
            self.needed[c.group] = min(limit, self.needed.get(c.group, limit))
            self.p_values[c.group] = min(p, self.p_values.get(c.group, p))
        trial = self.improve([*self.chosen, *best.members], critical)
        for c in trial:
            self.p_values.setdefault(c.group, p)
        before, after = self.held.error(self.chosen), self.held.error(trial)
        new = signature(trial) != signature(self.chosen)
        reason = "" if new else "what it adds is explained better by what is there"
        self.steps.append(replace(step, gain=(before - after) / before, reason=reason))
        self.chosen = trial
        return new

    def improve(self, chosen: list[Candidate], critical: float) -> list[Candidate]:
        """Search shapes again, one choice at a time, and drop what is no longer needed."""
        for _ in range(ROUNDS):
            before = list(chosen)
            for c in before:
                rest = [other for other in chosen if other is not c]
                options = [
                    o for o in self.eligible(rest) if (*o.group, o.kinds) == (*c.group, c.kinds)
                ]
                if not options:  # what it refines has gone
                    chosen = rest
                    continue
                scores = score_candidates(self.white, self.white.columns(rest), options, null=False)
                at = int(np.argmax(scores.fit))
                if scores.data[at] < self.needed.get(c.group, critical):
                    chosen = rest
                else:
                    chosen = [options[at] if other is c else other for other in chosen]
            if len(chosen) == len(before) and all(
                a is b for a, b in zip(chosen, before, strict=True)
            ):
                break
        return chosen

    def tidy(self) -> None:
        """Drop what no longer stands out beside the rest, or has a sign that cannot be."""
        for c in list(self.chosen):
            rest = [other for other in self.chosen if other is not c]
            model = self.white.columns(rest)
            score = float(score_candidates(self.white, model, [c], null=False).data[0])
            if score < self.needed.get(c.group, 0.0) or c not in self.eligible(rest):
                self.chosen = rest


def signature(chosen: Sequence[Candidate]) -> set[tuple[str, str, tuple[str, ...]]]:
    """Return what is in a set of candidates, whatever the shapes."""
    return {(*c.group, c.kinds) for c in chosen}


def best_by_group(options: Sequence[Option], scores: Array) -> dict[tuple[str, str], float]:
    """Return the best score of every family and place."""
    out: dict[tuple[str, str], float] = {}
    for o, s in zip(options, scores, strict=True):
        out[o.group] = max(out.get(o.group, 0.0), float(s))
    return out


def name_effects(
    bench: Bench,
    candidates: Sequence[Candidate],
    held: HeldOut,
    rules: Rules,
    present: Iterable[str] = (),
    say: Say | None = None,
) -> Naming:
    """Return the effects that the data name.

    Parameters
    ----------
    bench : Bench
    candidates : sequence of Candidate
        Without the structurally aliased ones.
    held : HeldOut
        Errors on motion that did not choose.
    rules : Rules
    present : iterable of str
        Families that the base model has at every place.
    say : callable, optional
    """
    search = _Search(bench, bench.whiten(), candidates, held, rules, frozenset(present))
    best, least, waited = list(search.chosen), held.error((), real=True), 0
    seen = [signature(search.chosen)]
    for k in range(rules.most):
        if say is not None:
            say(f"naming, step {k + 1}", 0.4 + 0.4 * k / (k + 3))
        go_on = search.step()
        error = held.error(search.chosen, real=True)
        waited = 0 if error < least else waited + 1
        if error < least:
            best, least = list(search.chosen), error
        now = signature(search.chosen)
        if not go_on or waited >= rules.patience or now in seen:
            break
        seen.append(now)
    search.chosen = best
    search.white = bench.whiten(bench.misfit(held.fitted_residual(best)))
    for _ in range(ROUNDS):
        search.chosen = keep_useful(held, search.chosen, rules)
        search.tidy()
    useful = search.chosen
    search.chosen = keep_possible(held, useful, candidates, rules)
    search.tidy()
    withdrawn = tuple(c for c in useful if c not in search.chosen)
    return Naming(tuple(search.chosen), dict(search.p_values), _judged(search, withdrawn))


def keep_surviving(
    naming: Naming, refuted: Sequence[Candidate], present: Iterable[str], reason: str
) -> Naming:
    """Return a naming without candidates that are refuted, and without what only refines them.

    Parameters
    ----------
    naming : Naming
    refuted : sequence of Candidate
    present : iterable of str
        Families that the base model has at every place.
    reason : str
        What refutes them, for the steps that named them.
    """
    kept = [c for c in naming.chosen if c not in refuted]
    there = {c.group for c in kept}
    kept = [
        c
        for c in kept
        if not c.family.needs or c.family.needs in present or (c.family.needs, c.place) in there
    ]
    lost = {c.family.name for c in naming.chosen} - {c.family.name for c in kept}
    steps = tuple(
        replace(s, accepted=False, reason=reason) if s.accepted and s.best[0] in lost else s
        for s in naming.steps
    )
    return Naming(tuple(kept), naming.p_values, steps)


def _judged(search: _Search, withdrawn: Sequence[Candidate]) -> tuple[Step, ...]:
    """Return the steps with what became of their effect."""
    there = {c.group for c in search.chosen}
    families = {c.family.name for c in search.chosen}
    out = []
    for step in search.steps:
        name, place = step.best
        kept = step.best in there or (place == EVERYWHERE and name in families)
        reason = step.reason
        if not reason:
            reason = "named" if kept else "it does not predict unseen motion better"
            if not kept and name in {c.family.name for c in withdrawn}:
                reason = "its gain vanishes once bodies must be possible"
        out.append(replace(step, accepted=kept and step.reason == "", reason=reason))
    return tuple(out)
