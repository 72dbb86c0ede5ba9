"""The report on a `TorquePrediction`: measured and predicted torque along logs."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import shorten_paths
from identifiability.foundation.rounding import error_text, format_count
from identifiability.report.blocks import Block, Section, Sketch, section, torque_blocks
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.workflows.answers import tone_of
from identifiability.workflows.predict import TorquePrediction


def heading(result: TorquePrediction) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    count = format_count(len(result.t), "sample")
    return "Predicted torque", f"{result.robot.path.name} · {result.model} · {count}"


def sketch(result: TorquePrediction) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    errors = result.error_frame()["error"]
    parts = {
        joint: Part(tone_of(error), error_text(error))
        for joint, error in zip(result.robot.joints, errors, strict=True)
        if np.isfinite(error)
    }
    return sketch_parts(result.robot, parts, "decision.predicted")


def sections(result: TorquePrediction) -> list[Section]:
    """Return measured and predicted torque along each log, and the errors of joints."""
    blocks: list[Block] = []
    for log, name in enumerate(shorten_paths(result.logs)):
        rows = result.log == log
        blocks += torque_blocks(
            result.t[rows],
            result.tau[rows],
            result.predicted[rows],
            result.robot.joints,
            result.robot.torque_units,
            result.joint_errors(log).tolist(),
            name,
        )
    return [
        section("prediction.torque", *blocks),
        section("prediction.joints", result.tables()[0]),
    ]
