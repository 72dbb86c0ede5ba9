"""`Diagnosis`: what is missing, with the evidence. `to_frame`, `to_json`, `write_report`."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.effects.registry import title_of
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.answers import Answer, Cell, Column, Table
from identifiability.foundation.engines.mapping import one_thread
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.output import write_text
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import digits, error_text, format_number, join, percent
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen
from identifiability.regression.reduction import LadderEntry, ModelEntry, ladder_text
from identifiability.workflows.answers import (
    after_mass,
    answer_next,
    state_error,
    tone_of,
    with_hints,
)
from identifiability.workflows.commands import (
    given_paths,
    held_back,
    name_export,
    name_logs,
    on_file,
    source_name,
)
from identifiability.workflows.diagnose.completed import keep_completed, nearest_dict, real_robot
from identifiability.workflows.diagnose.findings import Findings, NamedEffect, Odds
from identifiability.workflows.diagnose.forward import ForwardGap, compare_forward
from identifiability.workflows.diagnose.motion import Change
from identifiability.workflows.diagnose.words import headline, state, state_remainder, weight_text
from identifiability.workflows.predict import Fit, Predicts
from identifiability.workflows.rules import RULES as WORKFLOW_RULES

if TYPE_CHECKING:
    from identifiability.workflows.commanded import Moved
    from identifiability.workflows.opening import Recordings

#: What the table says of an effect at a place, and of each parameter there.
PLACE, PARAMETER = ("effect", "joint", "shape", "log_odds"), ("parameter", "value", "error", "unit")


@frozen
class Diagnosis(Result, Findings, Predicts):
    """What is missing, with the evidence. `to_frame`, `to_json`, `write_report` give it away."""

    schema: ClassVar[str] = "identifiability/diagnosis/1"

    #: How far rollouts of the nearest real robot are off, of logs of commands.
    moved: Moved | None = None

    @cached_property
    def physical(self) -> dict[str, Any]:
        """The real robot nearest to the data with the named effects, as `export` reads it."""
        with one_thread("blas"):  # the same bits however many threads there are
            return nearest_dict(self)

    @cached_property
    def fit(self) -> Fit:
        """The model with the named effects: values, covariance, and how torque scatters."""
        with one_thread("blas"):
            return keep_completed(self)

    def moved_by(self, logs: Recordings) -> Diagnosis:
        """Return the diagnosis with how far rollouts are off, where logs are of commands."""
        if not logs.commanded:
            return self
        moved = logs.measure_rollouts(self.robot, self.physical["parameters"])
        said = () if moved is None else (moved.statement,)
        return replace(self, moved=moved, hints=(*said, *self.hints))

    def write_model(self, path: str | Path) -> Path:
        """Write the model with the named effects as a model file, for every other verb."""
        return self.note_written("model", write_text(path, self.model_text))

    @property
    def model_text(self) -> str:
        """The model with the named effects, their places and shapes, as the text of its file."""
        title = self.robot.title or self.robot.name
        return ladder_text(self.to_ladder(), f"{title}: the diagnosed model.")

    def to_ladder(self) -> LadderEntry:
        """Return the model with the named effects as a ladder of one model."""
        effects = list(self.model.texts)
        return LadderEntry(models=[ModelEntry(name="the diagnosed model", effects=effects)])

    def answers(self) -> tuple[Answer, ...]:
        """Return what is missing, what it explains, what is left, what to do next."""
        what = after_mass(_what(self), self.mass_warning)
        return what, _gap(self), _left(self), answer_next(next_commands(self))

    def decided_by(self) -> tuple[RuleTable, ...]:
        """Return the numbers by which it was decided, the verb's own first."""
        return (self.rules, WORKFLOW_RULES, ESTIMATION_RULES)

    def tables(self) -> tuple[Table, ...]:
        """Return what changed in mid-log, the effects that were named, and the errors of joints."""
        named = Table.of("Effects that were missing", NAMED, self.effects)
        caption = "Each joint by itself on unseen motion, over its own scale"
        errors = Table.of(caption, ERRORS, self.error_frame().itertuples())
        changed = (_table_changes(self),) if self.changes else ()
        return (*changed, *((named,) if self.effects else ()), errors)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        return state(self)

    @property
    def unexplained(self) -> str:
        """What is left, in words."""
        return state_remainder(self)

    def to_frame(self) -> pd.DataFrame:
        """Return one row for every named effect and place.

        `before` and `after` are ε_RA on unseen motion without and with the whole effect.
        """
        rows = []
        for e in self.effects:
            for p in e.placements:
                where = (e.name, p.place, p.shape, p.odds)
                which = (", ".join(e.alternatives), e.before, e.after)
                rows += [(*where, *row, *which) for row in p.rows]
        return pd.DataFrame(rows, columns=[*PLACE, *PARAMETER, "or", "before", "after"])

    def error_frame(self) -> pd.DataFrame:
        """Return the errors of each joint on unseen motion before and after.

        Over the joint's own scale (`torque_errors.joint_errors`), and in N or N·m (`rms`), of the
        torque that was fitted, low-passed with the columns where these were.
        """
        error, rms = self.gap.joint_error(), self.gap.joint_rms()
        columns = {
            "joint": self.robot.joints,
            "unit": self.robot.torque_units,
            "before": error[:, 0],
            "after": error[:, -1],
            "rms_before": rms[:, 0],
            "rms_after": rms[:, -1],
        }
        return pd.DataFrame(columns)

    def to_dict(self) -> dict[str, Any]:
        """Return the result in the documented JSON schema."""
        left, joints = self.remainder, self.robot.joints
        hidden = {"effect": "family", "joint": "place", "hidden_behind": "behind"}
        return {
            "schema": self.schema,
            "robot": self.completed.robot.identity,
            "model": list(self.structure.model.texts),
            **pick(self, "fixed", "statement", "hints", "seed"),
            "physical": self.fit.state_robot(self.physical),
            "before": pick(self, error_ra="error_before", error_ra_validation="held_before"),
            "effects": [_effect_row(e) for e in self.effects],
            "refuted": [vars(x) for x in self.refuted],
            "changes": [_change_row(c) for c in self.changes],
            "after": pick(self, error_ra="error_after", error_ra_validation="held_after"),
            "errors": {"joints": self.error_frame().to_dict("records")},
            "earlier": {"source": "", "error_ra_validation": None, "turns": []},  # for one release
            "change": {"interval95": list(self.interval), "measured": f"on {self.verified_on}"},
            "roles": {
                **pick(self, chosen="chosen_by", verified="verified_on"),
                "fitted": list(given_paths(self.samples)),
                "verified_logs": list(given_paths(self.validation)),
                "left_out": [c.log for c in self.changes if c.whole],
                "alternative": self.alternative,
            },
            "real_robot": None,  # for one release
            "forward": None if self.forward is None else _forward_row(self.forward),
            "fit": self.fit.to_dict(),
            **({} if self.moved is None else {"rollout": self.moved.to_dict()}),
            "unexplained": {
                "statement": self.unexplained,
                "rms": dict(zip(joints, left.rms.tolist(), strict=True)),
                **pick(left, "detectable"),
            },
            "aliases": [pick(a, "remaining", **hidden) for a in self.aliases if a.structural],
            "not_applicable": [vars(r) for r in self.refusals],
            "evidence": [_odds_row(x) for x in self.evidence],
            "steps": [],  # for one release
            "preparation": {
                s.path or s.name: list(s.notes) for s in (*self.samples, *self.validation)
            },
            "provenance": dict(self.provenance),
        }


