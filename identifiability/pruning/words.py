"""Pruning in words and as a ladder file."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from identifiability.errors import listing
from identifiability.pruning.elimination import Step
from identifiability.pruning.moves import Kind
from identifiability.verdict import Class

if TYPE_CHECKING:
    from identifiability.pruning.result import Ladder


def explain(step: Step) -> str:
    """Return why a move was made."""
    move, evidence = step.move, step.evidence
    if move is None or evidence is None:
        return f"{move.why}." if move is not None else "Every base parameter of the model."
    rise = _rise(evidence.rise, evidence.rise_se)
    if move.kind is Kind.FORCED:
        return f"{move.why}; {rise}."
    if move.kind is Kind.DROP:
        text = (
            "Not significant" if evidence.p_value > 0.05 else "The least costly of what is left"
        ) + f" (p = {evidence.p_value:.2g}); {rise}."
        if evidence.either:
            text += (
                f" These logs hardly tell it from {evidence.either}: either of the two can stand "
                "for both."
            )
        return text
    if evidence.p_value > 0.05:
        verdict = "the data do not contradict it"
    elif evidence.rise <= evidence.rise_se:
        verdict = "the difference is significant but does not help on unseen motion"
    else:
        verdict = "the data speak against it, but not clearly enough to refuse it"
    return f"{move.why}; {verdict} (p = {evidence.p_value:.2g}); {rise}."


def _rise(rise: float, spread: float) -> str:
    change = "rises" if rise > 0 else "falls"
    change = change.removesuffix("s")
    return f"the held-out squares {change} by {100 * abs(rise):.3g} ± {100 * spread:.3g} %"


def statement(ladder: Ladder) -> str:
    """Return the answer in plain words."""
    chosen, full = ladder.chosen, ladder.full
    if not len(chosen):
        return (
            "Nothing can be identified from these logs: no parameter of the model predicts torque "
            "that it was not fitted to better than zero does."
        )
    if len(chosen) == len(full):
        text = (
            f"Nothing was pruned: each of the {len(full)} parameters of the model is needed to "
            "predict motion that the fit has not seen."
        )
    else:
        text = (
            f"Of {len(full)} parameters {len(chosen)} are worth using: "
            f"{listing(chosen.columns, 14)}. "
            f"{_identifiable(ladder)}. They predict unseen motion with an error of "
            f"{_percent(chosen.error_ra_unseen)}, the unpruned model with "
            f"{_percent(full.error_ra_unseen)}."
        )
    if np.isfinite(chosen.error_ra_validation):
        text += (
            f" On the logs held out for validation it is "
            f"{_percent(chosen.error_ra_validation)} against {_percent(full.error_ra_validation)}."
        )
    if ladder.feasible:
        return text + " A real robot can have its values."
    near = f"the nearest real robot errs by {_percent(ladder.result.error_ra_physical)}."
    if ladder.result.infeasible:
        return text + f" But {listing(ladder.result.infeasible, 4)} cannot be negative; {near}"
    return text + f" But no real robot has exactly its values; {near}"


def _identifiable(ladder: Ladder) -> str:
    if ladder.result.unjudged:
        return f"None of them is judged. {ladder.result.unjudged.removesuffix('.')}"
    count = ladder.result.count(Class.IDENTIFIABLE)
    total = len(ladder.chosen)
    return "All are identifiable" if count == total else f"{count} of them are identifiable"


def _percent(error: float) -> str:
    return f"{100 * error:.3g} %" if np.isfinite(error) else "unknown size"


def ladder_toml(ladder: Ladder) -> str:
    """Return the unpruned and the chosen model as a ladder file."""
    partition = ladder.partition
    known = set(ladder.start.columns)
    gone = [n for n in ladder.base.names if n not in known]
    lines = [
        f"# {ladder.robot.title or ladder.robot.name}: the model that pruning chose.",
        "",
        "[[models]]",
        f"name = {_quote(ladder.start.name)}",
        'description = "where pruning started"',
        f"effects = {_list(ladder.effects)}",
    ]
    lines += _start_lines(ladder, gone)
    lines += ["", "[[models]]", f"name = {_quote(ladder.chosen.name)}",
              f"description = {_quote(ladder.chosen.rung.description)}"]  # fmt: skip
    zeroed = partition.zeroed()
    if zeroed:
        lines.append("zero = [")
        lines += [f"  {_quote(c)}," for c in zeroed]
        lines.append("]")
    ties = partition.ties()
    if ties:
        lines.append("[models.tie]")
        lines += [f"{_quote(name)} = {_list(members)}" for name, members in ties.items()]
    return "\n".join(lines) + "\n"


def _start_lines(ladder: Ladder, gone: list[str]) -> list[str]:
    """Return how the starting model differs from the base model."""
    start, names = ladder.start, ladder.base.names
    tied = {
        column: [names[k] for k in np.flatnonzero(start.M[:, i])]
        for i, column in enumerate(start.columns)
    }
    ties = {c: m for c, m in tied.items() if len(m) > 1 or m != [c]}
    inside = {n for m in ties.values() for n in m}
    zero = [n for n in gone if n not in inside and start.held[names.index(n)] == 0]
    hold = {
        n: float(start.held[names.index(n)])
        for n in gone
        if n not in inside and start.held[names.index(n)] != 0
    }
    lines = [f"zero = {_list(zero)}"] if zero else []
    if hold:
        pairs = ", ".join(f"{_quote(n)} = {v!r}" for n, v in hold.items())
        lines.append(f"hold = {{ {pairs} }}")
    if ties:
        lines.append("[models.tie]")
        lines += [f"{_quote(c)} = {_list(m)}" for c, m in ties.items()]
    return lines


def _quote(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _list(names: list[str] | tuple[str, ...]) -> str:
    return "[" + ", ".join(_quote(n) for n in names) + "]"
