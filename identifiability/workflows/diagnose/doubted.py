"""A name that the fitted motion leaves in doubt, for the motion that verifies to decide.

What is half as large as the noise is missed by a step whose p-value is .1, and more often by gates
on errors that slow noise hides, though unseen motion shows it beyond doubt. So where nothing is
named one name goes on: `Both` divides its p-value by the likelihood ratio of the motion that
verifies [Vovk & Wang 2021; Ignatiadis, Wang & Ramdas 2024]. It is that of the fitted motion for two
ways to be given, never less than two levels, so that unseen motion must speak for it by two to one;
and one where what chooses is not predicted better, as if the fitted motion had said nothing but
which name it is.
"""

from collections.abc import Sequence
from dataclasses import replace

from identifiability.workflows.diagnose.evidence import Bench
from identifiability.workflows.diagnose.gates import Naming
from identifiability.workflows.diagnose.give_back import WAYS
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.material import Rules
from identifiability.workflows.diagnose.naming import Selection, judge_step
from identifiability.workflows.diagnose.rows import Candidate, Present

#: Most p-value with which a name goes on: beyond it noise alone does better more often than not.
EVEN = 0.5


def name_doubted(
    bench: Bench,
    candidates: Sequence[Candidate],
    held: HeldOut,
    rules: Rules,
    present: Present = (),
) -> Naming:
    """Return the name at one place that explains most, for unseen motion to decide.

    It keeps its p-value where that is at the level and what chooses surely speaks for it: a name of
    the first pass that only the noise of the second lets stand out. Elsewhere it is in doubt.

    None where no motion verifies.

    Parameters
    ----------
    bench, candidates, held, rules, present
        As for `name_effects`.
    """
    if held.verifying is None:
        return Naming((), {}, ())
    search = Selection(bench, candidates, held, rules, present, asked=EVEN)
    search.step()
    search.join()
    steps = tuple(judge_step(step, search.chosen, {}) for step in search.steps)
    found = Naming(tuple(search.chosen), dict(search.p_values), steps)
    # At several places it would have several chances.
    if len(found.chosen) != 1 or search.in_one_joint():
        return replace(found, chosen=())
    # What every joint has need not prove itself in a real robot, as in `gates.keep_possible`.
    (one,) = found.chosen
    special = not one.family.basic
    gains = [held.gain([], found.chosen, real=real) for real in {False, special}]
    p = found.p_values[one.group]
    if p <= rules.level and all(gain.share > max(rules.gain, gain.error) for gain in gains):
        return found
    better = all(gain.share > rules.gain for gain in gains)
    p = min(WAYS * max(p, rules.level), 1.0) if better else 1.0
    return replace(found, p_values={**found.p_values, one.group: p})
