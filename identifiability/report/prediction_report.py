"""The report on a `TorquePrediction`: measured and predicted torque along logs."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import shorten_paths
from identifiability.foundation.rounding import error_text, format_count
from identifiability.report.blocks import Gallery, Section, Sketch, picture, section
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.report.torque import LINE_POINTS, choose_stretch, draw_torque, fold_gallery
from identifiability.workflows.answers import tone_of
from identifiability.workflows.predict import TorquePrediction

# What a prediction answers first: of what, how good, may its intervals be trusted, what next.


def sketch(result: TorquePrediction) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    errors = result.error_frame()["error"]
    parts = {
        joint: Part(tone_of(error), error_text(error))
        for joint, error in zip(result.robot.joints, errors, strict=True)
        if np.isfinite(error)
    }
    return sketch_parts(result.robot, parts, "decision.predicted")


# The report on a `TorquePrediction`: measured and predicted torque along logs.


def heading(result: TorquePrediction) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    count = format_count(len(result.t), "sample")
    return "Predicted torque", f"{result.robot.path.name} · {result.model} · {count}"


def sections(result: TorquePrediction) -> list[Section]:
    """Return the sections of the page."""
    return [section_torque(result), section_joints(result)]


def section_torque(result: TorquePrediction) -> Section:
    """Return measured and predicted torque of every joint along a stretch of each log."""
    every = range(len(result.logs))
    return section("prediction.torque", *(b for k in every for b in fold_gallery(_draw(result, k))))


def _draw(result: TorquePrediction, log: int) -> Gallery:
    """Return pictures of one log."""
    rows = np.flatnonzero(result.log == log)
    part = rows[choose_stretch(result.t[rows])]
    joints, units = result.robot.joints, result.robot.torque_units
    most = int(np.clip(LINE_POINTS // (3 * len(joints) * len(result.logs)), 200, 1500))
    pictures = []
    for k, (joint, error) in enumerate(zip(joints, result.joint_errors(log), strict=True)):
        title = f"{joint}, error {error_text(error)}"
        measured, predicted = result.tau[part, k], result.predicted[part, k]
        figure = draw_torque(result.t[part], measured, predicted, title, units[k], most)
        pictures.append(picture("torque", figure, joint=joint))
    return Gallery(tuple(pictures), f"A stretch of {shorten_paths(result.logs)[log]}.")


def section_joints(result: TorquePrediction) -> Section:
    """Return errors of every joint, and how many samples lie in their intervals."""
    return section("prediction.joints", result.tables()[0])
