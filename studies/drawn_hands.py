"""Hands that are drawn by seed: fingers whose last joints follow, driven at joints or by tendons.

MuJoCo simulates the machine from an MJCF of its own, in steps that are far shorter than those of
rollouts. Encoders count 12 bits a turn, at 50 Hz. Commands act late.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd

from identifiability import Robot
from identifiability.foundation.names import Array

#: Rate of logs [Hz], steps of the simulation a row, and counts of an encoder a turn.
RATE, STEPS, COUNTS = 50.0, 100, 2**12

#: Attributes of a servo's axis in an MJCF, by kind of parameter.
WORDS = {"Ia": "armature", "Fv": "damping", "Fc": "frictionloss"}

#: How the last joints of a hand are moved.
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
    bodies : list of str
        Fingers, as an MJCF or URDF writes them.
    servos : list of Servo
    ratios : mapping
        Joints that follow to the joint before them, with the ratio.
    """

    kind: str
    fingers: list[list[str]]
    masses: dict[str, float]
    servos: list[Servo]
    ratios: dict[str, tuple[str, float]]

    @property
    def names(self) -> list[str]:
        """Names of the servos' joints and tendons."""
        return [servo.name for servo in self.servos]

    @property
    def truth(self) -> dict[str, float]:
        """Numbers of the servos' axes by name of the parameter."""
        return {f"{s.name}.{kind}": x for s in self.servos for kind, x in s.numbers.items()}

    @property
    def effective(self) -> dict[str, float]:
        """The same, with the friction of each joint that follows in that of its servo."""
        out = self.truth
        for servo in self.servos:
            for joint, (of, ratio) in self.ratios.items():
                if joint in servo.arms or of == servo.name:
                    arms = servo.arms or {of: 1.0}
                    speed = sum(c * (ratio if j == joint else 1.0) for j, c in arms.items())
                    r = ratio / speed
                    out[f"{servo.name}.Fv"] += r**2 * FOLLOWS
                    out[f"{servo.name}.Fc"] += r * FOLLOWS
        return out

    def write(self, folder: Path, gains: str = "") -> Robot:
        """Write the file of the hand without the numbers of its servos' axes, and read it."""
        if self.kind != "mimic":
            path = folder / "hand.xml"
            path.write_text(self.mjcf({}))
        else:
            path = folder / "hand.urdf"
            path.write_text(self._urdf())
            listed = [
                f"{key} = {{{', '.join(f'{s.name} = {getattr(s, key)}' for s in self.servos)}}}"
                for key in ("kp", "kv")
            ]
            names = ", ".join(f'"{name}"' for name in self.names)
            gains = f"actuated = [{names}]\n" + (gains or "\n".join(["[servo]", *listed]))
        if gains:
            path.with_suffix(".toml").write_text(gains)
        return Robot.load(path)

    def mjcf(self, truth: Mapping[str, float]) -> str:
        """Return the hand in MuJoCo's words, with the numbers of its servos' axes."""

        def numbers(name: str) -> str:
            pairs = ((word, truth.get(f"{name}.{kind}")) for kind, word in WORDS.items())
            return " ".join(f'{word}="{x:.6g}"' for word, x in pairs if x is not None)

        bodies = ""
        for k, finger in enumerate(self.fingers):
            for i, joint in enumerate(finger):
                pos = f"{0.025 * k} 0 0" if i == 0 else f"0 0 {LENGTH}"
                axis = "1 0 0" if joint.endswith("abd") else "0 1 0"
                follows = joint in self.ratios
                friction = f'damping="{FOLLOWS}" frictionloss="{FOLLOWS}"'
                dynamics = numbers(joint) or friction * follows
                m = self.masses[joint]
                bodies += (
                    f'<body name="{joint}_link" pos="{pos}"><joint name="{joint}" axis="{axis}" '
                    f'{dynamics}/><inertial pos="0 0 {LENGTH / 2}" mass="{m:.5g}" diaginertia='
                    f'"{m * 3e-4:.5g} {m * 3e-4:.5g} {m * 1e-4:.5g}"/>'
                )
            bodies += "</body>" * len(finger)
        ties = "".join(
            f'<joint joint1="{a}" joint2="{b}" polycoef="0 {r:.4g} 0 0 0"/>'
            for a, (b, r) in self.ratios.items()
        )
        tendons = actuators = ""
        for s in self.servos:
            if s.arms:
                arms = "".join(f'<joint joint="{j}" coef="{c:.4g}"/>' for j, c in s.arms.items())
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
                m = self.masses[joint]
                xyz = f"{0.025 * k} 0 0" if i == 0 else f"0 0 {LENGTH}"
                axis = "1 0 0" if joint.endswith("abd") else "0 1 0"
                of, ratio = self.ratios.get(joint, ("", 0.0))
                more = f'<mimic joint="{of}" multiplier="{ratio:.4g}"/>' if of else ""
                more += f'<dynamics damping="{FOLLOWS}" friction="{FOLLOWS}"/>' if of else ""
                text += (
                    f'<link name="{joint}_link"><inertial><origin xyz="0 0 {LENGTH / 2}"/>'
                    f'<mass value="{m:.5g}"/><inertia ixx="{m * 3e-4:.5g}" iyy="{m * 3e-4:.5g}" '
                    f'izz="{m * 1e-4:.5g}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
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
    return Hand(kind, chains, masses, servos, ratios)


def _draw_servo(name: str, arms: Mapping[str, float], rng: np.random.Generator) -> Servo:
    """Return a servo of a finger: of 20 to 50 rad/s, damped well."""
    rotor = float(rng.uniform(5e-4, 2e-3))
    kp = round(rotor * float(rng.uniform(25, 45)) ** 2, 3)
    kv = round(float(rng.uniform(0.4, 0.8)) * np.sqrt(rotor * kp), 4)
    friction = {"Fv": kv * rng.uniform(0.3, 0.8), "Fc": kp * rng.uniform(0.01, 0.03)}
    return Servo(name, arms, kp, kv, {"Ia": rotor, **friction})


def record(hand: Hand, seconds: float, delay: float, rng: np.random.Generator) -> pd.DataFrame:
    """Return a log of the true hand: ``t``, and of each servo ``.q`` and ``.cmd``."""
    model = mujoco.MjModel.from_xml_string(hand.mjcf(hand.truth))
    model.opt.timestep = 1 / RATE / STEPS
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    stiff = [2 * model.opt.timestep, 1]
    model.eq_solref[:] = model.dof_solref[:] = model.tendon_solref_fri[:] = stiff
    for hardness in (model.dof_solimp, model.eq_solimp, model.tendon_solimp_fri):
        hardness[:, :2] = 0.9999
    arms = np.zeros((len(hand.servos), model.nq))
    for k, servo in enumerate(hand.servos):
        for joint, c in (servo.arms or {servo.name: 1.0}).items():
            arms[k, model.joint(joint).qposadr[0]] = c
    data, n = mujoco.MjData(model), len(hand.servos)
    t = np.arange(round(seconds * RATE)) / RATE
    commands = _draw_commands(t, n, rng)
    late = round(delay * RATE * STEPS)
    positions, before = [], commands[0]
    for command in commands:
        positions.append(arms @ data.qpos)
        data.ctrl[:] = before
        mujoco.mj_step(model, data, late)
        data.ctrl[:] = before = command
        mujoco.mj_step(model, data, STEPS - late)
    step, phase = 2 * np.pi / COUNTS, rng.uniform(size=n)
    q = (np.floor(np.array(positions) / step + phase) + 0.5 - phase) * step
    names = [f"{name}.{kind}" for kind in ("q", "cmd") for name in hand.names]
    return pd.DataFrame(np.column_stack([t, q, commands]), columns=["t", *names])


def _draw_commands(t: Array, n: int, rng: np.random.Generator) -> Array:
    """Return sums of four sines for each servo, (N, n), that begin at rest."""
    frequency, phase = rng.uniform(0.2, 2.5, (2, 4, n))
    waves = np.sin(2 * np.pi * (frequency * t[:, None, None] + phase)).sum(1)
    begin = np.minimum(t / 0.5, 1.0)[:, None]
    return 0.22 * begin * waves
