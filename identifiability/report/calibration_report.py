"""The report of a calibration: may intervals and verdicts be trusted on this motion?"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.answers import Column, Table
from identifiability.foundation.rounding import digits, join
from identifiability.report.blocks import Fold, Prose, Section, Sketch, picture, section
from identifiability.report.figures import draw_intervals
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.workflows.answers import with_hints, words
from identifiability.workflows.calibrate.calibration import Calibration


def heading(calibration: Calibration) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    return "Calibration", f"{calibration.analysis.robot.path.name} · {calibration.model}"


def sketch(calibration: Calibration) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    cell = calibration.cell
    few: dict[str, list[str]] = {name.rpartition(".")[0]: [] for name in cell.names}
    for name in cell.below:
        few[name.rpartition(".")[0]].append(name)
    parts = {
        owner: Part("vermilion", f"too narrow: {join(names)}")
        if names
        else Part("blue", "intervals hold")
        for owner, names in few.items()
    }
    robot = calibration.analysis.robot
    return sketch_parts(robot, parts, "decision.calibrated", "not in the model")


def sections(calibration: Calibration) -> list[Section | None]:
    """Return the sections of the page."""
    frame = calibration.to_frame()
    share, low, high = 100 * frame[["value", "low", "high"]].to_numpy(float).T
    reach = np.maximum([share - low, high - share], 0.0)
    label = "intervals that hold the truth [%]"
    each = draw_intervals(list(frame["parameter"]), share, reach, label, 95.0)
    names = calibration.false_names
    return [
        section(
            "calibration.parameters",
            picture("each", each),
            Fold(f"All {len(frame)} parameters", calibration.tables()),
        ),
        section("calibration.names", statement=names.statement) if names is not None else None,
        _method(calibration),
    ]


NOISE = with_hints(
    "noise",
    Column("actuator"),
    Column("order", "number"),
    Column("size", digits(3)),
    Column("autocorrelation time", digits(3)),
)


def _method(calibration: Calibration) -> Section:
    holes = {"trials": len(calibration.cell.held), "seed": calibration.provenance["seed"]}
    told = [*words("calibration.how", **holes).values()]
    rows = [tuple(row.values()) for row in calibration.noise_rows()]
    table = Table.of("Noise of the repetitions", NOISE, rows)
    return section("calibration.method", Prose(tuple(told)), table)
