"""Scenes of MuJoCo, its arrays as logs, files of other endings, and robots on legs."""

from __future__ import annotations

import re
from collections.abc import Callable

import pandas as pd

from foreign.case import Case, Writer, csv, joints
from foreign.tables import stored

CUP = """<body name="cup" pos="1 0 1"><freejoint name="loose"/>
  <geom type="box" size=".1 .1 .1" mass="2"/></body>"""
DOOR = """<body name="door"><joint name="hinge" axis="0 0 1" damping="1"/>
  <geom type="box" size=".5 .1 1" mass="9"/></body>"""


def beside(*objects: str, behind: bool = False) -> Callable[[str], str]:
    """Return a function that puts objects into a robot's world, before or after its bodies."""
    mark = "</worldbody>" if behind else "<worldbody>"
    new = "".join(objects)
    return lambda s: s.replace(mark, new + mark if behind else mark + new, 1)


def both(*changes: Callable[[str], str]) -> Callable[[str], str]:
    def change(text: str) -> str:
        for each in changes:
            text = each(text)
        return text

    return change


def arrays(frame: pd.DataFrame, before: int = 0) -> pd.DataFrame:
    """Return a log as MuJoCo's arrays, in which other joints may stand before the robot's."""
    names = {"t": "time"}
    for k, j in enumerate(joints(frame)):
        names |= {f"{j}.q": f"qpos[{before + k}]", f"{j}.tau": f"actuator_force[{k}]"}
    others = {f"qpos[{k}]": 0.0 for k in range(before)}
    return frame[list(names)].rename(columns=names).assign(**others)


def table(change: Callable[[pd.DataFrame], pd.DataFrame]) -> Writer:
    return csv(lambda f, _: change(f))


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
    _case("actuator_force", table(arrays), "no column shoulder.tau"),
    _case("qpos behind a cup", table(lambda f: arrays(f, 7)), "numbers its joints differently",
          scene=beside(CUP)),
    _case("torque before the gears of the file", table(lambda f: f.assign(
        **{"shoulder.tau": f["shoulder.tau"] / 2})), "a wrong scale of the torque",
          scene=lambda s: s.replace('joint="shoulder"/>', 'joint="shoulder" gear="2"/>')),
    _case("before the gears of the file, and said", table(lambda f: f.assign(
        **{"shoulder.tau": f["shoulder.tau"] / 2})), sidecar='[torque]\nside = "motor"',
          scene=lambda s: s.replace('joint="shoulder"/>', 'joint="shoulder" gear="2"/>')),
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
