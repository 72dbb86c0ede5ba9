"""Columns in SI: angles that were in degrees, torque as it was measured, times in any unit.

Torque columns may hold currents or torques of motors, in other units, of other signs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.names import TIME_UNITS, Array
from identifiability.logs.checks import to_floats
from identifiability.logs.conventions import Conventions
from identifiability.logs.naming import Column, Naming
from identifiability.logs.rules import RULES

if TYPE_CHECKING:
    import pandas as pd


# Columns of angles that were said to be in degrees, and of positions in a joint's own unit.


#: Channels that are angles or their rates, and one degree [rad].
ANGULAR = ("q", "dq", "ddq", "q_ref", "dq_ref")
DEGREE = math.pi / 180


def settle_angles(naming: Naming, known: Conventions) -> Naming:
    """Return what a log takes from a table, positions in rad or m.

    Columns that state a unit keep it.
    """
    columns = tuple(_settle(column, known) for column in naming.columns)
    locked = tuple(_settle(column, known) for column in naming.locked)
    if columns == naming.columns:
        return naming
    own = [f"{j}: {s:.6g}, {o:.6g}" for j, (s, o) in known.scales.items() if j in naming.joints]
    told = f"positions were scaled and shifted as the sidecar says ({listing(own, 4)})"
    notes = (*naming.notes, told) if own else naming.notes
    if any(joint in known.degrees and joint not in known.scales for joint in naming.joints):
        notes = (*notes, "angles were read as degrees")
    return replace(naming, columns=columns, notes=notes, locked=locked)


def _settle(column: Column, known: Conventions) -> Column:
    owner, _, kind = column.name.rpartition(".")
    if column.unit or kind not in ANGULAR:
        return column
    if owner in known.scales:
        scale, offset = known.scales[owner]
        shift = -offset / scale if kind in ("q", "q_ref") else 0.0
        return replace(column, factor=scale, offset=shift)
    return replace(column, factor=DEGREE) if owner in known.degrees else column


# Torque columns as they were measured: currents, motor torques, other units, other signs.


#: What is said of a sensor behind the gears.
BEHIND = (
    "torque was measured behind the gears, where no inertia of rotors is seen: the model has none"
)


def settle_torque(naming: Naming, known: Conventions, source: str) -> Naming:
    """Return what a log takes from a table, with its torques in N·m or N at the joints.

    Parameters
    ----------
    naming : Naming
        With currents in the place of torques.
    known : Conventions
    source : str
        What sentences call the table.

    Raises
    ------
    LogError
        If a current has no gain, or a motor's torque no ratio.
    """
    torque = known.torque
    given = {c.name.removesuffix(".tau"): c for c in naming.columns if c.name.endswith(".tau")}
    given = {joint: c for joint, c in given.items() if joint in naming.joints}
    currents = [j for j, c in given.items() if c.current]
    unknown = [j for j in currents if not torque.has_gain(j)]
    if unknown:
        raise LogError(
            f"{source} has currents and no torques of {listing(unknown)}; say in the sidecar what "
            f"one unit gives at the joint [N·m or N]: [torque] gain = {{{unknown[0]} = …}} (the "
            "torque constant times the ratio of the gear), or have it identified from a known "
            "payload: identifiability payload --mass."
        )
    turned = [j for j in given if j not in known.motors]
    if torque.side == "motor" and (loose := [j for j in turned if not torque.has_ratio(j)]):
        raise LogError(
            f"{source}: the torque of {listing(loose)} was measured at the motor, by the sidecar; "
            f"give the ratio of its gear, too: [torque] ratio = {{{loose[0]} = …}}."
        )
    factors = {j: torque.factor(j) for j in given}
    columns = tuple(_scaled(c, factors) for c in naming.columns)
    return replace(naming, columns=columns, notes=(*naming.notes, *_tell(factors, currents, known)))


def _scaled(column: Column, factors: Mapping[str, float]) -> Column:
    joint = column.name.removesuffix(".tau")
    if column.name == joint or factors.get(joint, 1.0) == 1.0:
        return column
    return replace(column, factor=column.factor * factors[joint])


def _tell(factors: Mapping[str, float], currents: Sequence[str], known: Conventions) -> list[str]:
    notes = []
    what = "torques are currents" if currents else "torques were multiplied"
    changed = {j: f for j, f in factors.items() if f != 1.0 or j in currents}
    if changed:
        shown = listing([f"{j}: {f:.6g}" for j, f in changed.items()], 4)
        times = " times what the sidecar says" if currents else " by what the sidecar says"
        notes.append(f"{what}{times} ({shown})")
    if known.torque.side == "link":
        notes.append(BEHIND)
    return notes


# What a log's times are given in: seconds, thousandths of them, dates; taken only when certain.
#
# A unit that the sidecar, an option or the column itself states is taken. Else steps of up to half
# a second are seconds, and longer ones in the one unit in which they are steps of a log of motion.


#: First samples that show which steps there are.
SHOWN = 20_000


def settle_time(naming: Naming, first: pd.DataFrame, source: str, known: Conventions) -> Naming:
    """Return what a log takes from a table, with its times in seconds.

    Parameters
    ----------
    naming : Naming
    first : DataFrame
        Its first rows.
    source : str
        What sentences call the table.
    known : Conventions


    Raises
    ------
    LogError
        If the times may be in more than one unit.
    """
    time = next(c for c in naming.columns if c.name == "t")
    given = first[time.source]
    dates = as_dates(given, 0)
    if dates is not None and len(dates):
        start = int(dates.iloc[0])
        day = f"{np.datetime64(start, 'ns').astype('datetime64[s]')}".replace("T", " ")
        what = "are durations" if given.dtype.kind == "m" else f"are dates, from {day} on"
        note = f"the times {what}, and were read in seconds from the first"
        return _with(naming, replace(time, dates=start, factor=1.0), note)
    t = to_floats(given)[:SHOWN] if given.dtype.kind not in "cb" else np.empty(0)
    if len(t) < 3 or not np.isfinite(t).all() or not np.median(np.diff(t)) > 0:
        return naming  # what is wrong with them is said by others
    unit, why = known.time_unit, "as was said"
    if not unit and time.factor == 1.0:
        unit, why = _find_unit(t, source)
    factor = TIME_UNITS[unit] if unit else time.factor
    notes = [f"the times are in {unit}, {why}"] if unit and unit != "s" else []
    offset = float(t[0]) if RULES.epoch[0] < t[0] * factor < RULES.epoch[1] else 0.0
    if offset:
        notes.append("the times count from 1970, and were read from the first on")
    return _with(naming, replace(time, factor=factor, offset=offset), *notes)


def start_of(naming: Naming) -> float | None:
    """Return the seconds since 1970 that a log's times count from; None where they do not say."""
    time = next(c for c in naming.columns if c.name == "t")
    seconds = time.offset * time.factor if time.dates is None else time.dates * 1e-9
    return seconds if RULES.epoch[0] < seconds < RULES.epoch[1] else None


