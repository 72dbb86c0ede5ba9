"""Name what is missing: forward selection with family-wise error, backward elimination, gates.

At each step every option (a family at one place, or at all its places) is scored beside the
current model; the largest score is compared with the largest that simulated noise reaches over
the same options and shapes [Westfall & Young 1993]. After each addition every choice is searched
again. What does not predict motion better that did not choose it is taken out at the end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identifiability.workflows.diagnose.evidence import Bench, Scores, Whitened, score_candidates
from identifiability.workflows.diagnose.gates import (
    Naming,
    Step,
    has_place,
    keep_possible,
    keep_useful,
    keep_where,
)
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.lookalikes import DECISIVE
from identifiability.workflows.diagnose.material import Rules
from identifiability.workflows.diagnose.one_joint import find_in_one_joint
from identifiability.workflows.diagnose.options import (
    EVERYWHERE,
    best_by_group,
    list_options,
    price,
    signature,
)
from identifiability.workflows.diagnose.rows import Candidate, Present
from identifiability.workflows.diagnose.whole import find_whole, measure_reach

#: Rounds in which shapes are searched again after an addition.
ROUNDS = 3
Say = Callable[[str, float], None]


@dataclass
class Selection:
    """What is chosen so far, and how it is gone on from."""

    bench: Bench
    candidates: Sequence[Candidate]
    held: HeldOut
    rules: Rules
    present: Present
    white: Whitened = field(init=False)
    chosen: list[Candidate] = field(default_factory=list)
    barred: set[tuple[str, str]] = field(default_factory=set)
    needed: dict[tuple[str, str], float] = field(default_factory=dict)
    p_values: dict[tuple[str, str], float] = field(default_factory=dict)
    steps: list[Step] = field(default_factory=list)
    joined: set[str] = field(default_factory=set)
    #: Most p-value with which a name goes on, where that is more than its level.
    asked: float = 0.0

    def eligible(self, beside: Sequence[Candidate]) -> list[Candidate]:
        """Return what may stand beside some choices: not yet there, and what it refines is."""
        taken = signature(beside)
        return [
            c for c in self.candidates if c.slot not in taken and has_place(c, beside, self.present)
        ]

    def score(self, beside: Sequence[Candidate], options: Sequence[Candidate]) -> Scores:
        """Return the scores of options beside some choices."""
        return score_candidates(self.white, self.white.basis(beside), options, null=False)

    def level(self, draws: int) -> float:
        """Return the family-wise level of the next name.

        The first one is asked whether anything is missing at all. Whether there is a second cause
        beside one is a question between two models, as that between two names is, and takes what
        decides there, or the most that so many draws can say.
        """
        decisive = max(float(np.exp(-DECISIVE)), 1.0 / (1 + draws))
        return min(self.rules.level, decisive) if self.chosen else self.rules.level

    def step(self) -> bool:
        """Try to add one effect; return whether one was added."""
        options = [
            o for o in list_options(self.eligible(self.chosen)) if o.group not in self.barred
        ]
        if not options:
            return False
        self.whiten(self.chosen)
        scores = score_candidates(self.white, self.white.basis(self.chosen), options)
        highest, top = scores.null.max(0), float(scores.data.max())
        if top == -np.inf:  # all that could be added is in the model already
            return False
        p = float((1 + np.count_nonzero(highest >= top)) / (1 + len(highest)))
        level = self.level(len(highest))
        critical = float(np.quantile(highest, 1 - level))
        # Of what stands out from the noise, the best fit for its columns at a place has the name;
        # a family is everywhere where that explains decisively more than it does at one place.
        everywhere = np.array([bool(o.members) for o in options])
        fit = (scores.fit - DECISIVE * everywhere) / np.array([price(o) for o in options])
        best = options[int(np.argmax(np.where(scores.data >= min(critical, top), fit, -np.inf)))]
        step = Step(
            evidence=best_by_group(options, scores.data),
            critical=critical,
            best=best.group,
            p_value=p,
            reason="no candidate stands out from the noise",
        )
        if p > max(level, self.asked):
            self.steps.append(step)
            return False
        if p > level:
            critical = float(np.quantile(highest, 1 - self.asked))
        members = best.members or (best,)
        # A member of a family that was added everywhere needs to stand out among these only.
        limit = float(-np.log(level / len(members))) if best.members else critical
        for c in members:
            self.needed[c.group] = min(limit, self.needed.get(c.group, limit))
            self.p_values[c.group] = min(p, self.p_values.get(c.group, p))
        trial = self.improve([*self.chosen, *members], critical)
        for c in trial:
            self.p_values.setdefault(c.group, p)
        before, after = self.held.error(self.chosen), self.held.error(trial)
        useful = True
        if best.members and after > before:
            trial = self.keep_where_useful(trial, members)
            after = self.held.error(trial)
            useful = after < before
            if not useful:
                trial, after = self.chosen, before
                self.barred.update(c.group for c in members)
        new = signature(trial) != signature(self.chosen)
        reason = "" if new else "what it adds is explained better by what is there"
        if not useful:
            reason = "it does not predict unseen motion better"
        self.steps.append(replace(step, gain=(before - after) / before, reason=reason))
        self.chosen = trial
        return new or not useful

    def keep_where_useful(
        self, trial: Sequence[Candidate], members: Sequence[Candidate]
    ) -> list[Candidate]:
        """Take a family that was added everywhere away again where it predicts no better."""
        groups = {c.group for c in members}
        new = [c for c in trial if c.group in groups]
        old = [c for c in trial if c.group not in groups]
        return [*old, *keep_where(self.held, old, new, self.rules)]

    def whiten(self, chosen: Sequence[Candidate]) -> None:
        """Weigh the rows by the noise and by what the model with some choices leaves."""
        self.white = self.bench.whiten(self.bench.misfit(self.held.fitted_residual(chosen)))

    def improve(self, chosen: list[Candidate], critical: float) -> list[Candidate]:
        """Search shapes again, one choice at a time, and drop what is no longer needed."""
        for _ in range(ROUNDS):
            before = list(chosen)
            for c in before:
                rest = [other for other in chosen if other is not c]
                options = [o for o in self.eligible(rest) if o.slot == c.slot]
                if not options:  # what it refines has gone
                    chosen = rest
                    continue
                scores = self.score(rest, options)
                at = int(np.argmax(scores.fit))
                if scores.data[at] < self.needed.get(c.group, critical):
                    chosen = rest
                else:
                    chosen = [options[at] if other is c else other for other in chosen]
            if [id(c) for c in chosen] == [id(c) for c in before]:
                break
        return chosen

    def leave_circle(self) -> bool:
        """Bar the last addition that predicted worse and led back; return whether there is one."""
        worse = [s.best for s in self.steps if s.gain <= 0 and s.best not in self.barred]
        self.barred.update(worse[-1:])
        return bool(worse)

    def join(self) -> None:
        """Give one name to what several say, and the name to who decisively says it better."""
        reach = measure_reach(self.bench.rows.D)
        for _ in range(self.rules.most):
            found = find_whole(
                self.chosen, self.eligible, reach, self.score, self.held, self.rules.gain
            )
            if found is None:
                break
            whole, parts = found
            known = [self.p_values[c.group] for c in parts if c.group in self.p_values]
            if known:
                self.p_values[whole.group] = max(known)
            self.needed[whole.group] = max(self.needed.get(c.group, 0.0) for c in parts)
            self.joined.update(c.family.name for c in parts)
            self.chosen = [*(c for c in self.chosen if c not in parts), whole]

    def use(self) -> list[Candidate]:
        """Keep what predicts better and stands out beside the rest; return it."""
        for _ in range(ROUNDS):
            self.chosen = keep_useful(self.held, self.chosen, self.rules)
            self.tidy()
        return self.chosen

    def tidy(self) -> None:
        """Drop what no longer stands out beside the rest, or has a sign that cannot be."""
        for c in list(self.chosen):
            rest = [other for other in self.chosen if other is not c]
            score = float(self.score(rest, [c]).data[0])
            if score < self.needed.get(c.group, 0.0) or c not in self.eligible(rest):
                self.chosen = rest

    def in_one_joint(self) -> set[tuple[str, str]]:
        """Return what acts in several joints where one of these alone has the cause.

        Where several places of a family were needed others would do as well: it is all of them.
        """
        found = find_in_one_joint(self.white, self.chosen, self.rules.level)
        groups = {c.group for c in found}
        names = [name for name, _ in groups]
        several = {name for name in names if names.count(name) > 1}
        return groups | {c.group for c in self.candidates if c.family.name in several}


def name_effects(
    bench: Bench,
    candidates: Sequence[Candidate],
    held: HeldOut,
    rules: Rules,
    present: Present = (),
    say: Say | None = None,
    start: Sequence[Candidate] = (),
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
    present : collection of (family, place)
        What the base model has.
    say : callable, optional
    start : sequence of Candidate
        What is named already; what is added may make it needless.
    """
    search = Selection(bench, candidates, held, rules, present, chosen=list(start))
    best, waited = list(search.chosen), 0
    seen = [signature(search.chosen)]
    for k in range(rules.most):
        if say is not None:
            say(f"naming, step {k + 1}", 0.4 + 0.4 * k / (k + 3))
        go_on = search.step()
        better = held.improves(best, search.chosen)
        waited = 0 if better else waited + 1
        if better:
            best = list(search.chosen)
        now = signature(search.chosen)
        if not go_on or waited >= rules.patience or (now in seen and not search.leave_circle()):
            break
        seen.append(now)
    search.chosen = best
    search.whiten(best)
    search.join()
    useful = search.use()
    search.chosen = keep_possible(held, useful, candidates, rules)
    search.use()  # what is left must be useful without what has gone, too
    alone = search.in_one_joint()
    if alone:
        # From the beginning: what stood out beside it may have been its error in other joints.
        options, begin = ([c for c in some if c.group not in alone] for some in (candidates, start))
        again = name_effects(bench, options, held, rules, present, say, begin)
        why = {name: "one of its joints has it, and the others do not" for name, _ in alone}
        tried = tuple(judge_step(step, (), why) for step in search.steps if step.best[0] in why)
        refused = (*(c for c in search.chosen if c.group in alone), *again.refused)
        return replace(again, steps=(*tried, *again.steps), refused=refused)
    why = dict.fromkeys(search.joined, "another effect explains what it does")
    withdrawn = [c.family.name for c in useful if c not in search.chosen]
    why |= dict.fromkeys(withdrawn, "its gain vanishes once bodies must be possible")
    steps = tuple(judge_step(step, search.chosen, why) for step in search.steps)
    return Naming(tuple(search.chosen), dict(search.p_values), steps)


def judge_step(step: Step, chosen: Sequence[Candidate], why: Mapping[str, str]) -> Step:
    """Return a step with what became of its effect."""
    if step.reason:
        return step
    there = {c.group for c in chosen} | {(c.family.name, EVERYWHERE) for c in chosen}
    if step.best in there:
        return replace(step, accepted=True, reason="named")
    return replace(step, reason=why.get(step.best[0], "it does not predict unseen motion better"))