def pick(value: Any, *names: str, **renamed: str) -> dict[str, Any]:
    """Return some attributes as JSON has them, by their names or by others."""
    fields = {new: getattr(value, name) for new, name in ({n: n for n in names} | renamed).items()}
    return {name: list(x) if isinstance(x, tuple) else x for name, x in fields.items()}


def _forward_row(gap: ForwardGap) -> dict[str, Any]:
    errors = pick(gap, "error_before", "error_after", change_interval95="interval")
    return {**pick(gap, "horizon", "note"), "stretches": len(gap.before), **errors}


def _change_row(c: Change) -> dict[str, Any]:
    """Return what changed in the middle of a log; no instant where it was not logged."""

    def known(x: float) -> float | None:
        return x if np.isfinite(x) else None

    values = zip(c.parameters, c.values.tolist(), strict=True)
    return {
        **pick(c, "log", "weight", effect="family", joint="place", log_odds="odds"),
        "from": known(c.start),
        "to": known(c.stop),
        "from95": [known(x) for x in c.began],
        "to95": [known(x) for x in c.ended],
        "or": [{"effect": family, "joint": place} for family, place in c.others],
        "parameters": dict(values),
        "errors": dict(zip(c.parameters, c.errors.tolist(), strict=True)),
        "open": list(c.open),
    }


