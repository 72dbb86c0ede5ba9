"""`describe_joints`: which friction and rotor values of an exported file the logs determine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from textwrap import shorten
from typing import Any

import numpy as np

from identifiability.estimation.verdict import Class, Flag
from identifiability.foundation.findings import phrase
from identifiability.foundation.names import INERTIAL_KINDS
from identifiability.foundation.quoting import for_terminal
from identifiability.foundation.rounding import format_number, measured
from identifiability.physical.rules import RULES
from identifiability.robot import Robot
from identifiability.workflows.predict import ResultEntry

#: Words of a robot file for the numbers of a joint, and their kinds of parameters.
WORDS = {"armature": "Ia", "damping": "Fv", "frictionloss": "Fc"}


def describe_joints(
    robot: Robot, rows: Sequence[Mapping[str, Any]], values: Mapping[str, float]
) -> tuple[str, ...]:
    """Return a line for each joint: armature, damping and friction with their reliability.

    A last line lists undetermined masses and rotors that are far from the robot file's.

    Parameters
    ----------
    robot : Robot
    rows : sequence of mapping
        Parameters of a result of `analyze` or `prune`, as its JSON holds them.
    values : mapping
        Standard parameters that are written.
    """
    if not rows:
        return ()
    lines = [(joint, [*_describe(robot, joint, rows, values)]) for joint in robot.joints]
    each = [f"{joint}: {', '.join(parts)}" for joint, parts in lines if parts]
    far = [*_list_far(robot, rows, values)]
    if far:
        each.append(phrase("exported", "far", values=far))
    # Names with line ends would break the lines of a patch.
    return tuple(map(for_terminal, each))


def keep_standing(robot: Robot, content: ResultEntry) -> tuple[ResultEntry, dict[str, float]]:
    """Return the file's values for rotors and friction of joints that no command moves in the logs.

    Values that the logs determine all the same are not among them. The rows of the result, which
    come first, say why the others are. A joint of which the file states neither rotor nor friction
    would ring, so it gets the numbers of a servo that settles.
    """
    standing = content.rollout.standing if content.rollout else ()
    if not standing:
        return content, {}
    names = {f"{joint}.{kind}" for joint in standing for kind in WORDS.values()}
    names &= {r["name"] for r in content.parameters if r["verdict"] == Class.NOT_IDENTIFIABLE}
    kept = {name: robot.nominal.get(name, 0.0) for name in names}
    settled = _settle(robot, standing, kept)
    kept |= settled
    why = {name: phrase("exported", "settled" if name in settled else "standing") for name in names}
    rows = tuple(
        row | {"used_because": why[row["name"]]} if row["name"] in names else row
        for row in content.parameters
    )
    return content.model_copy(update={"parameters": rows}), kept


def _settle(robot: Robot, standing: Sequence[str], values: Mapping[str, float]) -> dict[str, float]:
    """Return rotors and friction of standing joints of which the file states none."""
    from identifiability.servos import settle_joints  # noqa: PLC0415 - MuJoCo
    from identifiability.simulation.rollout import CommandedRobot  # noqa: PLC0415 - MuJoCo

    kinds = WORDS.values()
    bare = [j for j in standing if not any(robot.nominal.get(f"{j}.{kind}") for kind in kinds)]
    if not bare:
        return {}
    machine = CommandedRobot(robot, values)
    at = np.isin(robot.joints, bare)
    settled = settle_joints(machine, machine.numbers(), at)
    names = [(f"{robot.joints[k]}.{kind}", k, kind) for k in np.flatnonzero(at) for kind in kinds]
    return {name: float(settled[kind][k]) for name, k, kind in names if name in values}


def _list_far(
    robot: Robot, rows: Sequence[Mapping[str, Any]], values: Mapping[str, float]
) -> Iterator[str]:
    """Yield masses and rotors unlike the file's that the logs know only as parts of sums."""
    sure = {row["label"] for row in rows if row["verdict"] == Class.IDENTIFIABLE}
    pairs = [(body, "m") for body in robot.bodies]
    pairs += [(joint, "Ia") for joint in robot.joints]
    for place, kind in pairs:
        name = f"{place}.{kind}"
        stated = robot.nominal.get(name, 0.0)
        if name not in values or _label(robot, place, kind) in sure or not stated > 0:
            continue
        value = values[name]
        if not stated / RULES.another_robot <= value <= RULES.another_robot * stated:
            yield f"{name} {format_number(value, 2)} (file: {format_number(stated, 2)})"


def state_doubted(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return which values of bodies are in doubt, as a comment of a robot file; else nothing."""
    doubted = (row["name"] for row in rows if Flag.IN_DOUBT in row["flags"])
    names = [name for name in doubted if name.rpartition(".")[2] in INERTIAL_KINDS]
    return for_terminal(phrase("exported", "doubted", names=names)) if names else ""


def _label(robot: Robot, place: str, kind: str) -> str:
    """Return the label of a parameter that the logs determine alone."""
    return f"{kind}({robot.symbols.get(place, place)})"


def _describe(
    robot: Robot, joint: str, rows: Sequence[Mapping[str, Any]], values: Mapping[str, float]
) -> Iterator[str]:
    """Yield the numbers of a joint, each with its error or the reason why it has none."""
    for word, kind in WORDS.items():
        value = values.get(f"{joint}.{kind}")
        if value is None:
            continue
        label = _label(robot, joint, kind)
        row = next((r for r in rows if r["label"] == label), None)
        if row is not None and row["interval95"] and row["verdict"] == Class.IDENTIFIABLE:
            low, high = row["interval95"]
            yield f"{word} {measured(value, 0.5 * (high - low))}"
            continue
        mixed = [r["label"] for r in rows if label in r["label"]]
        yield f"{word} {format_number(value, 3)} ({_explain(row, mixed)})"


def _explain(row: Mapping[str, Any] | None, mixed: Sequence[str]) -> str:
    """Return why a number has no error that can be believed."""
    if mixed and row is None:
        return phrase("exported", "mixed", sum=shorten(min(mixed, key=len), 80, placeholder=" …"))
    if row is None or not row["interval95"]:
        return phrase("exported", "open")
    if row["used_because"]:
        return str(row["used_because"])
    low, high = (format_number(x, 2) for x in row["interval95"])
    return phrase("exported", "unsure", verdict=row["verdict"], low=low, high=high)
