"""The values that users come for: mass, friction and rotor of joints and motors, with verdicts."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.estimation.rules import Thresholds
from identifiability.estimation.verdict import Class, Flag, Verdict, percent_of
from identifiability.foundation.answers import Cell, Column, Table
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.rounding import chance_text, join, measured, stated_text
from identifiability.physical.cad_prior import mass_rows
from identifiability.robot import Robot
from identifiability.robot.floating import BASE_JOINTS
from identifiability.robot.servo import list_gains
from identifiability.workflows.analyze.result import Laddered

from .analyze import label_note
from .common import JOINT_KINDS, kind_columns, sentence
from .tables import make_table


def joint_values(result: Laddered[Any], parameters: str) -> Table | None:
    """Return a row for each joint: mass of its body, frictions and rotor, with verdicts.

    Motors that mix joints, and passive joints, have a row of their friction and rotor. None if the
    model has none of these parameters, or no value is judged. The caption refers to the section of
    all parameters by its title.
    """
    robot = result.robot
    rows_of = _ModelRows(result)
    servo = {} if result.nothing else result.fit.servo
    kinds = [k for k in (*JOINT_KINDS, robot.inertia_parts[0]) if rows_of.have(k)]
    known = {} if result.nothing else result.real_robot["parameters"]
    masses = {row["body"]: row for row in mass_rows(robot, known)}
    moved = zip(robot.bodies, robot.links, strict=True)
    bodies = {dof: body for body, link in moved for dof in robot.tree.joints[link.last].dofs}
    motors = [a.name for a in robot.axes if a.name not in robot.joints]
    places_of = {name.rpartition(".")[0] for name in rows_of.known if name.endswith(JOINT_KINDS)}
    passive = [joint for joint in robot.passive if joint in places_of]
    floats = BASE_JOINTS if robot.base else ()  # nothing drives them
    places = [x for x in (*robot.joints, *motors, *passive) if x not in floats]
    sums = {
        "moved": [rows_of.show_moved(place) for place in places],
        "m": [rows_of.show_mass(masses.get(bodies.get(place, ""))) for place in places],
    }
    sums |= {kind: [rows_of.show(f"{place}.{kind}") for place in places] for kind in kinds}
    # A column without a value is one sentence.
    cells = {kind: each for kind, each in sums.items() if any(cell.badge for cell in each)}
    if not cells:
        return None
    none = {"", sentence("values", "absent")}
    lost = [k for k, each in sums.items() if k not in cells and {x.note for x in each} - none]
    titles = [column.title for column in kind_columns(robot, lost)[1:]]
    caption = sentence("values", "lost", lost=titles, section=parameters) if lost else ""
    if rows_of.doubted:
        caption += sentence("values", "doubts", section=parameters)
    columns = kind_columns(robot, [*cells])
    gains = [Cell(", ".join(list_gains(servo, place))) for place in places]
    names = [Cell(x, note=sentence("values", "passive") if x in passive else "") for x in places]
    each = [names, *cells.values()]
    if any(cell.text for cell in gains):
        columns.append(Column(sentence("values", "gains")))
        each.append(gains)
    rows = [*zip(*each, strict=True)]
    return Table.of(caption.strip(), columns, rows)


def list_values(result: Laddered[Any]) -> Table:
    """Return the values of `joint_values` one a row, with their small print as columns."""
    table = joint_values(result, "") or Table("", (), ())
    titles = [column.title for column in table.columns[1:]]
    rows = []
    for joint, *cells in table.rows:
        for title, cell in zip(titles, cells, strict=True):
            if cell.badge:
                said, _, file = cell.note.partition("; ")
                rows.append((joint.text, title, cell.text, said, file))
    return make_table("values", rows)


def offset_table(result: Laddered[Any]) -> Table | None:
    """Return the identifiable values that offsets of motors would hide; None without any."""
    rows = []
    for verdict, joints in () if result.nothing else result.chosen.without_offsets:
        note = _spell_label(label_note(verdict.label), result.robot)
        called = sentence("values", "of_several", name=verdict.name) if note else verdict.name
        text = measured(verdict.value, verdict.sigma_label, verdict.unit)
        value = Cell(text, verdict.value, badge=verdict.look)
        rows.append((Cell(called, note=note), value, join(joints)))
    return make_table("offsets", rows) if rows else None


def _spell_label(label: str, robot: Robot) -> str:
    """Return a label with the names of parameters: ``m(7)`` is ``leg3_upper.m`` there."""
    names = {symbol: name for name, symbol in robot.symbols.items() if name in robot.bodies}
    return re.sub(r"(\w+)\(([^)]*)\)", lambda m: f"{names.get(m[2], m[2])}.{m[1]}", label)


def _state_file(stated: float, sigma: float) -> str:
    """Return a value of the robot file: four digits, or as many as its estimate if these are more.

    So values of one kind have the same digits, however well each is known.
    """
    short = stated_text(stated)
    exact = stated_text(stated, sigma)
    return max(short, exact.rstrip("0").rstrip(".") if "." in exact else short, key=len)


def _name_file(verdict: Verdict) -> str:
    """Return the file's value in words, marked if the interval excludes it; none if unstated."""
    file = verdict.nominal
    if not file:
        return ""
    low, high = verdict.interval95
    known = verdict.verdict is not Class.NOT_IDENTIFIABLE
    part = "other" if known and (file < low or file > high) else "file"
    return sentence("values", part, value=_state_file(file, verdict.sigma_label))


