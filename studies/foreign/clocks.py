"""Times in other units, with gaps, in disorder; rows that come twice."""

from __future__ import annotations

import numpy as np
import pandas as pd

from foreign.case import Case, Writer, csv, joints

#: Some day in 2026 [s since 1970].
EPOCH = 1_780_000_000.0


def timed(factor: float, start: float = 0.0, whole: bool = False) -> Writer:
    """Return a writer of a log with its time in another unit, from another start."""

    def change(frame: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
        t = factor * (frame["t"] + start)
        return frame.assign(t=t.round().astype("int64") if whole else t)

    return csv(change)


def iso(frame: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
    when = pd.to_datetime((1e9 * (frame["t"] + EPOCH)).round().astype("int64"))
    return frame.assign(t=when.dt.strftime("%Y-%m-%dT%H:%M:%S.%f"))


def without_rows(start: int, stop: int) -> Writer:
    return csv(lambda f, _: pd.concat([f.iloc[:start], f.iloc[stop:]]))


def lost_at_random(frame: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    return frame[rng.random(len(frame)) > 0.03]


def jittered(frame: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    return frame.assign(t=frame["t"] + 0.0005 * rng.uniform(-1, 1, len(frame)))


def repeated_samples(frame: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    late = rng.random(len(frame)) < 0.08
    held = frame.mask(pd.Series(late, frame.index), axis=0).ffill().bfill()
    return held.assign(t=frame["t"])


def counter_overflow(frame: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
    ticks = (1e6 * frame["t"]).round().astype("int64") + 2**32 - 3_000_000
    return frame.assign(t=ticks % 2**32)


def mixed_rates(frame: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
    slow = [f"{j}.tau" for j in joints(frame)]
    return frame.assign(**{c: frame[c].where(np.arange(len(frame)) % 4 == 0) for c in slow})


CLOCKS = [
    Case("time in ms", "time", timed(1e3, whole=True), ("'t'", "--set time_unit")),
    Case("time in ms with decimals", "time", timed(1e3), ("'t'", "--set time_unit")),
    Case("time in µs", "time", timed(1e6, whole=True), ("'t'", "--set time_unit")),
    Case("time in ns", "time", timed(1e9, whole=True), ("'t'", "--set time_unit")),
    Case("time since 1970 in s", "time", timed(1.0, EPOCH)),
    Case(
        "time since 1970 in ms", "time", timed(1e3, EPOCH, whole=True), ("'t'", "--set time_unit")
    ),
    Case(
        "time since 1970 in ns", "time", timed(1e9, EPOCH, whole=True), ("'t'", "--set time_unit")
    ),
    Case("dates", "time", csv(iso)),
    Case("time in minutes", "time", timed(1 / 60), ("'t'", "time")),
    Case(
        "the number of the sample",
        "time",
        csv(lambda f, _: f.assign(t=np.arange(len(f)))),
        ("'t'", "time", "sampling"),
    ),
    Case("one lost sample", "time", without_rows(400, 401)),
    Case("three lost samples", "time", without_rows(400, 403)),
    Case("lost samples here and there", "time", csv(lost_at_random), ()),
    Case("a gap of two seconds", "time", without_rows(300, 500)),
    Case("a jittering clock", "time", csv(jittered)),
    Case(
        "a time stamp comes twice",
        "time",
        csv(lambda f, _: f.assign(t=f["t"].where(f.index != 300, f["t"].shift()))),
        ("does not increase", "twice", "same time"),
    ),
    Case(
        "rows in disorder",
        "time",
        csv(
            lambda f, _: f.iloc[
                [*range(200), *range(300, 400), *range(200, 300), *range(400, len(f))]
            ]
        ),
        ("does not increase", "order"),
    ),
    Case(
        "time runs backwards",
        "time",
        csv(lambda f, _: f.iloc[::-1]),
        ("does not increase", "order", "backwards"),
    ),
    Case("time stands still", "time", csv(lambda f, _: f.assign(t=1.0)), ("does not increase",)),
    Case(
        "the time starts again",
        "time",
        csv(lambda f, _: pd.concat([f.iloc[:400], f.iloc[400:].assign(t=f["t"].iloc[400:] - 4.0)])),
        ("does not increase", "starts again"),
    ),
    Case(
        "a counter of µs overflows",
        "time",
        csv(counter_overflow),
        ("does not increase", "overflow"),
    ),
    Case("no time", "time", csv(lambda f, _: f.drop(columns="t")), ("'t'", "--set time_unit")),
    Case("torque at a quarter of the rate", "time", csv(mixed_rates)),
    Case("samples that repeat the one before", "time", csv(repeated_samples)),
    Case(
        "the same rows twice",
        "rows",
        csv(lambda f, _: pd.concat([f, f.assign(t=f["t"] + f["t"].iloc[-1] + 0.01)])),
        ("repeats rows",),
    ),
    Case(
        "every row twice",
        "rows",
        csv(lambda f, _: f.loc[f.index.repeat(2)]),
        ("does not increase", "twice", "repeated"),
    ),
    Case("fifteen samples", "rows", csv(lambda f, _: f.iloc[:15]), ("too few", "too short")),
    Case(
        "a missing value",
        "rows",
        csv(lambda f, _: f.assign(**{"joint_2.tau": f["joint_2.tau"].where(f.index != 99)})),
        ("data row 100", "missing", "bridged"),
    ),
    Case(
        "the word ERROR in a cell",
        "rows",
        csv(
            lambda f, _: f.assign(
                **{"joint_2.tau": f["joint_2.tau"].astype(object).where(f.index != 99, "ERROR")}
            )
        ),
        ("data row 100",),
    ),
    Case(
        "an infinite value",
        "rows",
        csv(lambda f, _: f.assign(**{"joint_2.q": f["joint_2.q"].where(f.index != 99, np.inf)})),
        ("data row 100",),
    ),
    Case(
        "-999 for a lost value",
        "rows",
        csv(
            lambda f, _: f.assign(**{"joint_2.tau": f["joint_2.tau"].where(f.index != 99, -999.0)})
        ),
        ("data row 100",),
    ),
    Case(
        "a row of zeros",
        "rows",
        csv(lambda f, _: f.where(pd.Series(f.index != 99), 0.0).assign(t=f["t"])),
        ("data row 100",),
    ),
    Case(
        "the robot stands still",
        "rows",
        csv(lambda f, _: f.assign(**{f"{j}.q": 0.1 for j in joints(f)})),
        ("does not move", "stand"),
    ),
    Case(
        "a long rest before and after",
        "rows",
        csv(
            lambda f, _: f.iloc[[0] * 400 + [*range(len(f))] + [len(f) - 1] * 400].assign(
                t=lambda g: f["t"].iloc[1] * np.arange(len(g))
            )
        ),
    ),
]
