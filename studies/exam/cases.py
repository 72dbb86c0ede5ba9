"""The cases of the exam: each writes a folder with `case.toml`, a robot and logs.

Logs of real arms are read in place and converted to one table of SI columns, in a cache that is
no part of the project. Simulated cases follow from their seed alone.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hidden_physics_cases as foreign
import kuka_lwr4
import mujoco
import numpy as np
import pandas as pd
import staubli_tx40
from hidden_physics import Machine
from hidden_physics_laws import INSIDE, Hidden
from paper_study.stand_in import run_machine
from real_data import FOLDER
from real_logs import cut
from shared import data_folder

from exam.newton_euler import STEP, Arm, simulate, slow_noise
from identifiability import Log, Robot
from identifiability.foundation.names import Array
from identifiability.logs.conventions import Conventions
from identifiability.simulation import shipped_trajectory

#: Kinds of inertial parameters, in the order of `Arm.inertial`.
KINDS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")

#: Seconds of a simulated log, and rows a second.
SECONDS, RATE = 10.0, 250

#: Licences of simulated cases and of the sets whose source states none.
OURS, UNSTATED = "that of the project", "see SOURCE.txt of the data"


@dataclass(frozen=True)
class CaseSource:
    """A case: its name, title, origin, writer, and the data set it needs."""

    name: str
    title: str
    source: str
    write: Callable[[Path, Path], dict[str, Any]]
    licence: str = OURS
    kind: str = "torque"
    data: str = ""

    def make(self, cache: Path, data: Path | None = None) -> Path | None:
        """Write the case into the cache unless it is there; None without its data set."""
        folder, place = cache / self.name, data_folder(self.data, data)
        if (folder / "case.toml").is_file():
            return folder
        if self.data and not place.is_dir():
            return None
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        entry = self.write(folder, place)
        exam = {k: getattr(self, k) for k in ("title", "source", "licence", "kind")}
        exam |= {"truth": "truth.toml"} if (folder / "truth.toml").is_file() else {}
        text = "".join(f"{k} = {json.dumps(v)}\n" for k, v in entry.items())
        lines = "".join(f"{k} = {json.dumps(v, ensure_ascii=False)}\n" for k, v in exam.items())
        (folder / "case.toml").write_text(f"{text}\n[exam]\n{lines}", encoding="utf-8")
        return folder


def write_logs(folder: Path, fitted: Sequence[Log], unseen: Sequence[Log]) -> dict[str, Any]:
    """Write logs of torque as tables of SI columns, and return their keys of the case."""
    names: dict[str, list[str]] = {"logs": [], "validate": []}
    for key, logs in (("logs", fitted), ("validate", unseen)):
        for k, log in enumerate(logs):
            frame = {"t": log.t - log.t[0]}
            for j, joint in enumerate(log.joints):
                frame |= {f"{joint}.q": log.q[:, j], f"{joint}.tau": log.tau[:, j]}
            names[key].append(f"{'fit' if key == 'logs' else 'unseen'}{k + 1}.csv")
            pd.DataFrame(frame).to_csv(folder / names[key][-1], index=False, float_format="%.9g")
    return dict(names)


def write_truth(folder: Path, parameters: Mapping[str, float], **others: Any) -> None:
    """Write the truth of a simulated case."""
    lines = [f"{k} = {json.dumps(v)}\n" for k, v in others.items() if k != "z"]
    for title, table in (("parameters", parameters), ("z", others.get("z", {}))):
        lines.append(f"[{title}]\n")
        lines += [f"{json.dumps(k)} = {float(v)!r}\n" for k, v in table.items()]
    (folder / "truth.toml").write_text("".join(lines), encoding="utf-8")


# Real arms.


def _kuka(folder: Path, data: Path) -> dict[str, Any]:
    robot = kuka_lwr4.load_robot(data)
    logs = [kuka_lwr4.load_log(data, robot, k) for k in (1, 3)]
    sidecar = str(FOLDER / "kuka_lwr4.toml")
    entry = {"robot": str(data / "kuka_lwr4.urdf"), "sidecar": sidecar}
    return entry | write_logs(folder, logs[:1], logs[1:])


def _tx40(folder: Path, data: Path) -> dict[str, Any]:
    robot = staubli_tx40.load_robot(data)
    thirds = cut(staubli_tx40.load_log(data, robot, 2 / 3), 2)  # the last third is sealed
    sidecar = str(FOLDER / "staubli_tx40.toml")
    entry = {"robot": str(data / "tx40_mdh_modified.urdf"), "sidecar": sidecar}
    return entry | write_logs(folder, thirds[:1], thirds[1:])


def _ur10(folder: Path, data: Path) -> dict[str, Any]:
    halves = cut(Log.read(f"{data / 'ur10_exciting.db3'}:/joint_states"), 2)
    return {"robot": str(data / "ur10.urdf")} | write_logs(folder, halves[:1], halves[1:])


def _kr300(folder: Path, data: Path) -> dict[str, Any]:
    robot = Robot.from_dh(data / "dh.toml", folder / "robot.urdf")
    logs = [Log.read(data / f"{k}.csv", Conventions.of(robot)) for k in "ACB"]
    (folder / "robot.toml").unlink()  # written columns are in radians, at the joints
    return {"robot": "robot.urdf"} | write_logs(folder, logs[:2], logs[2:])


def _so101(folder: Path, data: Path) -> dict[str, Any]:
    (folder / "robot.toml").write_text('[servo]\nkp = "fit"\n', encoding="utf-8")
    fitted = ("chirp_sweep", "multisine", "large_amplitude")
    return {
        "robot": str(data / "so101.urdf"),
        "sidecar": "robot.toml",
        "logs": [str(data / f"{name}.csv") for name in fitted],
        "validate": [str(data / "friction_gravity.csv")],
    }


# Closed chains and MuJoCo.


def _paper(folder: Path, _: Path) -> dict[str, Any]:
    robot, logs = Robot.load("3-rps"), []
    for seed, name in enumerate(("571", "595", "601")):
        record = run_machine(robot, shipped_trajectory(robot, name), 1, seed)
        q, tau = record.q[0], record.force[0]
        logs.append(Log(name, robot.joints, record.t, q, tau, None, None, name))
    entry = {"robot": str(robot.path)}
    return entry | write_logs(folder, logs[:2], logs[2:])


def _mujoco(name: str, seed: int, family: str, joint: str) -> Callable[[Path, Path], Any]:
    """Return a writer of a simulation by MuJoCo with one hidden effect, or none."""

    def write(folder: Path, _: Path) -> dict[str, Any]:
        rng = np.random.default_rng(seed)
        robot = foreign.write_robot(folder, name, rng)
        case = foreign.Case(robot, "strong" if family else "null", rng)

        def draw() -> list[tuple[Hidden, str]]:
            return [(INSIDE[family](rng, case.joint(joint)), joint)] if family else []

        case.draw = draw  # type: ignore[method-assign]
        said = case.write(folder)
        logs = [Log.read(folder / f"{k}.parquet") for k in foreign.LOGS[:4]]
        hidden = [f"{e['family']} {e['place']}" for e in said["effects"]]
        z = {h: e["z"] for h, e in zip(hidden, said["effects"], strict=True)}
        write_truth(folder, machine_truth(case.machine, robot), effects=hidden, z=z)
        for path in folder.glob("*.parquet"):
            path.unlink()
        return {"robot": robot.path.name} | write_logs(folder, logs[:3], logs[3:])

    return write


def machine_truth(machine: Machine, robot: Robot) -> dict[str, float]:
    """Return the standard parameters of a MuJoCo model, about the origins of its bodies."""
    model, out = machine.model, {}
    for body in robot.bodies:
        at = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[at])
        R, m, c = turn.reshape(3, 3), model.body_mass[at], model.body_ipos[at]
        tensor = R @ np.diag(model.body_inertia[at]) @ R.T
        tensor += m * (c @ c * np.eye(3) - np.outer(c, c))
        values = [m, *(m * c), *tensor[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]]
        out |= {f"{body}.{kind}": float(x) for kind, x in zip(KINDS, values, strict=True)}
    for k, joint in enumerate(robot.joints):
        out[f"{joint}.Ia"] = float(model.dof_armature[machine.dofs[k]])
        out |= {f"{joint}.Fv": machine.viscous[k], f"{joint}.Fc": machine.dry[k]}
        out[f"{joint}.off"] = 0.0
    return out


# The second simulator.

AXES = np.array([[0, 0, 1.0], [0, 1.0, 0], [0, 1.0, 0]])
OFFSETS = np.array([[0, 0, 0.3], [0.05, 0, 0.1], [0.4, 0, 0]])
MASSES = np.array([9.0, 7.0, 4.0])
CENTRES = np.array([[0.01, 0.0, 0.05], [0.19, 0.02, 0.01], [0.16, -0.01, 0.02]])
SIZES = np.array([[0.05, 0.05, 0.04], [0.02, 0.11, 0.1], [0.01, 0.06, 0.06]])
JOINTS = ("joint_1", "joint_2", "joint_3")


def draw_arm(rng: np.random.Generator) -> tuple[Arm, str]:
    """Return a machine and its URDF, whose masses are wrong by up to a quarter."""
    factor = rng.uniform(0.75, 1.25, 3)
    rows, links = [], ['<link name="base"/>']
    for k in range(3):
        m, c = MASSES[k] * factor[k], CENTRES[k] * rng.uniform(0.9, 1.1, 3)
        tensor = np.diag(SIZES[k]) * factor[k] + m * (c @ c * np.eye(3) - np.outer(c, c))
        rows.append([m, *(m * c), *tensor[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])
        x, y, z = CENTRES[k]
        xx, yy, zz = SIZES[k]
        links.append(
            f'<link name="link_{k + 1}"><inertial><origin xyz="{x} {y} {z}"/>'
            f'<mass value="{MASSES[k]}"/><inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" '
            'ixz="0" iyz="0"/></inertial></link>'
        )
        parent = f"link_{k}" if k else "base"
        place, axis = (" ".join(map(str, v[k])) for v in (OFFSETS, AXES))
        links.append(
            f'<joint name="joint_{k + 1}" type="revolute"><parent link="{parent}"/>'
            f'<child link="link_{k + 1}"/><origin xyz="{place}"/><axis xyz="{axis}"/>'
            '<limit lower="-3" upper="3" effort="200" velocity="6"/></joint>'
        )
    dry, viscous = rng.uniform(2, 5, 3), rng.uniform(1, 4, 3)
    arm = Arm(AXES, OFFSETS, np.array(rows), rng.uniform(0.1, 0.3, 3), viscous, dry)
    return arm, f'<robot name="arm">{"".join(links)}</robot>'


def draw_paths(rng: np.random.Generator, runs: int) -> Array:
    """Return commands (L, N, 3) [rad] at each step: sums of five sines that begin at rest."""
    t = np.arange(0.0, SECONDS, STEP)
    waves = 2 * np.pi * np.arange(1, 6) / SECONDS
    size = rng.uniform(0.3, 1.0, (runs, 3, 5)) / np.arange(1, 6) ** 0.5
    phase = rng.uniform(0, 2 * np.pi, (runs, 3, 5))
    path = (size[..., None] * np.sin(waves[:, None] * t + phase[..., None])).sum(2)
    ramp = np.clip(t / 1.0, 0, 1)
    start: Array = np.moveaxis(path * (3 - 2 * ramp) * ramp**2, 1, 2)
    return start


def _newton_euler(
    seed: int,
    *,
    stribeck: int = 0,
    exchanged: bool = False,
    noise: float = 2e-6,
    commanded: bool = False,
) -> Callable[[Path, Path], dict[str, Any]]:
    """Return a writer of a simulation by the second simulator.

    Parameters
    ----------
    seed : int
    stribeck : int
        Joint with a hidden static level, from 1.
    exchanged : bool
        Whether the torque columns of joints 2 and 3 are exchanged.
    noise : float [rad]
        Standard deviation of positions.
    commanded : bool
        Whether logs hold commands in place of torque.
    """

    def write(folder: Path, _: Path) -> dict[str, Any]:
        rng = np.random.default_rng(seed)
        arm, text = draw_arm(rng)
        static = np.where(np.arange(1, 4) == stribeck, 1.8, 1.0)
        arm = Arm(**(vars(arm) | {"static": static}))
        (folder / "robot.urdf").write_text(text, encoding="utf-8")
        kp, kv = np.array([400.0, 500.0, 300.0]), np.array([30.0, 40.0, 15.0])
        if commanded:
            return _write_commands(folder, arm, rng, kp, kv)
        q, tau = simulate(arm, draw_paths(rng, 3), kp, kv, drive=True)
        every = round(1 / STEP / RATE)
        t = STEP * np.arange(0, q.shape[1], every)
        rms = np.sqrt((tau**2).mean((0, 1)))
        order = [0, 2, 1] if exchanged else [0, 1, 2]
        logs = []
        for k in range(3):
            seen = q[k, ::every] + noise * rng.standard_normal((len(t), 3))
            force = tau[k, ::every] + 0.02 * rms * slow_noise(rng, (len(t), 3), 0.9)
            logs.append(Log(f"{k}", JOINTS, t, seen, force[:, order], None, None, f"{k}"))
        hidden = [f"stribeck_friction joint_{stribeck}"] if stribeck else []
        part = arm.dry[stribeck - 1] * (static[stribeck - 1] - 1)
        speed = np.gradient(q[:2, :, stribeck - 1], STEP, axis=1)
        lost = part * np.exp(-((speed / arm.stribeck) ** 2)) * np.sign(speed)
        z = {h: float(np.sqrt((lost[:, ::every] ** 2).sum()) / (0.02 * rms[stribeck - 1]))
             for h in hidden}  # fmt: skip
        columns = [["joint_2.tau", "joint_3.tau"]] if exchanged else []
        write_truth(folder, arm_truth(arm), effects=hidden, columns=columns, z=z)
        return {"robot": "robot.urdf"} | write_logs(folder, logs[:2], logs[2:])

    return write


def _write_commands(
    folder: Path, arm: Arm, rng: np.random.Generator, kp: Array, kv: Array
) -> dict[str, Any]:
    """Write logs of positions and commands of an arm with servos, and its sidecar."""
    wanted = draw_paths(rng, 3)
    q, _ = simulate(arm, wanted, kp, kv, drive=False)
    lines = ["[servo]\n"]
    for name, gains in (("kp", kp), ("kv", kv)):
        table = ", ".join(f"{j} = {x}" for j, x in zip(JOINTS, gains, strict=True))
        lines.append(f"{name} = {{{table}}}\n")
    (folder / "robot.toml").write_text("".join(lines), encoding="utf-8")
    every = round(1 / STEP / RATE)
    names = ("fit1.csv", "fit2.csv", "unseen1.csv")
    for k, name in enumerate(names):
        seen = q[k, ::every] + 1e-4 * rng.standard_normal((len(q[k, ::every]), 3))
        frame = {"t": STEP * np.arange(0, q.shape[1], every)}
        for j, joint in enumerate(JOINTS):
            frame |= {f"{joint}.q": seen[:, j], f"{joint}.cmd": wanted[k, ::every, j]}
        pd.DataFrame(frame).to_csv(folder / name, index=False, float_format="%.9g")
    write_truth(folder, arm_truth(arm))
    return {"robot": "robot.urdf", "logs": [*names[:2]], "validate": [names[2]]}


def arm_truth(arm: Arm) -> dict[str, float]:
    """Return the standard parameters of an arm."""
    out = {}
    for k, joint in enumerate(JOINTS):
        out |= {f"link_{k + 1}.{x}": float(v) for x, v in zip(KINDS, arm.inertial[k], strict=True)}
        out |= {f"{joint}.Ia": arm.rotor[k], f"{joint}.Fv": arm.viscous[k]}
        out |= {f"{joint}.Fc": arm.dry[k], f"{joint}.off": 0.0}
    return out


MUJOCO, SECOND = "MuJoCo, friction by Moreau's steps", "Newton–Euler, stick–slip, slow noise"

#: Every case, in the order of the table.
CASES = (
    CaseSource("kuka", "KUKA LWR4+: run 1 → 3", "LWR4+ logs, SOURCE.txt", _kuka,
               UNSTATED, data="kuka_lwr4"),
    CaseSource("kr300", "KUKA KR300: A, C → B", "KR300 logs, SOURCE.txt", _kr300,
               "MIT", data="kr300"),
    CaseSource("ur10", "UR10: first half → second", "UNISA logs, SOURCE.txt", _ur10,
               UNSTATED, data="unisa"),
    CaseSource("tx40", "Stäubli TX40: first third → second", "TX40 logs, SOURCE.txt", _tx40,
               UNSTATED, data="staubli_tx40"),
    CaseSource("so101", "SO-101: servos of a hobby arm", "SO-101 logs, SOURCE.txt", _so101,
               UNSTATED, "commands", "so101"),
    CaseSource("paper", "3-RPS: the paper's robot", "the stand-in of the paper's study", _paper),
    CaseSource("five_bar", "Five-bar: a second closed chain", MUJOCO,
               _mujoco("five-bar", 1, "", "")),
    CaseSource("stribeck", "Arm of four joints: hidden Stribeck friction", MUJOCO,
               _mujoco("scara", 2, "stribeck_friction", "elbow")),
    CaseSource("plain", "Arm of three joints: nothing is hidden", SECOND, _newton_euler(3)),
    CaseSource("static", "Arm of three joints: hidden static friction", SECOND,
               _newton_euler(4, stribeck=2)),
    CaseSource("exchanged", "Arm of three joints: exchanged columns", SECOND,
               _newton_euler(5, exchanged=True)),
    CaseSource("noisy", "Arm of three joints: noisy positions", SECOND,
               _newton_euler(6, noise=1e-3)),
    CaseSource("servos", "Arm of three joints: commands alone", SECOND,
               _newton_euler(7, commanded=True), kind="commands"),
)  # fmt: skip
