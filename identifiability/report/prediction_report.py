"""The report on a `TorquePrediction`: measured and predicted torque along logs."""

from __future__ import annotations

import numpy as np

from identifiability.report.blocks import Fold, Gallery, Prose, Section
from identifiability.report.figures.motion import choose_stretch, draw_torque
from identifiability.report.numbers import digits, error_text, format_count
from identifiability.report.page import Page
from identifiability.report.sections.predicted import answer_prediction
from identifiability.report.sections.prediction import LINE_POINTS, fold_gallery
from identifiability.report.tables import Column, Table
from identifiability.report.words import columns, picture, section
from identifiability.workflows.predict import TorquePrediction


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
    return section("prediction.joints", Table.of("Each joint by itself", own, rows))
