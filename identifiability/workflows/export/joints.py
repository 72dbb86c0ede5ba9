"""`describe_joints`: which friction and rotor values of an exported file the logs determine."""

from collections.abc import Iterator, Mapping, Sequence
from textwrap import shorten
from typing import Any

import numpy as np

from identifiability.estimation.verdict import Class, Flag
from identifiability.foundation.findings import phrase
from identifiability.foundation.names import INERTIAL_KINDS, NumberByName, Strings
from identifiability.foundation.quoting import for_terminal
from identifiability.foundation.rounding import format_number, measured
from identifiability.physical.rules import RULES
from identifiability.robot import Robot
from identifiability.robot.servo import list_gains
from identifiability.workflows.predict import WORDS

#: Parameters of a result, as its JSON holds them.
Rows = Sequence[Mapping[str, Any]]


def describe_joints(
    robot: Robot,
    rows: Rows,
    values: NumberByName,
    gains: Mapping[str, tuple[float, float]] | None = None,
    share: float | None = None,
) -> Strings:
    """Return a line for each joint: gains, armature, damping and friction with their reliability.

    A last line lists undetermined masses and rotors that are far from the robot file's.

    Parameters
    ----------
    robot : Robot
    rows : sequence of mapping
        Parameters of a result of `analyze` or `prune`, as its JSON holds them.
    values : mapping
        Standard parameters that are written.
    gains : mapping of str to (float, float), optional
        Those that logs determined, by joint and kind, with their standard deviations.
    share : float, optional
        Standard deviation of the bodies about the robot file's, as a share of them.
    """
    if not rows:
        return ()
    limits = {} if share is None else _limit_rotors(robot, rows, values, share)
    within = {
        joint: phrase("exported", "within", low=low, high=high, share=share)
        for joint, (low, high) in limits.items()
    }
    lines = [
        (joint, [*list_gains(gains or {}, joint), *_describe(robot, joint, rows, values, within)])
        for joint in robot.joints
    ]
    each = [f"{joint}: {', '.join(parts)}" for joint, parts in lines if parts]
    sure = {
        f"{joint}.Ia"
        for joint, (low, high) in limits.items()
        if not low <= robot.nominal[f"{joint}.Ia"] <= high
    }
    far = [said for name, said in _list_far(robot, rows, values) if name not in sure]
    if far:
        each.append(phrase("exported", "far", values=far))
    # Names with line ends would break the lines of a patch.
    return tuple(map(for_terminal, each))


def _limit_rotors(
    robot: Robot,
    rows: Rows,
    values: NumberByName,
    share: float,
) -> dict[str, tuple[float, float]]:
    """Return 95 % limits of rotors whose sums with bodies the logs determine.

    The bodies' part of a sum is the file's within two standard deviations. Rotors that are written
    beyond these limits have none, because then the bodies are not the file's.
    """
    found = {}
    for joint in robot.joints:
        name, label = f"{joint}.Ia", _label(robot, joint, "Ia")
        sums = (row for row in rows if row["label"].endswith(f" + {label}"))
        row = next(sums, None)
        if row is None or row["verdict"] != Class.IDENTIFIABLE or row["nominal"] is None:
            continue
        bodies = row["nominal"] - robot.nominal.get(name, 0.0)
        spread = 2 * share * abs(bodies)
        low, high = row["interval95"]
        limits = low - bodies - spread, high - bodies + spread
        alone = row["label"].count("Ia(") == 1
        if alone and limits[0] <= values.get(name, np.nan) <= limits[1]:
            found[joint] = max(0.0, limits[0]), limits[1]
    return found


def _list_far(robot: Robot, rows: Rows, values: NumberByName) -> Iterator[tuple[str, str]]:
    """Yield masses and rotors unlike the file's that the logs know only as parts of sums."""
    sure = {row["label"] for row in rows if row["verdict"] == Class.IDENTIFIABLE}
    pairs = [(body, "m") for body in robot.bodies]
    pairs += [(joint, "Ia") for joint in robot.joints]
    for place, kind in pairs:
        name = f"{place}.{kind}"
        stated = robot.nominal.get(name, 0.0)
        known = name in robot.prior or _label(robot, place, kind) in sure
        if name not in values or known or not stated > 0:
            continue
        value = values[name]
        if not stated / RULES.another_robot <= value <= RULES.another_robot * stated:
            yield name, f"{name} {format_number(value, 2)} (file: {format_number(stated, 2)})"


def state_doubted(rows: Rows) -> str:
    """Return which values of bodies are in doubt, as a comment of a robot file; else nothing."""
    doubted = (row["name"] for row in rows if Flag.IN_DOUBT in row["flags"])
    names = [name for name in doubted if name.rpartition(".")[2] in INERTIAL_KINDS]
    return for_terminal(phrase("exported", "doubted", names=names)) if names else ""


def _label(robot: Robot, place: str, kind: str) -> str:
    """Return the label of a parameter that the logs determine alone."""
    return f"{kind}({robot.symbols.get(place, place)})"


def _describe(
    robot: Robot,
    joint: str,
    rows: Rows,
    values: NumberByName,
    within: Mapping[str, str],
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
        if kind == "Ia" and joint in within:
            yield f"{word} {format_number(value, 3)} ({within[joint]})"
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
    interval = np.array(row["interval95"], float)
    if np.isnan(interval).any():
        return phrase("exported", "open")
    low, high = (format_number(x, 2) for x in interval)
    is_open = row["verdict"] == Class.NOT_IDENTIFIABLE
    return phrase("exported", "unsure", open=is_open, low=low, high=high)
