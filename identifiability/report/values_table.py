"""The values that users come for: mass, friction and rotor of each joint, with verdicts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from identifiability.estimation.verdict import Verdict
from identifiability.foundation.answers import Cell, Column, Table
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.rounding import measured, stated_text
from identifiability.physical.cad_prior import mass_rows
from identifiability.workflows.analyze.result import Laddered, stated_values

from .answers.common import sentence

#: Kinds of parameters of a joint, in the order of the columns.
JOINT_KINDS = ("Fc", "Fv", "Ia")


def joint_values(result: Laddered[Any]) -> Table | None:
    """Return a row for each joint: mass of its body, frictions and rotor, with verdicts.

    None if the model has none of these parameters.
    """
    robot = result.robot
    parameters = {p.name for p in result.structure.parameters}
    kinds = [k for k in JOINT_KINDS if any(f"{joint}.{k}" in parameters for joint in robot.joints)]
    known = {} if result.nothing else result.real_robot["parameters"]
    masses = {row["body"]: row for row in mass_rows(robot, known)}
    if not kinds:
        return None
    chosen = result.chosen
    file = dict(zip(chosen.submodel.columns, stated_values(result, chosen), strict=True))
    verdicts = {v.name: v for v in chosen.verdicts}
    titles = [sentence("values", kind) for kind in (*(["m"] if masses else []), *kinds)]
    columns = [Column(sentence("values", "joint")), *(Column(t, "badge") for t in titles)]
    moved = zip(robot.bodies, robot.links, strict=True)
    bodies = {dof: body for body, link in moved for dof in robot.tree.joints[link.last].dofs}
    rows = []
    for joint in robot.joints:
        cells = [_value_cell(result, f"{joint}.{kind}", verdicts, file) for kind in kinds]
        if masses:
            cells = [_mass_cell(masses.get(bodies.get(joint, "")), verdicts), *cells]
        rows.append((Cell(joint), *cells))
    return Table.of(sentence("values", "caption"), columns, rows)


def _value_cell(
    result: Laddered[Any], name: str, verdicts: dict[str, Verdict], file: dict[str, float | None]
) -> Cell:
    """Return the value of a parameter with its error, its verdict, and the file's value."""
    verdict = verdicts.get(name)
    if verdict is None:
        others = ", ".join(_combinations(result, name))
        part = "combined" if others else "absent"
        return Cell("–", np.nan, sentence("values", part, names=others))
    value = measured(verdict.value, verdict.sigma_label, verdict.unit)
    stated = file[name]
    said = stated_text(stated, verdict.sigma_label)
    part = "unstated" if stated is None else "file"
    note = f"{verdict.word}; {sentence('values', part, value=said)}"
    return Cell(value, verdict.value, note, verdict.look)


def _combinations(result: Laddered[Any], name: str) -> Iterator[str]:
    """Yield the base parameters of the model in which a parameter is contained."""
    structure = result.structure
    known = [p.name for p in structure.parameters]
    if name not in known:
        return
    column = np.abs(structure.G[:, known.index(name)])
    for base, coefficient in zip(structure.base.names, column, strict=True):
        if coefficient > ROUNDOFF and base in result.chosen.submodel.columns:
            yield base


def _mass_cell(row: dict[str, Any] | None, verdicts: dict[str, Verdict]) -> Cell:
    """Return the mass of a body, whether it is determined by itself, and the file's mass."""
    if row is None:
        return Cell("–", np.nan)
    verdict = verdicts.get(f"{row['body']}.m")
    said = sentence("values", "file", value=stated_text(row["mass_file"]))
    if verdict is None:
        text = f"{stated_text(row['mass'])} kg"
        return Cell(text, row["mass"], f"{sentence('values', 'alone')}; {said}", "partly")
    value = measured(verdict.value, verdict.sigma_label, verdict.unit)
    return Cell(value, verdict.value, f"{verdict.word}; {said}", verdict.look)
