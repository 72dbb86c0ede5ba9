"""Scenes of MuJoCo, its own arrays as logs, files of other endings, and robots on legs."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pandas as pd

from foreign.case import Case, Writer, csv, joints
from foreign.tables import stored

CUP = """<body name="cup" pos="1 0 1"><freejoint name="loose"/>
  <geom type="box" size=".1 .1 .1" mass="2"/></body>"""
DOOR = """<body name="door"><joint name="hinge" axis="0 0 1" damping="1"/>
  <geom type="box" size=".5 .1 1" mass="9"/></body>"""
GEARS = {"shoulder": 2.0, "elbow": -0.5}


def beside(*objects: str, behind: bool = False) -> Callable[[str], str]:
    """Return what puts objects into a robot's world, before it or behind."""
    mark = "</worldbody>" if behind else "<worldbody>"
    new = "".join(objects)
    return lambda s: s.replace(mark, new + mark if behind else mark + new, 1)


def geared(text: str) -> str:
    """Return the two-link arm with gears."""
    for joint, gear in GEARS.items():
        text = text.replace(f'joint="{joint}"/>', f'joint="{joint}" gear="{gear}"/>')
    return text


def both(*changes: Callable[[str], str]) -> Callable[[str], str]:
    def change(text: str) -> str:
        for each in changes:
            text = each(text)
        return text

    return change


def arrays(
    torque: str = "qfrc_actuator",
    first: int = 0,
    speed: int = 0,
    start: int = 0,
    form: str = "{}[{}]",
) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """Return what makes a log MuJoCo's arrays, of which the robot's begin at `first`, `speed`."""

    def change(frame: pd.DataFrame) -> pd.DataFrame:
        out: dict[str, np.ndarray] = {"time": frame["t"].to_numpy()}
        rng = np.random.default_rng(0)
        for k in range(first):  # of what stands before the robot
            out[form.format("qpos", k + start)] = rng.normal(size=len(frame))
        for k in range(speed if torque == "qfrc_actuator" else 0):
            out[form.format(torque, k + start)] = np.zeros(len(frame))
        before = speed if torque == "qfrc_actuator" else 0
        for k, j in enumerate(joints(frame)):
            gear = 1.0 if torque == "qfrc_actuator" else GEARS[j]
            out[form.format("qpos", first + k + start)] = frame[f"{j}.q"].to_numpy()
            out[form.format(torque, before + k + start)] = frame[f"{j}.tau"].to_numpy() / gear
        return pd.DataFrame(out)

    return change


def table(change: Callable[[pd.DataFrame], pd.DataFrame]) -> Writer:
    return csv(lambda f, _: change(f))


def stacked(frame: pd.DataFrame) -> dict[str, np.ndarray]:
    """Return MuJoCo's arrays as a script saves them, a cup before the robot."""
    whole = arrays(first=7, speed=6)(frame)
    kinds = {c.partition("[")[0] for c in whole} - {"time"}
    out = {k: whole[[c for c in whole if c.startswith(k)]].to_numpy() for k in kinds}
    return {"time": whole["time"].to_numpy(), **out}


BODY = """<inertial><mass value="2"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/>
  </inertial>"""


def dog(_: str) -> str:
    """Return a robot on two legs."""
    parts = [f'<link name="trunk">{BODY}</link>']
    for leg in "lr":
        parts += [
            f'<link name="{leg}_{name}">{BODY}</link><joint name="{leg}_{name}" type="revolute">'
            f'<parent link="{above}"/><child link="{leg}_{name}"/><axis xyz="0 1 0"/>'
            '<limit lower="-1" upper="1" effort="5" velocity="2"/></joint>'
            for name, above in (("hip", "trunk"), ("knee", f"{leg}_hip"))
        ]
    return f'<robot name="dog">{"".join(parts)}</robot>'


