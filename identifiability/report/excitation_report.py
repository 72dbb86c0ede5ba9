"""The report on an `Excitation`: the motion to measure, and what it is worth."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.answers import Column, Note, Table
from identifiability.foundation.names import shorten_paths
from identifiability.foundation.rounding import digits, format_count, format_number, join
from identifiability.report.blocks import Fold, Gallery, Prose, Section, Sketch, picture, section
from identifiability.report.figures import draw_gain, draw_joint
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.workflows.answers import note, sentence, words
from identifiability.workflows.excite.result import Excitation
from identifiability.workflows.excite.rules import RULES

TITLES = {
    "information": "A motion that says much about the parameters",
    "separate": "A motion that separates two effects",
    "discriminate": "A motion that tells effects of known size apart",
}


def heading(result: Excitation) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    return "Excitation report", (
        f"{TITLES[result.criterion.name]} · {format_number(result.trajectory.period)} s, "
        f"{format_count(result.trajectory.samples, 'sample')}"
    )


def sketch(result: Excitation) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    better: dict[str, list[str]] = {name.rpartition(".")[0]: [] for name in result.names}
    for name, gain in zip(result.names, result.gain, strict=True):
        if gain < RULES.better:
            better[name.rpartition(".")[0]].append(name)
    parts = {
        owner: Part("green", f"better known: {join(names)}")
        if names
        else Part("grey", "not better known")
        for owner, names in better.items()
    }
    return sketch_parts(result.robot, parts, "decision.excited", "not in the model")


def notes(result: Excitation) -> list[Note]:
    """Return what should be known with the answer."""
    return [*result.cautions(), *(note("hint", hint=hint) for hint in result.hints)]


def sections(result: Excitation) -> list[Section]:
    """Return the sections of the page: the motion, what it tells, how it was found."""
    path, logs = result.trajectory, ", ".join(shorten_paths(result.logs))
    gain = picture("gain", draw_gain(result.names, result.gain), beside=result.beside)
    text = words(
        "excitation.how",
        harmonics=path.harmonics,
        motions=format_count(result.evaluations, "motion"),
        seed=result.seed,
        effects=", ".join(result.effects),
        measured=sentence("excitation.measured", logs=logs) if logs else "",
    )
    kinds = [f"{kind} {k + 1}" for kind in ("sin", "cos") for k in range(path.sin.shape[1])]
    columns = [Column("joint"), *(Column(kind, digits(5)) for kind in ("offset", *kinds))]
    numbers = np.column_stack([path.offset, path.sin, path.cos])
    rows = [(joint, *x) for joint, x in zip(result.limits.joints, numbers, strict=True)]
    coefficients = Table.of(sentence("excitation.series"), columns, rows, cards=False)
    return [
        section(
            "excitation.motion",
            _motion(result),
            result.tables()[0],
            Fold("Coefficients", (coefficients,)),
        ),
        section("excitation.gain", gain, beside=result.beside),
        section("excitation.method", Prose(tuple(text.values()))),
    ]


def _motion(result: Excitation) -> Gallery:
    """Return every joint along the motion, and the limits that it keeps."""
    t, *parts = result.motion
    limits, robot = result.limits, result.robot
    highest = (limits.high, limits.speed, limits.acceleration)
    lowest = (limits.low, -limits.speed, -limits.acceleration)
    pictures = []
    for k, joint in enumerate(limits.joints):
        unit = "m" if robot.is_prismatic(int(robot.actuated[k])) else "rad"
        figure = draw_joint(
            [(t, x[:, k]) for x in parts],
            (f"q [{unit}]", f"q̇ [{unit}/s]", f"q̈ [{unit}/s²]"),
            joint,
            [(low[k], high[k]) for low, high in zip(lowest, highest, strict=True)],
        )
        pictures.append(picture("joint", figure, joint=joint))
    return Gallery(tuple(pictures))