_POINTED = re.compile(r"^(\d{1,2})\.(\d{1,2})\.(\d{4})[T ]+")
_OF_A_DAY = re.compile(r"\d{1,2}:\d\d:\d\d(?:\.\d+)?")


def _as_iso(date: re.Match[str]) -> str:
    return f"{date[3]}-{int(date[2]):02d}-{int(date[1]):02d} "


def as_dates(given: pd.Series, start: int) -> pd.Series | None:
    """Return dates, durations or texts of such in ns after `start`, as whole numbers.

    Texts are of ISO 8601, dates with points (the day first), or times of a day; a comma may stand
    before fractions of a second. None if some are something else.
    """
    import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

    if given.dtype.kind not in "mMOUST" or pd.api.types.is_numeric_dtype(given):
        return None
    times = given
    if given.dtype.kind not in "mM":
        if not given.map(lambda x: isinstance(x, str)).all() or to_numbers(given).notna().any():
            return None
        texts = given.str.strip().str.replace(r"(?<=:\d\d),(?=\d+$)", ".", regex=True)
        texts = texts.str.replace(_POINTED, _as_iso, regex=True)
        times = pd.to_datetime(texts, format="ISO8601", errors="coerce", utc=True)
        if times.isna().all() and texts.str.fullmatch(_OF_A_DAY).all():
            times = pd.to_timedelta(texts)
    if times.isna().any():
        return None
    if getattr(times.dtype, "tz", None) is not None:
        times = times.dt.tz_convert(None)
    kind = "timedelta64[ns]" if times.dtype.kind == "m" else "datetime64[ns]"
    return pd.Series(times.to_numpy(kind).astype(np.int64) - start)


def to_numbers(given: pd.Series) -> pd.Series:
    """Return a column as numbers; NaN for what is none."""
    import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

    return pd.to_numeric(given, errors="coerce")


def as_times(given: pd.Series, time: Column) -> pd.Series:
    """Return a column of times in seconds; as it is where it holds what is no time."""
    import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

    if time.dates is not None:
        dates = as_dates(given, time.dates)
        return given if dates is None else dates * 1e-9
    if time.factor == 1.0 and not time.offset:
        return given
    times = to_numbers(given)
    return given if times.isna().any() else pd.Series(time.scale(times.to_numpy(float)))


def _with(naming: Naming, time: Column, *notes: str) -> Naming:
    columns = tuple(time if c.name == "t" else c for c in naming.columns)
    return replace(naming, columns=columns, notes=(*naming.notes, *notes))


def _find_unit(t: Array, source: str) -> tuple[str, str]:
    """Return the unit of times (N,) and why; nothing for seconds.

    Raises
    ------
    LogError
        If it may be more than one.
    """
    step = float(np.median(np.diff(t)))
    if step <= RULES.slowest_step:
        return "", ""
    fits = [u for u, size in TIME_UNITS.items() if RULES.steps[0] <= step * size <= RULES.steps[1]]
    dated = [u for u in fits if RULES.epoch[0] < t[0] * TIME_UNITS[u] < RULES.epoch[1]]
    fits = dated or fits
    if not fits:  # what is wrong with them is said by others
        return "", ""
    each = [f"{u} ({1 / (step * TIME_UNITS[u]):.4g} Hz)" for u in fits]
    if len(fits) == 1:
        return fits[0], f"for they rise by {step:.6g} from sample to sample: {each[0]}"
    raise LogError(
        f"{source}: the times rise by {step:.6g} from sample to sample, which may be "
        f"{' or '.join(each)}; say their unit with --set time_unit, or with `unit` under "
        "[time] in the sidecar."
    )
