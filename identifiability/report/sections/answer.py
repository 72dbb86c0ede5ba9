"""The answer: headline numbers, who is who, and what to keep in mind."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.verdict import Class
from identifiability.report.blocks import Note, Notes, Term, Terms, Tile
from identifiability.report.marks import MARKS
from identifiability.report.numbers import error_text, format_count, format_number, join, time_text
from identifiability.report.sections.facts import model_title, sigma_inflation
from identifiability.workflows.analyze import Analysis

#: σ may grow by this factor before the report warns of autocorrelation.
MILD_INFLATION = 1.2

#: Names of a verdict that the answer lists.
MOST_NAMES = 24

#: Rows for each parameter below which the report warns of a short log.
FEW_ROWS = 10


def answer_tiles(analysis: Analysis) -> tuple[Tile, ...]:
    """Return the headline numbers."""
    chosen, full = analysis.chosen, analysis.full
    found, total = chosen.count(Class.IDENTIFIABLE), len(chosen.rung)
    inside = ""
    if chosen is not full:
        before = f"{full.count(Class.IDENTIFIABLE)} of {len(full.rung)}"
        before = "not judged" if full.unjudged else before
        inside = f"{before} in the unpruned {model_title(full)}"
    effects = ", ".join(e.replace("_", " ") for e in analysis.effects)
    return (
        Tile(str(len(analysis.base.parameters)), "parameters", effects),
        Tile(
            str(analysis.base.rank),
            "can be told apart",
            "by any motion; the others act only in sums, or never",
        ),
        Tile(f"{found} of {total}", f"identifiable in {model_title(chosen)}", inside),
        Tile(
            error_text(chosen.error_ra_validation),
            "error on unseen motion",
            f"{error_text(chosen.error_ra)} on the motion it was fitted to",
            "" if chosen.error_ra_validation < 1 else "vermilion",
        ),
        _feasible_tile(analysis),
    )


def _feasible_tile(analysis: Analysis) -> Tile:
    chosen = analysis.chosen
    label = "physically possible"
    if chosen.feasible:
        return Tile("Yes", label, "a real robot can have all its values", "green")
    if chosen.infeasible:
        return Tile("No", label, f"wrong sign: {join(chosen.infeasible, 3)}", "vermilion")
    if chosen.physical.certificate is None:
        why = "" if analysis.nothing else "the motion leaves some parameters undetermined"
        return Tile("Open", label, why)
    near = f"the nearest real robot errs by {error_text(chosen.error_ra_physical)}"
    return Tile("Nearly", label, near, "amber")


def answer_terms(analysis: Analysis) -> Terms:
    """Return the parameters of the selected model by verdict."""
    verdicts = analysis.chosen.verdicts
    kinds = {v.verdict.value for v in verdicts}
    order = [*[k for k in MARKS if k in kinds], *sorted(kinds - set(MARKS))]
    terms = []
    for kind in order:
        names = [v.name for v in verdicts if v.verdict.value == kind]
        terms.append(Term(kind, join(names, MOST_NAMES), kind))
    return Terms(tuple(terms))


def answer_notes(analysis: Analysis) -> Notes:
    """Return the caveats, gravest first."""
    hints = [Note("warning", "Check the logs.", hint) for hint in analysis.hints]
    if analysis.nothing:
        why = f"{analysis.nothing[0].upper()}{analysis.nothing[1:]}; do not use the values."
        hints.append(Note("warning", "Nothing is identifiable.", why))
    if not np.isfinite(analysis.chosen.error_ra_validation):
        return Notes((*hints, *_sample_notes(analysis)))
    notes = [
        *hints,
        *_physics_notes(analysis),
        *_excitation_notes(analysis),
        *_sample_notes(analysis),
        _noise_note(analysis),
        *_judgement_notes(analysis),
        *_validation_notes(analysis),
    ]
    order = {"warning": 0, "note": 1, "good": 2}
    return Notes(tuple(sorted(notes, key=lambda n: order[n.level])))


def _physics_notes(analysis: Analysis) -> list[Note]:
    chosen, full = analysis.chosen, analysis.full
    near = f"the nearest real robot errs by {error_text(chosen.error_ra_physical)} on unseen motion"
    notes = []
    if chosen.infeasible:
        text = (
            f"{join(chosen.infeasible)} cannot be negative in any real robot. A simulator may "
            f"refuse these values, or become unstable with them; {near}."
        )
        notes.append(Note("warning", "Impossible values in the model to use.", text))
    elif not chosen.feasible and chosen.physical.certificate is not None:
        text = (
            f"Each sign is possible, but not all values at once; {near}. Give that to a simulator."
        )
        notes.append(Note("note", "No real robot has exactly these values.", text))
    if full.infeasible and full is not chosen:
        text = (
            f"{join(full.infeasible)}: with {len(full.rung)} parameters the noise decides even "
            "signs. It is shown for comparison, not for use."
        )
        title = f"The unpruned {model_title(full)} is physically impossible."
        notes.append(Note("note", title, text))
    return notes


def _excitation_notes(analysis: Analysis) -> list[Note]:
    notes = []
    rank = len(analysis.full.estimate.kept)
    if rank < analysis.base.rank:
        text = (
            f"The robot's structure allows {analysis.base.rank} independent parameters; this "
            f"motion excites {rank}. A richer motion would determine more."
        )
        notes.append(Note("warning", "The motion is not rich enough.", text))
    if analysis.base.ambiguous:
        text = (
            "Counting singular values and choosing columns disagree by one or more; look at the "
            "gap in the spectrum before trusting the number of parameters."
        )
        notes.append(Note("warning", "The rank is not clear-cut.", text))
    rows, size = analysis.information.rows, len(analysis.full.rung)
    if rows < FEW_ROWS * size:
        text = (
            f"{format_count(rows, 'torque value')} for {format_count(size, 'parameter')} of "
            "the unpruned model; longer logs would narrow the intervals."
        )
        notes.append(Note("warning", "Short logs.", text))
    return notes


def _sample_notes(analysis: Analysis) -> list[Note]:
    notes = []
    for s in (*analysis.samples, *analysis.validation):
        survey = s.survey
        if survey.dropped:
            count = format_count(survey.dropped, "sample")
            text = f"The loops do not close at {count}; check calibration and geometry."
            notes.append(Note("warning", f"Samples of {s.name} were dropped.", text))
        if survey.singular:
            text = (
                f"{format_count(survey.singular, 'sample')} there, with a condition number up "
                f"to {format_number(survey.condition, 2)}: small errors of position become large "
                "torques."
            )
            notes.append(Note("warning", f"{s.name} passes near a singular configuration.", text))
    return notes


def _noise_note(analysis: Analysis) -> Note:
    times = np.asarray(analysis.chosen.autocorrelation_time, float)
    factor = sigma_inflation(analysis.chosen)
    worst = analysis.robot.joints[int(np.argmax(times))]
    longest = f"{time_text(times.max())} samples in {worst}"
    grown = f"{format_number(factor, 3)} × that of white noise"
    if np.sqrt(times.max()) > MILD_INFLATION:
        text = (
            f"The autocorrelation time is up to {longest}, so there are that many times fewer "
            f"independent samples. Verdicts rest on the robust σ, typically {grown}."
        )
        return Note("note", "Consecutive residuals resemble each other.", text)
    if factor > MILD_INFLATION:
        text = (
            f"Refits to resampled blocks of time scatter more than the formula for white noise "
            f"says: the robust σ is typically {grown}, and verdicts rest on it."
        )
        return Note("note", "The noise is not the same throughout the motion.", text)
    text = f"Autocorrelation time at most {longest}; the robust σ is typically {grown}."
    return Note("good", "Residuals are nearly independent in time.", text)


def _judgement_notes(analysis: Analysis) -> list[Note]:
    chosen, full = analysis.chosen, analysis.full
    notes = []
    if chosen.unjudged:
        notes.append(Note("warning", "No parameter is judged.", chosen.unjudged))
    if full.unjudged and full is not chosen:
        title = f"The unpruned {model_title(full)} is not judged."
        notes.append(Note("warning" if chosen.unjudged else "note", title, full.unjudged))
    return notes


def _validation_notes(analysis: Analysis) -> list[Note]:
    chosen = analysis.chosen
    notes = []
    if not analysis.nothing and chosen.error_ra_validation > 1.5 * chosen.error_ra:
        text = (
            f"{error_text(chosen.error_ra_validation)} against {error_text(chosen.error_ra)} where "
            "it was fitted: the unseen motion asks for something that the model lacks, or the "
            "fitted motion did not show."
        )
        notes.append(Note("warning", "The error grows on unseen motion.", text))
    if not analysis.validation:
        text = (
            f"The error on unseen motion comes from {analysis.validation_kind}. A separate log "
            "with another motion is a harder and more honest test."
        )
        notes.append(Note("note", "No separate log was held out.", text))
    return notes