def _odds_row(x: Odds) -> dict[str, Any]:
    after = x.after if np.isfinite(x.after) else None
    return {"effect": x.name, "place": x.place, "log_odds": x.before, "log_odds_after": after}


def _effect_row(e: NamedEffect) -> dict[str, Any]:
    """Return an effect as JSON has it; what only older readers ask for is null."""
    verified = {
        "error_ra_validation_before": "before",
        "error_ra_validation_after": "after",
        "change_interval95": "interval",
        "error_joints_validation_before": "shown_before",
        "error_joints_validation_after": "shown_after",
        "joints_change_interval95": "shown_interval",
        "log_odds": "odds",
        "log_odds_unseen": "unseen",
    }
    return {
        **pick(e, "joints", "weight", "confirmed", "everywhere", effect="name", **verified),
        "p_value": None,
        "unnamed": e.unnamed,
        "nearest": list(e.nearest),
        "or": list(e.alternatives),
        "confusable_with": [
            {"effect": r.family, "joint": r.place, "undecided": True}
            for p in e.placements
            for r in p.rivals
        ],
        "places": [
            {
                **pick(p, "shape", "rms", "weight", joint="place", log_odds="odds"),
                "or": [{"effect": r.family, "joint": r.place} for r in p.rivals],
                "parameters": {name: value for name, value, *_ in p.rows},
            }
            for p in e.placements
        ],
    }


def simulate_forward(d: Findings, rng: np.random.Generator) -> ForwardGap:
    """Return the gap in motion of a diagnosis, on the motion that verified it."""
    try:
        before, after = (real_robot(d, s) for s in (d.structure, d.completed))
    except IdentifiabilityError as error:
        return ForwardGap.none(str(error))
    return replace(compare_forward(before, after, d.validation, rng), nearest=after)


def next_commands(d: Diagnosis) -> list[tuple[str, str]]:
    """Return lines for the terminal, the most useful first."""
    robot = source_name(d.robot)
    logs = name_logs(d.robot, given_paths(d.samples), how=d.preparation)
    logs += held_back(d.validation, d.samples)
    ask = f"identifiability diagnose {robot} {logs} --next motion.json"
    if not d.effects:
        what = "See which parameters these logs determine:"
        hidden = any(a.structural for a in d.aliases)
        shows = [("Find the motion that shows what these logs cannot tell from the model:", ask)]
        analyze = f"identifiability analyze {robot} {logs} --report report.html"
        return [(what, analyze), *(shows if hidden else ())]
    apart = [("Find the motion that tells one name from the other:", ask)]
    again = f"identifiability diagnose {robot} {logs}"
    judge = f"identifiability analyze {robot} {logs} --ladder {{file}} --report report.html"
    text, name = name_export(d.robot, d.fit.names)
    use = f"identifiability export {robot} {{file}} --out {name}"
    return [
        *(apart if any(e.alternatives for e in d.effects) else ()),
        (
            "Judge the parameters of the diagnosed model:",
            on_file(d, "model", "model.toml", f"{again} --out", judge),
        ),
        (
            text,
            on_file(d, "json", "diagnose.json", f"{again} --json", use),
        ),
    ]


