"""The values that users come for: friction and rotor of each joint, and masses, with verdicts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from identifiability.estimation.verdict import Verdict
from identifiability.foundation.answers import Cell, Column, Table
from identifiability.foundation.rounding import measured, stated_text
from identifiability.physical.cad_prior import mass_rows
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.result import stated_values

from .answers.common import sentence

#: Kinds of parameters of a joint, in the order of the columns.
JOINT_KINDS = ("Fc", "Fv", "Ia")

#: Coefficients of a combination below which a parameter is no part of it.
PART = 1e-9


def joint_values(analysis: Analysis) -> Table | None:
    """Return a row for each joint: its frictions and its rotor, with verdicts.

    None if the model has no such parameter.
    """
    parameters = {p.name for p in analysis.structure.parameters}
    joints = analysis.robot.joints
    kinds = [k for k in JOINT_KINDS if any(f"{joint}.{k}" in parameters for joint in joints)]
    if not kinds:
        return None
    chosen = analysis.chosen
    file = dict(zip(chosen.submodel.columns, stated_values(analysis, chosen), strict=True))
    verdicts = {v.name: v for v in analysis.chosen.verdicts}
    titles = [sentence("values", kind) for kind in kinds]
    columns = [Column(sentence("values", "joint")), *(Column(t, "badge") for t in titles)]
    rows = [
        (Cell(joint), *(_value_cell(analysis, f"{joint}.{kind}", verdicts, file) for kind in kinds))
        for joint in joints
    ]
    return Table.of(sentence("values", "caption"), columns, rows)


def body_masses(analysis: Analysis) -> Table | None:
    """Return a row for each body: its mass in use, whether it is determined, and the file's mass.

    None if no physically consistent values were found.
    """
    verdicts = {v.name: v for v in analysis.chosen.verdicts}
    rows = mass_rows(analysis.robot, analysis.real_robot["parameters"])
    if not rows or analysis.nothing:
        return None
    columns = [
        Column(sentence("values", "body")),
        Column(sentence("values", "mass"), "badge"),
        Column(sentence("values", "file_mass"), stated_text),
    ]
    cells = []
    for row in rows:
        judged = verdicts.get(f"{row['body']}.m")
        cells.append((Cell(row["body"]), _mass_cell(row["mass"], judged), row["mass_file"]))
    return Table.of(sentence("values", "masses"), columns, cells)


def _value_cell(
    analysis: Analysis, name: str, verdicts: dict[str, Verdict], file: dict[str, float | None]
) -> Cell:
    """Return the value of a parameter with its error, its verdict, and the file's value."""
    verdict = verdicts.get(name)
    if verdict is None:
        others = ", ".join(_combinations(analysis, name))
        part = "combined" if others else "absent"
        return Cell("–", np.nan, sentence("values", part, names=others))
    value = measured(verdict.value, verdict.sigma_label, verdict.unit)
    stated = file[name]
    said = stated_text(stated, verdict.sigma_label)
    part = "unstated" if stated is None else "file"
    note = f"{verdict.word}; {sentence('values', part, value=said)}"
    return Cell(value, verdict.value, note, verdict.look)


def _combinations(analysis: Analysis, name: str) -> Iterator[str]:
    """Yield the base parameters of the model in which a parameter is contained."""
    structure = analysis.structure
    known = [p.name for p in structure.parameters]
    if name not in known:
        return
    column = np.abs(structure.G[:, known.index(name)])
    for base, coefficient in zip(structure.base.names, column, strict=True):
        if coefficient > PART and base in analysis.chosen.submodel.columns:
            yield base


def _mass_cell(mass: float, verdict: Verdict | None) -> Cell:
    """Return the mass of a body, and whether it is determined by itself."""
    if verdict is None:
        return Cell(stated_text(mass), mass, sentence("values", "alone"), "partly")
    value = measured(verdict.value, verdict.sigma_label, verdict.unit)
    return Cell(value, verdict.value, verdict.word, verdict.look)
