"""Robots that real users have: on the ceiling, on the moon, with motors that mix joints.

Their logs come from MuJoCo or Pinocchio and the robot file directly: nothing of the library makes
the truth that the tests expect back.
"""

from __future__ import annotations

import tomllib
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pinocchio as pin
import pytest

RATE, SECONDS = 100.0, 8.0

JOINTS = ("shoulder", "elbow")

#: Mass, centre of mass and inertia about it (xx, yy, zz, xy, xz, yz) of both links.
LINKS = {
    "link1": (4.0, (0.2, 0.02, 0.01), (0.02, 0.09, 0.08, 0.002, 0.0, 0.0)),
    "link2": (2.5, (0.18, 0.03, -0.02), (0.01, 0.035, 0.03, 0.0, 0.001, 0.0)),
}

#: Friction of the joints, and of the motor that turns with the sum of both.
FRICTION = {"shoulder": (1.2, 2.0), "elbow": (0.6, 0.8)}
ROTORS = {"shoulder": 0.05, "elbow": 0.02}
MIXED = {"m2.Fv": 0.3, "m2.Fc": 0.4, "m2.Fc+": 0.4, "m2.Fc-": 0.4, "m2.Ia": 0.03}


def _mjcf(top: str = "", base: str = "") -> str:
    links, joints = [], []
    for (name, (m, c, inertia)), joint in zip(LINKS.items(), JOINTS, strict=True):
        fv, fc = FRICTION[joint]
        links.append(
            f'<body name="{name}" pos="{0 if name == "link1" else 0.5} 0 0"><inertial '
            f'pos="{_row(c)}" mass="{m}" fullinertia="{_row(inertia)}"/>'
        )
        joints.append(
            f'<joint name="{joint}" axis="0 -1 0" damping="{fv}" frictionloss="{fc}" '
            f'armature="{ROTORS[joint]}"/>'
        )
    return f"""<mujoco model="arm"><compiler angle="radian"/>{top}
<worldbody><body name="base" {base}>
{links[0]}{joints[0]}
{links[1]}{joints[1]}</body></body></body></worldbody>
<actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator></mujoco>
"""


def _urdf() -> str:
    parts = ['<link name="base"/>']
    places = ('rpy="1.2 0 0.3"', 'xyz="0.5 0 0" rpy="0.4 0 0"')
    parents = ("base", "link1")
    rows = zip(LINKS.items(), JOINTS, places, parents, strict=True)
    for (name, (m, c, (xx, yy, zz, xy, xz, yz))), joint, place, parent in rows:
        fv, fc = FRICTION[joint]
        parts.append(
            f'<link name="{name}"><inertial><origin xyz="{_row(c)}"/><mass value="{m}"/>'
            f'<inertia ixx="{xx}" ixy="{xy}" ixz="{xz}" iyy="{yy}" iyz="{yz}" izz="{zz}"/>'
            "</inertial></link>"
        )
        parts.append(
            f'<joint name="{joint}" type="continuous"><parent link="{parent}"/><child '
            f'link="{name}"/><origin {place}/><axis xyz="0 0 -1"/>'
            f'<dynamics damping="{fv}" friction="{fc}"/></joint>'
        )
    return '<robot name="arm">\n' + "\n".join(parts) + "\n</robot>\n"


def _row(values) -> str:
    return " ".join(map(str, values))


_MOTORS = """[transmission]
motors = ["m1", "m2"]
coupling = [[1, 0], [1, 1]]
[nominal]
""" + "".join(f'"{name}" = {value}\n' for name, value in MIXED.items())

#: File and sidecar.
CASES = {
    "mixed-motors": (_mjcf(), _MOTORS),
    "ceiling": (_mjcf(base='quat="0 1 0 0"'), ""),
    "own-gravity": (_mjcf('<option gravity="0.5 0 -1.62"/>'), ""),
    "continuous": (_urdf(), ""),
}