#: Places of an effect that the first line lists.
PLACES = 3

ODDS = "Log odds for it on the fitted motion, all that was asked counted [nat]."


def _what(d: Diagnosis) -> Answer:
    question = "What is missing?"
    if not d.effects and not d.changes:
        return Answer(question, "Nothing that can be named.", headline(d), "grey")
    named = [f"{_call_change(c)} in a part of {c.log}" for c in d.changes]
    named += [f"{_call(e)} in {join(e.joints, PLACES)}" for e in d.effects]
    short = join(named)
    return Answer(question, f"{short[0].upper()}{short[1:]}.", headline(d), "vermilion")


def _call(e: NamedEffect) -> str:
    """Return a name with what the motion cannot tell from it: the first line may not be surer."""
    others = len(e.alternatives)
    return e.names if others < 2 else f"{e.title} or one of {others} that look like it"


def _call_change(c: Change) -> str:
    """Return a change with what the log cannot tell from it, as `_call`."""
    names, others = c.names, len(c.others)
    return " or ".join(names) if others < 2 else f"{names[0]} or one of {others} that look like it"


def _gap(d: Diagnosis) -> Answer:
    question = "How much of the gap does it explain?"
    if not d.effects:
        short = f"The error on unseen motion stays at {percent(d.held_before)}."
        return Answer(question, short, f"Measured on {d.verified_on}.")
    low, high = (format_number(100 * x, 2) for x in d.interval)
    falls = d.interval[1] < 0
    before, after = percent(d.held_before), percent(d.held_after)
    short = f"The error goes from {before} to {after}."
    if before == after:
        short = f"Hardly any: the error over all joints stays at {after}."
    text = (
        f"All joints together on {d.verified_on}, which was not fitted (95 % "
        f"of the change: {low} … {high} points)."
    )
    return Answer(question, short, text, "green" if falls else "amber")


def _left(d: Diagnosis) -> Answer:
    error = d.held_after if d.effects else d.held_before
    question = "How good is the model then?"
    if not np.isfinite(error):
        return Answer(question, "There is no error to tell.", d.unexplained, "grey")
    judged, short, spread = state_error(error, d.robot.joints, d.error_frame()["after"].to_numpy())
    return Answer(question, short, f"{spread}{d.unexplained}", tone_of(judged))


# What is missing and how large errors are, as tables.


NAMED = (
    Column("effect", "code", lambda e: " or ".join([e.name, *e.alternatives])),
    Column("where", get=lambda e: ", ".join(e.joints)),
    Column("log odds", digits(3), "odds", ODDS),
    Column("on unseen motion", digits(3), "unseen"),
    Column("unseen error before", error_text, "before"),
    Column("after", error_text, "after"),
)

ERRORS = with_hints(
    "gap-joints",
    Column("joint", get="joint"),
    Column("before", error_text, "before"),
    Column("after", error_text, "after"),
    Column("rms before", digits(3), "rms_before", detail=True),
    Column("rms after", digits(3), "rms_after"),
    Column("unit", get="unit"),
)


CHANGES = (
    Column("when"),
    Column("effect"),
    Column("where"),
    Column("parameter", "code"),
    Column("value", digits(3)),
    Column("± se", digits(2)),
    Column("unit"),
    Column("weight", hint="Posterior probability among all that may change at any instant."),
    Column("or", hint="What this motion cannot tell it from."),
)


def _table_changes(d: Diagnosis) -> Table:
    rows = []
    for c in d.changes:
        weight = Cell(weight_text(c.weight), c.weight)
        others = join(c.names[1:]) or "nothing"
        values = zip(c.parameters, c.values, c.errors, c.units, strict=True)
        rows += [(c.when, title_of(c.family), c.place, *row, weight, others) for row in values]
    return Table.of("What changed in the middle of a log, and was left out", CHANGES, rows)
