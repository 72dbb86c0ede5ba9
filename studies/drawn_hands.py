"""Hands that are drawn by seed: fingers whose last joints follow, driven at joints or by tendons.

MuJoCo simulates the machine from an MJCF of its own, in steps that are far shorter than those of
rollouts. Encoders count 12 bits a turn, at 50 Hz. Commands act late.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pandas as pd

from identifiability import Robot
from identifiability.foundation.names import INERTIAL_KINDS, Array

#: Rate of logs [Hz], step of the simulation [s], and counts of an encoder a turn.
RATE, STEP, COUNTS = 50.0, 1e-4, 2**12

#: Attributes of a servo's axis in an MJCF, by kind of parameter.
WORDS = {"Ia": "armature", "Fv": "damping", "Fc": "frictionloss"}

#: How the last joints of a hand follow, and what its servos pull.
KINDS = ("equality", "mimic", "tendon", "gears")


@dataclass(frozen=True)
class Servo:
    """A servo of a hand.

    Attributes
    ----------
    name : str
        Its joint or tendon.
    arms : mapping
        Coefficients of the joints along its tendon; empty at a joint.
    kp, kv : float [N·m/rad, N·m·s/rad]
    numbers : mapping
        True values of `WORDS`.
    """

    name: str
    arms: Mapping[str, float]
    kp: float
    kv: float
    numbers: Mapping[str, float]


@dataclass(frozen=True)
class Hand:
    """A drawn hand.

    Attributes
    ----------
    kind : str
        Of `KINDS`.
    fingers : list of list of str
        Joints of each finger from the palm on.
    masses, file_masses : mapping [kg]
        Of the link behind each joint: true ones, and those of the file.
    servos : list of Servo
    ratios : mapping
        Joints that follow to the joint before them, with the ratio.
    """

    kind: str
    fingers: list[list[str]]
    masses: dict[str, float]
    file_masses: dict[str, float]
    servos: list[Servo]
    ratios: dict[str, tuple[str, float]]

    @property
    def names(self) -> list[str]:
        """Names of the servos' joints and tendons."""
        return [servo.name for servo in self.servos]

    def write(self, folder: Path, *, fitted: bool = False) -> Robot:
        """Write the file of the hand without the numbers of its servos' axes, and read it.

        With `fitted` its gains are to be found from logs.
        """
        said = ""
        if self.kind == "mimic":
            path = folder / "hand.urdf"
            path.write_text(self._urdf())
            said = f"actuated = {self.names}\n"
        else:
            path = folder / "hand.xml"
            path.write_text(self.mjcf())
        if fitted:
            said += '[servo]\nkp = "fit"\n'
        elif self.kind == "mimic":
            kp = ", ".join(f"{s.name} = {s.kp}" for s in self.servos)
            kv = ", ".join(f"{s.name} = {s.kv}" for s in self.servos)
            said += f"[servo]\nkp = {{{kp}}}\nkv = {{{kv}}}\n"
        if said:
            path.with_suffix(".toml").write_text(said)
        return Robot.load(path)

    def truth(self, robot: Robot) -> dict[str, float]:
        """Return the true parameters; friction of joints that follow is in that of their servos."""
        out = {f"{s.name}.{kind}": x for s in self.servos for kind, x in s.numbers.items()}
        for joint, (of, ratio) in self.ratios.items():
            servo = next(s for s in self.servos if joint in s.arms or s.name == of)
            arms = servo.arms or {of: 1.0}
            speed = ratio / sum(c * (ratio if j == joint else 1.0) for j, c in arms.items())
            out[f"{servo.name}.Fv"] += speed**2 * FOLLOWS
            out[f"{servo.name}.Fc"] += speed * FOLLOWS
            out |= {f"{joint}.Fv": 0.0, f"{joint}.Fc": 0.0}
        for joint, mass in self.masses.items():
            share = mass / self.file_masses[joint]
            names = [f"{joint}_link.{kind}" for kind in INERTIAL_KINDS]
            out |= {name: share * robot.nominal[name] for name in names}
        return out

    def mjcf(self, *, true: bool = False) -> str:
        """Return the hand in MuJoCo's words, with true numbers or those of the file."""
        own = {s.name: s.numbers if true else {} for s in self.servos}
        masses = self.masses if true else self.file_masses

        def numbers(name: str) -> str:
            found = own.get(name, {}).items()
            return " ".join(f'{WORDS[kind]}="{x:.9g}"' for kind, x in found)

        bodies = ""
        for k, finger in enumerate(self.fingers):
            for i, joint in enumerate(finger):
                pos = f"{0.025 * k} 0 0" if i == 0 else f"0 0 {LENGTH}"
                axis = "1 0 0" if joint.endswith("abd") else "0 1 0"
                follows = joint in self.ratios
                friction = f'damping="{FOLLOWS}" frictionloss="{FOLLOWS}"'
                dynamics = numbers(joint) or friction * follows
                m = masses[joint]
                bodies += (
                    f'<body name="{joint}_link" pos="{pos}"><joint name="{joint}" axis="{axis}" '
                    f'{dynamics}/><inertial pos="0 0 {LENGTH / 2}" mass="{m:.9g}" diaginertia='
                    f'"{m * 3e-4:.9g} {m * 3e-4:.9g} {m * 1e-4:.9g}"/>'
                )
            bodies += "</body>" * len(finger)
        ties = "".join(
            f'<joint joint1="{a}" joint2="{b}" polycoef="0 {r:.9g} 0 0 0"/>'
            for a, (b, r) in self.ratios.items()
        )
        tendons = actuators = ""
        for s in self.servos:
            if s.arms:
                arms = "".join(f'<joint joint="{j}" coef="{c:.9g}"/>' for j, c in s.arms.items())
                tendons += f'<fixed name="{s.name}" {numbers(s.name)}>{arms}</fixed>'
            at = "tendon" if s.arms else "joint"
            actuators += f'<position name="{s.name}" {at}="{s.name}" kp="{s.kp}" kv="{s.kv}"/>'
        return (
            f'<mujoco model="hand"><compiler angle="radian"/><option gravity="-6 0 -7.8"/>'
            f"<worldbody>{bodies}</worldbody><equality>{ties}</equality>"
            f"<tendon>{tendons}</tendon><actuator>{actuators}</actuator></mujoco>"
        )

    def _urdf(self) -> str:
        """Return the hand as a URDF with ``<mimic>``; its palm is turned instead of gravity."""
        text = '<link name="world"/><link name="palm"/><joint name="wrist" type="fixed">'
        text += f'<parent link="world"/><child link="palm"/><origin rpy="0 {TURN} 0"/></joint>'
        for k, finger in enumerate(self.fingers):
            before = "palm"
            for i, joint in enumerate(finger):
                m = self.file_masses[joint]
                xyz = f"{0.025 * k} 0 0" if i == 0 else f"0 0 {LENGTH}"
                axis = "1 0 0" if joint.endswith("abd") else "0 1 0"
                of, ratio = self.ratios.get(joint, ("", 0.0))
                more = f'<mimic joint="{of}" multiplier="{ratio:.9g}"/>' if of else ""
                more += f'<dynamics damping="{FOLLOWS}" friction="{FOLLOWS}"/>' if of else ""
                text += (
                    f'<link name="{joint}_link"><inertial><origin xyz="0 0 {LENGTH / 2}"/>'
                    f'<mass value="{m:.9g}"/><inertia ixx="{m * 3e-4:.9g}" iyy="{m * 3e-4:.9g}" '
                    f'izz="{m * 1e-4:.9g}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
                    f'<joint name="{joint}" type="revolute"><parent link="{before}"/>'
                    f'<child link="{joint}_link"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>'
                    f'<limit lower="-2" upper="2" effort="20" velocity="20"/>{more}</joint>'
                )
                before = f"{joint}_link"
        return f'<robot name="hand">{text}</robot>'


