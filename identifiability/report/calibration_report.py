"""The report of a calibration: may intervals and verdicts be trusted on this motion?"""

from __future__ import annotations

import numpy as np
from scipy.stats import binom

from identifiability.foundation.answers import Column, Table
from identifiability.foundation.rounding import digits, join, whole_percent
from identifiability.report.blocks import Fold, Prose, Section, Sketch, picture, section
from identifiability.report.figures import draw_intervals, draw_ranks
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.workflows.answers import sentence, with_hints, words
from identifiability.workflows.calibrate.calibration import WORDS, Calibration
from identifiability.workflows.calibrate.outcome import PRIOR_WIDTH, RankCheck


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
    causes = Table.of("One cause switched off", CAUSES, calibration.effects)
    frame = calibration.to_frame()
    share, low, high = 100 * frame[["value", "low", "high"]].to_numpy(float).T
    reach = np.maximum([share - low, high - share], 0.0)
    label = "intervals that hold the truth [%]"
    each = draw_intervals(list(frame["parameter"]), share, reach, label, 95.0)
    ranks, names = calibration.ranks, calibration.false_names
    return [
        section("calibration.causes", causes) if calibration.effects else None,
        section(
            "calibration.parameters",
            picture("each", each),
            Fold(f"All {len(frame)} parameters", calibration.tables()),
        ),
        _ranks(ranks) if ranks is not None else None,
        section("calibration.names", statement=names.statement) if names is not None else None,
        _method(calibration),
    ]


CAUSES = (
    Column("without", get=lambda e: WORDS[e.cause][0]),
    Column("intervals that hold", whole_percent, "cell.coverage"),
    Column("gain", get=lambda e: f"{100 * e.gain:.1f} ± {100 * e.gain_se:.1f} %"),
    Column("does harm", get=lambda e: "yes" if e.harmful else "no"),
)

NOISE = with_hints(
    "noise",
    Column("actuator"),
    Column("order", "number"),
    Column("size", digits(3)),
    Column("autocorrelation time", digits(3)),
)


def _ranks(found: RankCheck) -> Section:
    band = binom.interval(0.99, found.replicates, 1 / found.counts.shape[1])
    figure = draw_ranks(found.counts, band, found.worst, found.names[found.worst])
    return section("calibration.posterior", picture("ranks", figure), statement=found.statement)


def _method(calibration: Calibration) -> Section:
    holes = {"trials": len(calibration.cell.held), "seed": calibration.provenance["seed"]}
    told = [*words("calibration.how", **holes).values()]
    if calibration.ranks is not None:
        numbers = {"replicates": calibration.ranks.replicates, "width": f"{PRIOR_WIDTH:g}"}
        told.append(sentence("calibration.ranks", "how", **numbers))
    rows = [tuple(row.values()) for row in calibration.noise_rows()]
    table = Table.of("Noise of the repetitions", NOISE, rows)
    return section("calibration.method", Prose(tuple(told)), table)