def _case(
    name: str,
    write: Writer,
    *words: str,
    scene: Callable[[str], str] | None = None,
    robot: str = "two-link",
    sidecar: str = "",
) -> Case:
    return Case(name, "scenes", write, words, robot, sidecar, scene=scene)


def plain(frame: pd.DataFrame) -> pd.DataFrame:
    return frame


SCENES = [
    _case("a cup before the robot", table(plain), scene=beside(CUP)),
    _case("a cup behind the robot", table(plain), scene=beside(CUP, behind=True)),
    _case("a cup and a door", table(plain), scene=beside(CUP, DOOR)),
    _case("a cup behind a 3-RPS", table(plain), robot="3-rps", scene=both(
        beside(CUP, behind=True), lambda s: re.sub('(qpos="[^"]*)"', r'\1 1 0 1 1 0 0 0"', s))),
    _case("a door behind a five-bar", table(plain), scene=beside(DOOR, behind=True),
          robot="five-bar"),
    _case("qpos and qfrc_actuator", table(arrays()), scene=geared),
    _case("qpos and actuator_force, geared", table(arrays("actuator_force")), scene=geared),
    _case("qpos and ctrl, geared", table(arrays("ctrl")), scene=geared),
    _case("qpos behind a cup", table(arrays(first=7, speed=6)), scene=beside(CUP)),
    _case("qpos behind a cup, from 1", table(arrays(first=7, speed=6, start=1)),
          scene=beside(CUP)),
    _case("actuator_force behind a door", table(arrays("actuator_force", first=1)),
          scene=both(geared, beside(DOOR))),
    _case("qpos_0", table(arrays(form="{}_{}")), scene=geared),
    _case("data.qpos[0]", table(arrays(form="data.{}[{}]")), scene=geared),
    _case("arrays in .npz", stored("log.npz", lambda f, p: np.savez(p, **stacked(f))),
          scene=beside(CUP)),
    _case("actuator_force by actuator", table(lambda f: f.rename(
        columns={f"{j}.tau": f"actuator_force/{j}_motor" for j in joints(f)}).assign(
            **{f"actuator_force/{j}_motor": f[f"{j}.tau"] / GEARS[j] for j in joints(f)})),
          scene=geared),
    _case("torque before the gears of the file", table(lambda f: f.assign(
        **{"shoulder.tau": f["shoulder.tau"] / 2})), "states a gear of 2",
          scene=lambda s: s.replace('joint="shoulder"/>', 'joint="shoulder" gear="2"/>')),
    _case("before the gears of the file, and said", table(lambda f: f.assign(
        **{"shoulder.tau": f["shoulder.tau"] / 2})), sidecar='[torque]\nside = "motor"',
          scene=lambda s: s.replace('joint="shoulder"/>', 'joint="shoulder" gear="2"/>')),
    _case("two motors at a joint and no sum", table(arrays("actuator_force")), "no torque column",
          scene=both(geared, lambda s: s.replace("</actuator>",
                                                 '<general joint="elbow"/></actuator>'))),
    _case("a cup and no robot that moves it", table(plain), scene=beside(
        CUP.replace("cup", "mug"), CUP.replace("loose", "other"))),
    Case("a robot on legs", "scenes", table(plain), ('base = "fixed"',), scene=dog),
]  # fmt: skip

ENDINGS = [
    Case("Feather", "endings", stored("log.feather", lambda f, p: f.to_feather(p)),
         ("holds no text", "are read")),
    Case("Parquet by another name", "endings", stored("log.csv", lambda f, p: f.to_parquet(p)),
         ("is Parquet by its content",)),
    Case("an unknown ending, text", "endings",
         stored("log.trc", lambda f, p: p.write_text(f.to_csv(index=False)))),
    Case("an unknown ending, binary", "endings",
         stored("log.ulg", lambda f, p: p.write_bytes(b"ULog\x01\x12\x35\x01" + bytes(500))),
         ("holds no text",)),
]  # fmt: skip