@dataclass(frozen=True)
class Case:
    """A robot file and what its logs are made from."""

    name: str
    path: Path

    def log(self, seed: int, noise: float = 0.0) -> pd.DataFrame:
        """Return a log along a random motion; `noise` is a share of each torque's spread."""
        rng = np.random.default_rng(seed)
        t = np.arange(0, SECONDS, 1 / RATE)
        motion = random_motion(t, rng)
        tau = file_torque(self.path, *motion)
        tau += noise * tau.std(0) * rng.normal(size=tau.shape)
        columns = {"t": t}
        for k, joint in enumerate(JOINTS):
            for word, values in zip(("q", "dq", "ddq", "tau"), (*motion, tau), strict=True):
                columns[f"{joint}.{word}"] = values[:, k]
        return pd.DataFrame(columns)

    @property
    def scale(self) -> float:
        """Largest torque of `torque`."""
        return float(np.abs(self.torque()).max())

    def torque(self, path: Path | None = None) -> np.ndarray:
        """Return the torque along one more motion by this file, or by another of this robot."""
        motion = random_motion(np.arange(0, SECONDS, 0.1), np.random.default_rng(99))
        return file_torque(path or self.path, *motion)

    def truth(self) -> dict[str, float]:
        """Return the parameters that the file states, by the library's names."""
        values = dict(MIXED) if self.name == "mixed-motors" else {}
        for body, (m, c, (xx, yy, zz, xy, xz, yz)) in LINKS.items():
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            inertia += m * (np.dot(c, c) * np.eye(3) - np.outer(c, c))
            moments = (m, *(m * np.array(c)))
            kinds = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
            whole = (*moments, *inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]])
            values |= {f"{body}.{k}": v for k, v in zip(kinds, whole, strict=True)}
        for joint, (fv, fc) in FRICTION.items():
            values |= {f"{joint}.Fv": fv} | {f"{joint}.{k}": fc for k in ("Fc", "Fc+", "Fc-")}
            values[f"{joint}.off"] = 0.0
            values[f"{joint}.Ia"] = ROTORS[joint] if self.path.suffix == ".xml" else 0.0
        return values


def random_motion(t: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    w = 2 * np.pi / SECONDS * np.arange(1, 6)[:, None, None]
    a, b = rng.normal(size=(2, 5, 1, 2)) / w
    phase = w * t[:, None]
    s, c = np.sin(phase), np.cos(phase)
    q, dq = a * s + b * c, w * (a * c - b * s)
    return q.sum(0), dq.sum(0), (-(w**2) * q).sum(0)


def file_torque(path: Path, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """Return the torque (N, 2) that a robot file states for a motion; its sidecar comes first."""
    tau, values = (_pinocchio if path.suffix == ".urdf" else _mujoco)(path, q, dq, ddq)
    beside = path.with_suffix(".toml")
    if beside.is_file():
        values |= tomllib.loads(beside.read_text()).get("nominal", {})
    for name, row in {"shoulder": (1, 0), "elbow": (0, 1), "m2": (1, 1)}.items():
        speed = dq @ row
        level = values.get(f"{name}.Fc", 0.0)
        up, down = (values.get(f"{name}.Fc{sign}", level) for sign in "+-")
        force = values.get(f"{name}.Fv", 0.0) * speed + np.where(speed > 0, up, -down)
        tau += (force + values.get(f"{name}.Ia", 0.0) * (ddq @ row))[:, None] * row
    return tau


def _mujoco(path: Path, *motion: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
    model = mujoco.MjModel.from_xml_path(str(path))
    stated = {"Fv": model.dof_damping, "Fc": model.dof_frictionloss, "Ia": model.dof_armature}
    values = {f"{j}.{k}": float(v[i]) for k, v in stated.items() for i, j in enumerate(JOINTS)}
    motors = [model.tendon(i).name for i in range(model.ntendon)]  # that mix joints
    tendons = {
        "Fv": model.tendon_damping, "Fc": model.tendon_frictionloss, "Ia": model.tendon_armature
    }  # fmt: skip
    for k, v in tendons.items():
        values |= {f"{m}.{k}": float(np.ravel(v[i])[0]) for i, m in enumerate(motors)}
    for value in (*stated.values(), *tendons.values()):
        value[:] = 0
    data, out = mujoco.MjData(model), []
    for data.qpos[:], data.qvel[:], data.qacc[:] in zip(*motion, strict=True):
        mujoco.mj_inverse(model, data)
        out.append(data.qfrc_inverse.copy())
    return np.array(out), values


def _pinocchio(path: Path, *motion: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
    model = pin.buildModelFromUrdf(str(path))
    data, zero, values = model.createData(), pin.neutral(model), {}
    for joint in ET.parse(path).getroot().iter("joint"):
        stated = joint.find("dynamics")
        for kind, word in (("Fv", "damping"), ("Fc", "friction")):
            values[f"{joint.get('name')}.{kind}"] = float(stated.get(word, 0))
    out = [
        pin.rnea(model, data, pin.integrate(model, zero, q), dq, ddq)
        for q, dq, ddq in zip(*motion, strict=True)
    ]
    return np.array(out), values


@pytest.fixture(scope="module", params=CASES)
def case(request, tmp_path_factory) -> Case:
    text, sidecar = CASES[request.param]
    suffix = ".urdf" if text.startswith("<robot") else ".xml"
    path = tmp_path_factory.mktemp("defaults") / f"{request.param}{suffix}"
    path.write_text(text)
    if sidecar:
        path.with_suffix(".toml").write_text(sidecar)
    return Case(request.param, path)
