"""What `prune` answers: the models of the reduction path, and which one to use."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from identifiability.estimation.verdict import Class
from identifiability.foundation.answers import Answer, Cell, Note, Table
from identifiability.foundation.rounding import format_count, format_number, percent_text

from .analyze import LadderedPresenter, count_kinds, error_tables, model_row
from .common import answer, join_sentences, note, sentence
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
        path = path if result.validation else path.without("held out")
        return (path, *error_tables(result))

    def answer_use(self) -> Answer:
        """Return which model is worth using."""
        result = self.result
        about = "pruning.use"
        chosen = result.chosen
        size = len(result.full)
        if result.nothing:
            text = sentence(about, "because", why=result.nothing)
            return answer(about, "nothing", text, size=size)
        wrong = chosen.infeasible
        used = len(chosen)
        errors = {"before": result.full.error_ra_validation, "after": chosen.error_ra_validation}
        motion = "held-out logs" if result.validation else "left-out stretches"
        counts = {"size": size, "used": used, "dropped": size - used}
        holes: dict[str, Any] = {**counts, **errors, "motion": motion}
        part = "some" if used < size else "all"
        found = sentence(about, "found", found=chosen.count(Class.IDENTIFIABLE), used=used)
        signs = sentence(about, "impossible", names=wrong) if wrong else ""
        text = join_sentences(_state_dropped(result), found, signs)
        tone = "green" if chosen.feasible else "amber"
        return answer(about, part, text, tone, **holes)

    def notes(self) -> Iterator[Note]:
        """Yield the caveats, and whether the choice is stable."""
        yield from super().notes()
        weight = self.result.chosen.weight
        yield note("stable" if weight > 0.5 else "unstable", weight=weight)


def _state_dropped(result: Ladder) -> str:
    """Return how many parameters of each kind the model to use has no more."""
    kept = {*result.chosen.submodel.columns}
    lost = [name for name in result.full.submodel.columns if name not in kept]
    each = [format_count(number, kind) for kind, number in count_kinds(lost).most_common()]
    return sentence("pruning.use", "dropped", each=each) if each else ""


def _move_row(r: PrunedModel) -> dict[str, Any]:
    """Return a model of the path, and the move that led to it, as one row of a table."""
    move = r.step.move
    worst = r.worst_sigma_percent
    text = f"{move.kind.value}: {move.text}" if move is not None else r.name
    condition = f"condition {format_number(r.estimate.condition, 3)}"
    worst_cell = Cell(percent_text(worst), worst, condition)
    cells = {
        "move": Cell(text, note=r.reason),
        "worst": worst_cell,
    }
    return model_row(r) | cells