class _ModelRows:
    """Cells of the parameters of the model to use."""

    def __init__(self, result: Laddered[Any]) -> None:
        chosen = result.chosen
        each = zip(chosen.verdicts, chosen.recommended.tolist(), chosen.departures, strict=True)
        self.structure = result.structure
        self.fit = None if result.nothing or chosen.unjudged else result.fit
        self.known = {v.name: (v, used, why) for v, used, why in each}
        self.missing = chosen.fit.alternatives
        self.doubted = False

    def have(self, kind: str) -> bool:
        """Return whether the model, or the unpruned one, has parameters of a kind."""
        names = (*self.known, *(p.name for p in self.structure.parameters))
        return any(name.endswith(f".{kind}") for name in names)

    def show(self, name: str) -> Cell:
        """Return the value of a parameter, its error and verdict; the file's and the used value."""
        if name not in self.known or self.known[name][0].others:
            return Cell("–", np.nan, self._explain_absence(name))
        verdict, used, why = self.known[name]
        sigma = verdict.sigma_label
        file = _name_file(verdict)
        word = self._explain_doubt(verdict) or verdict.word
        usage = stated_text(used, sigma)
        if why:  # predictions, files and other pages have this number
            word = sentence("values", "exported", word=word, value=usage)
        note = "; ".join(filter(None, (word, file)))
        more = sentence("values", "used", value=usage, why=why) if why else ""
        low, high = verdict.interval95
        value = measured(verdict.value, sigma, verdict.unit)
        if low == 0 and np.isfinite(high):  # no friction is negative
            value = sentence("values", "most", high=high, unit=verdict.unit)
        return Cell(value, verdict.value, note, verdict.look, more=more)

    def _explain_doubt(self, verdict: Verdict) -> str:
        """Return why a value is in doubt, if an effect that may be missing is the reason."""
        missing = self.missing
        if missing is None or Flag.IN_DOUBT not in verdict.flags:
            return ""
        k = [*self.known].index(verdict.name)
        effect = missing.names[k]
        if not effect:
            return ""
        if missing.rare[k]:
            other = stated_text(verdict.value - missing.change[k], verdict.sigma_label)
            chance = chance_text(missing.chance[k])
            return sentence("values", "rare", effect=effect, value=other, chance=chance)
        self.doubted = True
        return sentence("values", "doubt")

    def show_moved(self, place: str) -> Cell:
        """Return the mass that a sliding joint of a tree moves, by the logs and by the file."""
        weights = self.structure.moving_mass(place)
        if self.fit is None or not weights.any():
            return Cell("–", np.nan)
        values, covariance = self.fit.of_labels
        total = float(weights @ values)
        open_parts = weights @ self.fit.base_unknown
        sigma = float(np.sqrt(weights @ covariance @ weights))
        if np.abs(open_parts).max(initial=0.0) >= NEARLY:
            sigma = np.inf
        sure = percent_of(sigma, total) <= Thresholds().sigma_percent
        word = Class.IDENTIFIABLE if sure else Class.NOT_IDENTIFIABLE
        stated = float(weights @ self.structure.nominal_base)
        file = sentence("values", "file", value=f"{stated_text(stated)} kg")
        note = f"{word}; {file}"
        return Cell(measured(total, sigma, "kg"), total, note, word)

    def show_mass(self, row: dict[str, Any] | None) -> Cell:
        """Return the mass of a body; only that of the file where others are added to it."""
        if row is None:
            return Cell("–", np.nan)
        cell = self.show(f"{row['body']}.m")
        if cell.badge:
            return cell
        file = sentence("values", "file", value=f"{stated_text(row['mass_file'])} kg")
        return replace(cell, note=f"{cell.note}; {file}")

    def _explain_absence(self, name: str) -> str:
        """Return in which combinations a parameter is that has no value alone."""
        base = self.structure.base
        rows = (row for row, kept in enumerate(base.names) if kept in self.known)
        groups = ([p.name for _, p in base.terms(row)] for row in rows)
        others = dict.fromkeys(x for group in groups if name in group for x in group if x != name)
        if others:
            return sentence("values", "combined", names=[*others])
        return sentence("values", "silent" if name in base.without_effect else "absent")
