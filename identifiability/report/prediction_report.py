"""The report on a `TorquePrediction`: measured and predicted torque along logs."""

from __future__ import annotations

import numpy as np

from identifiability.report.answers import answer_next, answer_quality, tone_of
from identifiability.report.blocks import Answer, Answers, Fold, Gallery, Prose, Section, Sketch
from identifiability.report.numbers import digits, error_text, format_count, join
from identifiability.report.page import Page
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.report.tables import Column, Table
from identifiability.report.torque import LINE_POINTS, choose_stretch, draw_torque, fold_gallery
from identifiability.report.words import columns, picture, section
from identifiability.workflows.commands import name_logs, quote, source_name
from identifiability.workflows.predict import FEW_INSIDE, TorquePrediction

# What a prediction answers first: of what, how good, may its intervals be trusted, what next.


def answer_prediction(result: TorquePrediction) -> Answers:
    """Return the first screen of a prediction."""
    quality = answer_quality(
        result.error_ra,
        result.robot.joints,
        result.error_frame()["error"].to_numpy(float),
        join([n for n, known in zip(result.logs, result.measured, strict=True) if known]),
    )
    next_ = answer_next(_next_commands(result))
    return Answers((_what(result), quality, _trust(result), next_), _sketch(result))


def _what(result: TorquePrediction) -> Answer:
    joints = format_count(len(result.robot.joints), "joint")
    short = f"The torque of {joints} along {join(result.logs, 3)}."
    text = f"By the model “{result.model}” of {result.origin}, at "
    text += f"{format_count(len(result.t), 'sample')}."
    if not all(result.measured):
        text += " Where no torque was measured it is predicted alone."
    return Answer("What is predicted?", short, text, "blue")


def _few(result: TorquePrediction) -> list[str]:
    """Return the joints of whose samples too few lie in their intervals."""
    pairs = zip(result.robot.joints, result.inside, strict=True)
    return [joint for joint, share in pairs if share < FEW_INSIDE]


def _trust(result: TorquePrediction) -> Answer:
    question, new = "May I trust its intervals?", []
    for joint, share in zip(result.robot.joints, result.unknown, strict=True):
        if share > 0:
            new.append(joint)
    text = ""
    if new:
        text = (
            f" At {join(new)} this motion acts on parameters that the fitted motion never showed: "
            "there the interval has no end."
        )
    if not any(result.measured):
        return Answer(question, "Nothing was measured that could tell.", text.strip(), "grey")
    inside, few = float(result.inside.mean()), _few(result)
    size = f"{error_text(inside)} of the samples lie in their 95 % interval."
    if few:
        why = (
            f"Of {join(few)} too few do: a load, a temperature or the robot changed since, or this "
            "motion shows what the model leaves out."
        )
        return Answer(question, f"No: only {size}", why + text, "vermilion")
    return Answer(question, f"Yes: {size}", text.strip(), "amber" if new else "green")


def _next_commands(result: TorquePrediction) -> list[tuple[str, str]]:
    robot, given = source_name(result.robot), quote(result.origin)
    every = name_logs(result.robot, result.logs)
    pairs = zip(result.logs, result.measured, strict=True)
    measured = name_logs(result.robot, [n for n, known in pairs if known])
    table = (
        "Have every sample with its intervals as a table:",
        f"identifiability predict {robot} {given} {every} --out torque.csv",
    )
    if any(result.measured) and _few(result):
        page = f"{measured} --report missing.html"
        return [
            (
                "Find out what is missing on this motion:",
                f"identifiability diagnose {robot} {page}",
            ),
            table,
        ]
    text, name = result.onward
    return [table, (text, f"identifiability export {robot} {given} --out {name}")]


def _sketch(result: TorquePrediction) -> Sketch | None:
    errors = result.error_frame()["error"]
    parts = {
        joint: Part(tone_of(error), error_text(error))
        for joint, error in zip(result.robot.joints, errors, strict=True)
        if np.isfinite(error)
    }
    return sketch_parts(result.robot, parts, "decision.predicted")


# The report on a `TorquePrediction`: measured and predicted torque along logs.


def build_prediction_page(result: TorquePrediction) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    count = format_count(len(result.t), "sample")
    return Page(
        title=result.robot.title or result.robot.name,
        sections=(section_torque(result), section_joints(result)),
        overline="Predicted torque",
        subtitle=f"{result.robot.path.name} · {result.model} · {count}",
        summary=(
            answer_prediction(result),
            Fold("The answer in one paragraph", (Prose((result.statement,)),)),
        ),
    )


def section_torque(result: TorquePrediction) -> Section:
    """Return measured and predicted torque of every joint along a stretch of the first log."""
    part = choose_stretch(result.t[result.log == 0])
    joints, units = result.robot.joints, result.robot.torque_units
    errors = result.error_frame()["error"]
    most = int(np.clip(LINE_POINTS // (3 * len(joints)), 200, 1500))
    pictures = []
    for k, joint in enumerate(joints):
        title = f"{joint}, error {error_text(errors[k])}"
        measured, predicted = result.tau[part, k], result.predicted[part, k]
        figure = draw_torque(result.t[part], measured, predicted, title, units[k], most)
        pictures.append(picture("torque", figure, joint=joint))
    return section("prediction.torque", *fold_gallery(Gallery(tuple(pictures))), log=result.logs[0])


def section_joints(result: TorquePrediction) -> Section:
    """Return errors of every joint, and how many samples lie in their intervals."""
    return section("prediction.joints", joint_table(result))


def joint_table(result: TorquePrediction) -> Table:
    """Return one row a joint."""
    own = columns(
        "predicted",
        Column("joint", get="joint"),
        Column("error", error_text, "error"),
        Column("rms error", digits(3), "rms"),
        Column("unit", get="unit"),
        Column("error of raw torque", error_text, "error_raw"),
        Column("inside", error_text, "inside"),
        Column("unknown", error_text, "unknown"),
    )
    rows = result.error_frame().itertuples()
    return Table.of("Each joint by itself", own, rows)
