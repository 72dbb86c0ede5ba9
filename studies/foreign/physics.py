"""Angles, torque and joints that contradict robot file, limits or physics."""

from __future__ import annotations

import numpy as np
import pandas as pd

from foreign.case import Case, Change, Writer, csv, joints, scaled

TURN = 2 * np.pi

#: Current a torque for six drives [A/(N·m)]: torque constants and gears differ.
CURRENTS = (0.08, 0.06, 0.11, 0.3, 0.35, 0.5)

#: Rated torque [N·m], of which a drive gives per cent.
RATED = (300.0, 300.0, 150.0, 30.0, 25.0, 15.0)

#: Ratios of gears.
GEARS = (160.0, 160.0, 120.0, 100.0, 80.0, 50.0)

UNIT = (
    "torque that the robot file predicts",
    "a wrong scale of the torque",
    "fits better in another unit",
)


def every(kind: str, factor: object, only: str = "") -> Writer:
    return csv(lambda f, _: scaled(f, kind, factor, only))


def column(name: str, change: Change | object) -> Writer:
    """Return a writer of a log with one changed column: its values in, its values out."""
    return csv(lambda f, rng: f.assign(**{name: change(f[name].to_numpy(copy=True), rng)}))  # type: ignore[operator]


def shifted(samples: int, only: tuple[str, ...] = ()) -> Writer:
    def change(frame: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
        names = [f"{j}.tau" for j in joints(frame) if not only or j in only]
        return frame.assign(**{n: np.roll(frame[n], samples) for n in names})

    return csv(change)


def exchanged(first: str, second: str) -> Writer:
    swap = {first: second, second: first}
    return csv(lambda f, _: f.rename(columns=swap)[f.columns])


def turned(turns: float, only: str) -> Writer:
    return column(f"{only}.q", lambda x, _: x + turns * TURN)


def hold(start: int, stop: int) -> Change | object:
    def change(x: np.ndarray, _: np.random.Generator) -> np.ndarray:
        x[start:stop] = x[start]
        return x

    return change


def clip(share: float) -> Change | object:
    return lambda x, _: np.clip(x, -share * np.abs(x).max(), share * np.abs(x).max())


def at(row: int, factor: float) -> Change | object:
    def change(x: np.ndarray, _: np.random.Generator) -> np.ndarray:
        x[row] *= factor
        return x

    return change


def all_frozen(frame: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
    held = frame.copy()
    held.iloc[300:360, 1:] = held.iloc[300, 1:].to_numpy()
    return held


def spinning(frame: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
    """Wrap an angle that leaves one turn: the zero of the encoder lies inside its range."""
    q = frame["joint_1.q"]
    return frame.assign(**{"joint_1.q": (q - q.mean()) % TURN + q.mean()})


ANGLES = [
    Case("degrees", "angles", every("q", 180 / np.pi), ("degrees",)),
    Case("degrees at one joint", "angles", every("q", 180 / np.pi, "joint_2"), ("degrees",)),
    Case("degrees, a two-link arm", "angles", every("q", 180 / np.pi), ("degrees",), "two-link"),
    Case("mm for m", "angles", every("q", 1e3), ("mm",), "3-rps"),
    Case("a whole turn more", "angles", turned(1, "joint_4"), quiet=True),
    Case("three turns less", "angles", turned(-3, "joint_1"), quiet=True),
    Case("a wrapped angle", "angles", csv(spinning)),
    Case(
        "an encoder of 0.1 mrad",
        "angles",
        csv(
            lambda f, _: f.assign(
                **{c: 1e-4 * (f[c] / 1e-4).round() for c in f.columns if c.endswith(".q")}
            )
        ),
        quiet=True,
    ),
    Case(
        "two exchanged positions",
        "angles",
        exchanged("joint_4.q", "joint_5.q"),
        ("The positions of joint_4 and joint_5",),
    ),
    Case(
        "two exchanged joints",
        "angles",
        csv(
            lambda f, _: f.rename(
                columns={
                    "joint_2.q": "joint_3.q",
                    "joint_3.q": "joint_2.q",
                    "joint_2.tau": "joint_3.tau",
                    "joint_3.tau": "joint_2.tau",
                }
            )[f.columns]
        ),
        ("The joints joint_2 and joint_3 seem to be exchanged",),
    ),
    Case("a position hangs", "angles", column("joint_2.q", hold(300, 360)), ("hung",)),
    Case("all columns hang", "angles", csv(all_frozen), ("hung",)),
    Case("a wrong position", "angles", column("joint_3.q", at(200, 3.0)), ("data row 201",)),
    Case(
        "velocity in degrees a second",
        "angles",
        csv(
            lambda f, _: f.assign(
                **{f"{j}.dq": 180 / np.pi * np.gradient(f[f"{j}.q"], f["t"]) for j in joints(f)}
            )
        ),
        ("derivative", "unit"),
    ),
    Case(
        "the velocity of another joint",
        "angles",
        csv(
            lambda f, _: f.assign(
                **{
                    f"{j}.dq": np.gradient(f[f"{k}.q"], f["t"])
                    for j, k in zip(joints(f), [*joints(f)[1:], "joint_1"], strict=True)
                }
            )
        ),
        ("contradicts",),
    ),
    Case(
        "a velocity that is zero",
        "angles",
        csv(lambda f, _: f.assign(**{f"{j}.dq": 0.0 for j in joints(f)})),
        ("contradicts",),
    ),
    Case("a position of the other sign", "angles", every("q", -1.0, "joint_2"), ("sign",)),
    Case(
        "a zero that is 90° off",
        "angles",
        column("joint_2.q", lambda x, _: x + np.pi / 2),
        ("zero and unit of the positions", "a wrong zero of an encoder in joint_2"),
    ),
]

TORQUE = [
    Case("mN·m", "torque", every("tau", 1e3), UNIT),
    Case("kN·m", "torque", every("tau", 1e-3), UNIT),
    Case("N·cm", "torque", every("tau", 1e2), UNIT),
    Case("pound-inches", "torque", every("tau", 8.8507), UNIT),
    Case("mN·m, a two-link arm", "torque", every("tau", 1e3), UNIT, "two-link"),
    Case("mN, a 3-RPS", "torque", every("tau", 1e3), UNIT, "3-rps"),
    Case("currents in A", "torque", every("tau", CURRENTS), UNIT),
    Case("currents in mA", "torque", every("tau", [1e3 * c for c in CURRENTS]), UNIT),
    Case("per cent of the rated torque", "torque", every("tau", [1e2 / r for r in RATED]), UNIT),
    Case("tenths of a per cent of it", "torque", every("tau", [1e3 / r for r in RATED]), UNIT),
    Case("before the gears", "torque", every("tau", [1 / g for g in GEARS]), UNIT),
    Case("one gain of 20", "torque", every("tau", 20.0, "joint_2"), ("joint_2",)),
    Case("one gain of 1/50", "torque", every("tau", 0.02, "joint_3"), ("joint_3",)),
    Case("the other sign", "torque", every("tau", -1.0), ("wrong sign",)),
    Case("the other sign at one joint", "torque", every("tau", -1.0, "joint_2"), ("wrong sign",)),
    Case(
        "two exchanged columns", "torque", exchanged("joint_2.tau", "joint_3.tau"), ("exchanged",)
    ),
    Case(
        "two exchanged small columns",
        "torque",
        exchanged("joint_5.tau", "joint_6.tau"),
        ("exchanged",),
    ),
    Case(
        "positions for torque",
        "torque",
        csv(lambda f, _: f.assign(**{f"{j}.tau": f[f"{j}.q"] for j in joints(f)})),
        ("torque that the robot file predicts", "than a constant torque"),
    ),
    Case("nothing but zeros", "torque", every("tau", 0.0), ("zero",)),
    Case("one column of zeros", "torque", every("tau", 0.0, "joint_3"), ("was not measured",)),
    Case(
        "one constant column",
        "torque",
        column("joint_3.tau", lambda x, _: 0 * x + 1.5),
        ("was not measured",),
    ),
    Case(
        "constant columns",
        "torque",
        csv(lambda f, _: f.assign(**{f"{j}.tau": 1.5 for j in joints(f)})),
        ("never changes",),
    ),
    Case(
        "noise for torque",
        "torque",
        csv(lambda f, rng: f.assign(**{f"{j}.tau": rng.normal(size=len(f)) for j in joints(f)})),
        ("torque that the robot file predicts", "explain", "than a constant torque"),
    ),
    Case(
        "noise for a joint's torque",
        "torque",
        column("joint_2.tau", lambda x, rng: rng.normal(size=len(x))),
        ("joint_2",),
    ),
    Case(
        "a drive at its limit", "torque", column("joint_2.tau", clip(0.6)), ("joint_2.tau' stays",)
    ),
    Case(
        "all drives at their limits",
        "torque",
        csv(
            lambda f, rng: f.assign(
                **{f"{j}.tau": clip(0.6)(f[f"{j}.tau"].to_numpy(), rng) for j in joints(f)}
            )
        ),
        ("stays",),
    ),  # type: ignore[operator]
    Case("a torque hangs", "torque", column("joint_2.tau", hold(300, 360)), ("hung",)),
    Case("a joint 0.1 s late", "torque", shifted(10, ("joint_2",)), ("late",)),
    Case("a small joint 0.1 s late", "torque", shifted(10, ("joint_4",)), ("late",)),
    Case("all joints 0.1 s late", "torque", shifted(10), ("late",)),
    Case("all joints 0.05 s early", "torque", shifted(-5), ("early",)),
    Case("one torque times 1000", "torque", column("joint_2.tau", at(200, 1e3)), ("data row 201",)),
    Case(
        "a burst of wrong torque",
        "torque",
        column(
            "joint_2.tau", lambda x, _: np.where(np.abs(np.arange(len(x)) - 300) < 8, 30 * x, x)
        ),
        ("farther from the model",),
    ),
    Case(
        "coarse torque",
        "torque",
        csv(
            lambda f, _: f.assign(
                **{c: 0.05 * (f[c] / 0.05).round() for c in f.columns if c.endswith("tau")}
            )
        ),
    ),
    Case(
        "a force that is a command, sliders",
        "torque",
        csv(
            lambda f, rng: f.assign(
                **{f"{j}.tau": 0.2 + 0.01 * rng.normal(size=len(f)) for j in joints(f)}
            )
        ),
        ("check the torque unit",),
        "3-rps",
    ),
]
