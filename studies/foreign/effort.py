"""Efforts as drivers report them: of four kinds, of some joints alone; joints that are locked."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd

from foreign.case import Case, Writer, csv, joints, scaled
from identifiability.effects.nominal import gravity_torque
from identifiability.robot import Robot, complete_motion

LIGHT, WRONG = (
    ("compensated for gravity", "gravity (its direction, a compensation)"),
    ("wrong sign", "wrong way"),
)
ROBOTS = ("six-dof-arm", "two-link", "3-rps")


def plot_juggler(column: str) -> str:
    """Return the name of a column in a plotter of joint states."""
    joint, _, kind = column.rpartition(".")
    word = {"q": "position", "dq": "velocity", "tau": "effort"}
    return f"/joint_states/{joint}/{word[kind]}" if joint else "__time"


def lifted(robot: str, only: str = "") -> Writer:
    """Return a writer of the effort without the weight that the driver compensates."""

    def change(frame: pd.DataFrame, _: np.random.Generator) -> pd.DataFrame:
        shipped, q = Robot.load(robot), frame[[f"{j}.q" for j in joints(frame)]].to_numpy()
        motion = complete_motion(shipped, frame["t"].to_numpy(), q, 0 * q, 0 * q)
        g = gravity_torque(shipped, motion, shipped.gravity)
        less = {
            f"{j}.tau": frame[f"{j}.tau"] - g[:, k]
            for k, j in enumerate(joints(frame))
            if only in ("", j)
        }
        return frame.assign(**less).rename(columns=plot_juggler)

    return csv(change)


def effort(factor: float) -> Writer:
    return csv(lambda f, _: scaled(f, "tau", factor).rename(columns=plot_juggler))


def changed(change: Callable[[pd.DataFrame], pd.DataFrame]) -> Writer:
    return csv(lambda f, _: change(f.copy()))


def put(frame: pd.DataFrame, column: str, rows: object, value: float) -> pd.DataFrame:
    frame.loc[rows, column] = value  # type: ignore[index]
    return frame


def kinds(robot: str) -> list[Case]:
    """Return the four kinds of effort of a robot, and the same with the hinted sidecars."""
    case = partial(Case, family="effort", robot=robot)
    return [
        case(f"effort of {robot}", write=effort(1.0)),
        case(f"compensated, {robot}", write=lifted(robot), words=LIGHT),
        case(f"compensated and said, {robot}", write=lifted(robot),
             sidecar="[torque]\ncompensated = true"),
        case(f"before a gear and said, {robot}", write=effort(0.5),
             sidecar='[torque]\nside = "motor"\nratio = 2'),
        case(f"effort of the other sign, {robot}", write=effort(-1.0), words=WRONG),
        case(f"of the other sign and said, {robot}", write=effort(-1.0),
             sidecar="[torque]\nsign = -1"),
    ]  # fmt: skip


def still(value: float) -> Writer:
    return csv(lambda f, _: f.assign(**{"joint_6.q": value}))


EFFORT = [
    *(case for robot in ROBOTS for case in kinds(robot)),
    Case("compensated at one joint", "effort", lifted("six-dof-arm", "joint_2"), ('["joint_2"]',)),
    Case(
        "compensated at one joint and said",
        "effort",
        lifted("six-dof-arm", "joint_2"),
        sidecar='[torque]\ncompensated = ["joint_2"]',
    ),
    Case("per cent in the header", "effort",
         csv(lambda f, _: f.rename(columns=lambda c: f"{c} [%]" if c.endswith("tau") else c)),
         ("in percent",)),
]  # fmt: skip

WRIST = ("joint_6",)
PARTIAL = [
    Case("no effort of the wrist", "partial",
         changed(lambda f: f.drop(columns="joint_6.tau")), (), unmeasured=WRIST),
    Case("NaN for the wrist's effort", "partial",
         changed(lambda f: f.assign(**{"joint_6.tau": np.nan})), (), unmeasured=WRIST),
    Case("NaN for the efforts of two joints", "partial",
         changed(lambda f: f.assign(**{"joint_1.tau": np.nan, "joint_6.tau": np.nan})), (),
         unmeasured=("joint_1", "joint_6")),
    Case("a gripper's effort instead of the wrist's", "partial",
         changed(lambda f: f.assign(**{"finger.q": 0.01}).rename(
             columns={"joint_6.tau": "finger.tau"})), (), unmeasured=WRIST),
    Case("a stretch without effort", "partial",
         changed(lambda f: put(f, "joint_2.tau", slice(200, 300), np.nan))),
    Case("a stretch without any effort", "partial",
         changed(lambda f: f.assign(**{c: f[c].where((f.index < 500) | (f.index > 560))
                                       for c in f.columns if c.endswith("tau")}))),
    Case("efforts lost here and there", "partial",
         changed(lambda f: put(f, "joint_3.tau", range(7, 800, 31), np.nan))),
    Case("effort that begins late", "partial",
         changed(lambda f: put(f, "joint_2.tau", slice(0, 150), np.nan))),
    Case("an effort in every second row", "partial",
         changed(lambda f: f.assign(**{c: f[c].where(f.index % 2 == 0)
                                       for c in f.columns if c.endswith("tau")}))),
    Case("zeros for the wrist's effort", "partial",
         changed(lambda f: f.assign(**{"joint_6.tau": 0.0})), ("was not measured",)),
    Case("no effort at all", "partial",
         changed(lambda f: f.drop(columns=[c for c in f.columns if c.endswith("tau")])),
         ("no column joint_1.tau",)),
    Case("NaN for all efforts", "partial",
         changed(lambda f: f.assign(**{c: np.nan for c in f.columns if c.endswith("tau")})),
         ("no torque",)),
    Case("a finger for the wrist", "partial",
         changed(lambda f: f.rename(columns=lambda c: c.replace("joint_6", "finger"))),
         ("lock=['joint_6']",)),
]  # fmt: skip

LOCKS = [
    Case("a lock that the log moves", "locks", csv(lambda f, _: _moving(f)),
         ("is locked, but",), lock=("joint_6",), never=True),
    Case("a lock that a plotted log moves", "locks",
         csv(lambda f, _: _moving(f).rename(columns=plot_juggler)), ("is locked, but",),
         lock=("joint_6",), never=True),
    Case("a lock that moves in degrees", "locks",
         csv(lambda f, _: _moving(f).rename(columns={"joint_6.q": "joint_6.q [deg]"})),
         ("is locked, but",), lock=("joint_6",), never=True),
    Case("a lock that moves late", "locks",
         csv(lambda f, _: f.assign(**{"joint_6.q": np.where(f.index > 600, 0.4, 0.0)})),
         ("is locked, but",), lock=("joint_6",), never=True),
    Case("a lock that holds", "locks", still(0.0), lock=("joint_6",)),
    Case("a lock that is not in the log", "locks", csv(lambda f, _: f), lock=("joint_6",)),
    Case("a lock elsewhere", "locks", still(0.5), ("--lock joint_6=0.5",), lock=("joint_6",)),
    Case("a lock where the joint stands", "locks", still(0.0), lock=("joint_6=0.0",)),
]  # fmt: skip


def _moving(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(**{"joint_6.q": 0.4 * np.sin(frame["t"])})


DERIVATIVES = [
    Case("accelerations of another motion", "derivatives",
         changed(lambda f: _derived(f, 1.0, 37))),
    Case("velocities of another motion", "derivatives", changed(lambda f: _derived(f, 1.0, 0, 37))),
    Case("accelerations of half the size", "derivatives", changed(lambda f: _derived(f, 0.6))),
]  # fmt: skip


def _derived(frame: pd.DataFrame, factor: float, late: int = 0, both: int = 0) -> pd.DataFrame:
    for j in joints(frame):
        v = np.gradient(frame[f"{j}.q"], frame["t"])
        a = np.gradient(v, frame["t"])
        frame[f"{j}.dq"], frame[f"{j}.ddq"] = np.roll(v, both), factor * np.roll(a, late + both)
    return frame
