"""What `prune` answers: the models of the reduction path, and which one to use."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from identifiability.estimation.evidence import LEVELS, may_stand
from identifiability.estimation.verdict import Class
from identifiability.foundation.answers import Answer, Cell, Note, Table
from identifiability.foundation.rounding import format_number, percent_text

from .analyze import LadderedPresenter, error_tables, is_nearly_real, model_row, state_nearest
from .common import answer, capital, join_sentences, note, sentence
from .tables import make_table

if TYPE_CHECKING:
    from identifiability.workflows.prune.result import Ladder, PrunedModel


class LadderPresenter(LadderedPresenter):
    """Answers of `prune`."""

    verb = "prune"

    result: Ladder

    def tables(self) -> tuple[Table, ...]:
        """Return the models of the path, and the errors of the one to use by joint and by log."""
        result = self.result
        path = make_table("moves", map(_move_row, result.models), result.selected)
        path = replace(path, best=result.least)
        path = path if result.validation else path.without("held out")
        return (path, *error_tables(result))

    def answer_use(self) -> Answer:
        """Return which model is worth using, and the rule that chose it."""
        result = self.result
        about = "pruning.use"
        chosen = result.chosen
        size = len(result.full)
        if result.nothing:
            text = sentence(about, "because", why=result.nothing)
            return answer(about, "nothing", text, size=size)
        used = len(chosen)
        part = "some" if used < size else "all"
        wrong = chosen.infeasible
        signs = sentence(about, "impossible", names=wrong) if wrong else ""
        near = "" if is_nearly_real(chosen) else state_nearest(chosen)
        identifiable = sentence(about, "found", found=chosen.count(Class.IDENTIFIABLE))
        text = join_sentences(identifiable, signs, near)
        # What the model lacks is the answer on trust.
        tone = "blue" if is_nearly_real(chosen) else "amber"
        told = answer(about, part, text, tone, size=size, used=used)
        if used < size:
            told = replace(told, more=_state_choice(result))
        return told

    def notes(self) -> Iterator[Note]:
        """Yield the caveats, and that the choice is stable if it is."""
        yield from super().notes()
        weight = self.result.chosen.weight
        if weight > 0.5:
            yield note("stable", weight=weight)


def _state_choice(result: Ladder) -> str:
    """Return why the model to use was chosen, by which rule, and the sizes of models as good."""
    chosen = result.chosen
    best = result.models[result.least]
    sizes = sizes_as_good(result)
    others = sentence("pruning.use", "others", low=sizes[0], high=sizes[1]) if sizes else ""
    if len(chosen) == len(best):
        return join_sentences(sentence("pruning.choice", "best"), others)
    lower = best.density - chosen.density
    part = "physical"
    if may_stand(chosen.step.score, best.step.score):
        part = "near" if lower <= LEVELS.nats else "rise"
    rule = sentence("pruning.choice", part, lower=lower, nats=LEVELS.nats, rise=LEVELS.rise)
    why = sentence("pruning.choice", "smallest", best=len(best))
    return join_sentences(why, rule, others)


def sizes_as_good(result: Ladder) -> tuple[int, ...]:
    """Return the least and largest size of models that pass the rule of the choice.

    Nothing if only the model to use does.
    """
    best = result.models[result.least].step.score
    good = {len(m) for m in result.models if may_stand(m.step.score, best)}
    good.add(len(result.chosen))
    return (min(good), max(good)) if len(good) > 1 else ()


def _move_row(r: PrunedModel) -> dict[str, Any]:
    """Return a model of the path, and the move that led to it, as one row of a table."""
    move = r.step.move
    worst = r.worst_sigma_percent
    text = capital(r.name)
    if move is not None:
        # A drop has no reason beyond its cost, which the lead of the table states.
        text = f"{capital(move.kind.value)}: {move.text}" if move.why else move.text
    why = "" if move is not None and not move.why else r.reason
    condition = f"condition {format_number(r.estimate.condition, 3)}"
    worst_cell = Cell(percent_text(worst), worst, condition)
    used = int(r.physical_used)
    cells = {
        "move": Cell(text, note=why),
        "error_ra_unseen": float(r.crossed.relative_error()[used]),
        "worst": worst_cell,
    }
    return model_row(r) | cells