#: Viscous [N·m·s/rad] and dry friction [N·m] of a joint that follows.
FOLLOWS = 0.001

#: Length of a link [m], and the turn that makes gravity that of the MJCF [rad].
LENGTH, TURN = 0.045, -float(np.arctan2(6.0, 7.8))


def draw_hand(kind: str, rng: np.random.Generator, fingers: int | None = None) -> Hand:
    """Return a hand of a kind: 12–19 joints and 8–12 servos, unless another number of fingers."""
    fingers = int(rng.integers(4, 6)) if fingers is None else fingers
    spread = rng.permutation(fingers)[: min(2, fingers - 1)]
    chains, servos, ratios = [], list[Servo](), {}
    for k in range(fingers):
        names = [f"f{k}_{part}" for part in ("mcp", "pip", "dip")]
        chains.append([f"f{k}_abd", *names] if k in spread else names)
        r = float(rng.uniform(0.6, 1.0))
        ratios[names[2]] = (names[1], round(r, 3))
        places = {name: {} for name in chains[-1][:-1]}
        if kind in ("tendon", "gears"):
            del places[names[1]]
            places[f"f{k}_flex"] = {names[1]: 1.0, names[2]: round(float(rng.uniform(0.5, 1)), 3)}
        if kind == "gears" and k in spread:
            abd = chains[-1][0]
            del places[abd], places[names[0]]
            arm = round(float(rng.uniform(0.5, 1.0)), 3)
            places |= {f"f{k}_left": {names[0]: 1.0, abd: arm}}
            places |= {f"f{k}_right": {names[0]: 1.0, abd: -arm}}
        servos += [_draw_servo(name, arms, rng) for name, arms in places.items()]
    masses = {j: float(rng.uniform(0.02, 0.05)) for chain in chains for j in chain}
    file_masses = {j: m * float(rng.uniform(0.9, 1.1)) for j, m in masses.items()}
    return Hand(kind, chains, masses, file_masses, servos, ratios)


def _draw_servo(name: str, arms: Mapping[str, float], rng: np.random.Generator) -> Servo:
    """Return a servo of a finger: of 20 to 50 rad/s, damped well."""
    rotor = float(rng.uniform(5e-4, 2e-3))
    kp = round(rotor * float(rng.uniform(25, 45)) ** 2, 3)
    kv = round(float(rng.uniform(0.4, 0.8)) * np.sqrt(rotor * kp), 4)
    friction = {"Fv": kv * rng.uniform(0.3, 0.8), "Fc": kp * rng.uniform(0.01, 0.03)}
    return Servo(name, arms, kp, kv, {"Ia": rotor, **friction})


def record(
    hand: Hand, seconds: float, delay: float, servo_rate: float, rng: np.random.Generator
) -> pd.DataFrame:
    """Return a log of the true hand: ``t``, and of each servo ``.q`` and ``.cmd``.

    Servos measure at their own rate [Hz], and hold their torque. Commands act late [s].
    """
    model = _stiff(mujoco.MjModel.from_xml_string(hand.mjcf(true=True)))
    arms = np.zeros((len(hand.servos), model.nv))
    for k, servo in enumerate(hand.servos):
        for joint, c in (servo.arms or {servo.name: 1.0}).items():
            arms[k, model.joint(joint).dofadr[0]] = c
    kp, kv = (np.array([getattr(servo, gain) for servo in hand.servos]) for gain in ("kp", "kv"))
    data, n = mujoco.MjData(model), len(hand.servos)
    t = np.arange(round(seconds * RATE)) / RATE
    commands = _draw_commands(t, n, rng)
    held, late = round(1 / servo_rate / STEP), int(np.ceil(delay * servo_rate))
    per_row = round(servo_rate / RATE)
    positions = []
    for k in range(round(seconds * servo_rate)):
        q = arms @ data.qpos
        if k % per_row == 0:
            positions.append(q)
        command = commands[max(k - late, 0) // per_row]
        data.ctrl[:] = kp * (command - q) - kv * (arms @ data.qvel)
        mujoco.mj_step(model, data, held)
    step, phase = 2 * np.pi / COUNTS, rng.uniform(size=n)
    q = (np.floor(np.array(positions) / step + phase) + 0.5 - phase) * step
    names = [f"{name}.{kind}" for kind in ("q", "cmd") for name in hand.names]
    return pd.DataFrame(np.column_stack([t, q, commands]), columns=["t", *names])


def _stiff(model: Any) -> Any:
    """Return a model with short steps, hard friction, rigid couplings, and torque as commands."""
    model.opt.timestep = STEP
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.eq_solref[:] = model.dof_solref[:] = model.tendon_solref_fri[:] = [2 * STEP, 1]
    for hardness in (model.dof_solimp, model.eq_solimp, model.tendon_solimp_fri):
        hardness[:, :2] = 0.9999
    model.actuator_gainprm[:, 0] = 1.0
    model.actuator_biasprm[:] = 0.0
    return model


def _draw_commands(t: Array, n: int, rng: np.random.Generator) -> Array:
    """Return sums of four sines for each servo, (N, n), that begin at rest."""
    frequency, phase = rng.uniform(0.2, 2.5, (2, 4, n))
    waves = np.sin(2 * np.pi * (frequency * t[:, None, None] + phase)).sum(1)
    begin = np.minimum(t / 0.5, 1.0)[:, None]
    return 0.22 * begin * waves
