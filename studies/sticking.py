"""Robots whose dry friction sticks, driven forward under a controller: what is said of the model.

Friction is Coulomb's law on the velocities behind each step, v⁺ = v + h A(τ − c + f) with f within
± Fc, and opposite to v⁺ where that is not zero, by projected Gauss-Seidel [Moreau 1988; Stewart &
Trinkle 1996]: a joint that stops stands, and what its motor then supplies is anything within ± Fc.
MuJoCo's own `frictionloss` is a soft constraint, in which joints creep.

Nothing is hidden in these robots: a name is a false one.

    python studies/sticking.py [--logs 20] [--seed 1] [--robots six-axis scara five-bar]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
import pandas as pd

from identifiability import Log, Robot, analyze, diagnose
from identifiability.report.sections.answer import answer_notes, answer_questions
from identifiability.simulation.forward import ForwardRobot
from identifiability.simulation.motion import random_trajectory

#: Step of simulation, controller and log [s].
STEP = 1e-3
#: Bandwidth of the controller [Hz], and the time in which its integral acts [s].
BANDWIDTH, RESET = 3.0, 0.5
#: Steps between two looks at how forces accelerate, and sweeps of Gauss-Seidel.
LOOK, SWEEPS = 20, 30
#: Speed of the motion as a share of what the joints can do.
PACE = 0.4
#: Dry friction, and viscous friction at top speed, as shares of the torque's rms without friction.
DRY, VISCOUS = 0.4, 0.25

SCARA = """<mujoco model="scara"><compiler angle="radian"/><worldbody>
<body name="arm1" pos="0 0 .4">
<joint name="shoulder" axis="0 0 1" range="-2 2" armature=".3"/>
<inertial mass="6" pos=".16 .01 .03" diaginertia=".02 .09 .095"/>
<body name="arm2" pos=".32 0 0"><joint name="elbow" axis="0 0 1" range="-2 2" armature=".1"/>
<inertial mass="4.4" pos=".11 -.01 -.05" diaginertia=".017 .042 .04"/>
<body name="quill" pos=".22 0 0">
<joint name="lift" type="slide" axis="0 0 1" range="-.15 0" armature="3"/>
<inertial mass="1.2" pos="0 0 -.1" diaginertia=".006 .006 .0005"/>
<body name="flange"><joint name="spin" axis="0 0 1" range="-3 3" armature=".003"/>
<inertial mass=".9" pos=".03 .01 -.2" diaginertia=".002 .002 .002"/></body></body></body></body>
</worldbody><actuator><motor joint="shoulder"/><motor joint="elbow"/><motor joint="lift"/>
<motor joint="spin"/></actuator></mujoco>"""

_FOLDER = TemporaryDirectory()
#: Shipped names, or MJCF.
ROBOTS = {"six-axis": "six-dof-arm", "scara": SCARA, "five-bar": "five-bar"}


@dataclass(frozen=True)
class Sticking:
    """A robot with dry friction that sticks, and its controller.

    Attributes
    ----------
    robot : Robot
        As its file says.
    model : mujoco.MjModel
        Without friction.
    dry, viscous : (n,) [N·m or N; N·m·s/rad or N·s/m]
    """

    robot: Robot
    model: mujoco.MjModel
    dry: np.ndarray
    viscous: np.ndarray

    @staticmethod
    def of(robot: Robot, dry: float = DRY, viscous: float = VISCOUS) -> Sticking:
        """Return the robot with friction in proportion to the torque that its motion takes."""
        model = ForwardRobot(robot, {}).model
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
        model.opt.timestep = STEP
        model.eq_solref[:] = [2 * STEP, 1.0]
        for name in ("dof_frictionloss", "dof_damping"):
            getattr(model, name)[:] = 0.0
        n = len(robot.joints)
        bare = Sticking(robot, model, np.zeros(n), np.zeros(n))
        sample = bare.drive(bare.reference(np.random.default_rng(0), 6.0))
        tau = np.stack([sample[f"{j}.tau"] for j in robot.joints], 1)[1000:]
        v = np.stack([np.gradient(sample[f"{j}.q"], STEP) for j in robot.joints], 1)[1000:]
        size = np.sqrt((tau**2).mean(0))
        return replace(bare, dry=dry * size, viscous=viscous * size / np.abs(v).max(0))

    @property
    def _dofs(self) -> np.ndarray:
        return np.array([self.model.joint(j).dofadr[0] for j in self.robot.joints])

    def reference(
        self, rng: np.random.Generator, seconds: float, *, stops: bool = False
    ) -> np.ndarray:
        """Return positions (N, n) that a controller is asked for: a Fourier series.

        With stops the robot is asked to stand for a third of the time.
        """
        period = 10.0
        shape = random_trajectory(self.robot, rng, period=period, samples=round(period / STEP))
        slow = replace(shape, sin=PACE * shape.sin, cos=PACE * shape.cos)
        t = STEP * np.arange(round(seconds / STEP))
        if stops:
            t = STEP * np.cumsum(np.clip(0.5 + np.sin(2 * np.pi * t / 4.0), 0.0, 1.0))
        return slow.motion(t % period)[0]

    def drive(self, wanted: np.ndarray) -> pd.DataFrame:
        """Return what is logged of the motion along wanted positions (N, n), without errors."""
        model, dofs, n = self.model, self._dofs, len(self.dry)
        data = mujoco.MjData(model)
        at = np.array([model.joint(j).qposadr[0] for j in self.robot.joints])
        start = ForwardRobot(self.robot, {})._start(wanted[:1], np.zeros((1, n)))[0]
        data.qpos[:] = start.qpos
        mujoco.mj_forward(model, data)
        integral, q, tau = np.zeros(n), np.empty(wanted.shape), np.empty(wanted.shape)
        rate = np.gradient(wanted, STEP, axis=0)
        f = np.zeros(n)
        for k, goal in enumerate(wanted):
            if k % LOOK == 0:
                A = self._response(data, dofs)
                stiff = (2 * np.pi * BANDWIDTH) ** 2 / np.diag(A)
                damp = 2 * 0.8 * 2 * np.pi * BANDWIDTH / np.diag(A)
            v = data.qvel[dofs]
            error = goal - data.qpos[at]
            integral += STEP / RESET * error
            motor = stiff * (error + integral) + damp * (rate[k] - v)
            q[k], tau[k] = data.qpos[at], motor
            data.qfrc_applied[dofs] = motor - self.viscous * v
            mujoco.mj_forward(model, data)
            free = v + STEP * data.qacc[dofs]
            f = _stick(f, free, STEP * A, self.dry)
            data.qfrc_applied[dofs] += f
            mujoco.mj_step(model, data)
            data.qvel[dofs[np.abs(f) < self.dry]] = 0.0
        columns = {"t": STEP * np.arange(len(q))}
        for j, name in enumerate(self.robot.joints):
            columns |= {f"{name}.q": q[:, j], f"{name}.tau": tau[:, j]}
        return pd.DataFrame(columns)

    def _response(self, data: mujoco.MjData, dofs: np.ndarray) -> np.ndarray:
        """Return how forces at the actuated joints accelerate them, (n, n)."""
        applied = data.qfrc_applied.copy()
        mujoco.mj_forward(self.model, data)
        before, out = data.qacc[dofs].copy(), np.empty((len(dofs), len(dofs)))
        for k, dof in enumerate(dofs):
            data.qfrc_applied[dof] = applied[dof] + 1.0
            mujoco.mj_forward(self.model, data)
            out[:, k] = data.qacc[dofs] - before
            data.qfrc_applied[dof] = applied[dof]
        return out

    def log(
        self, rng: np.random.Generator, seconds: float = 20.0, *, name: str, stops: bool = False
    ) -> Log:
        """Return a log with encoder steps of 2π/2¹⁶ (5 µm) and 1 % of correlated torque noise."""
        frame = self.drive(self.reference(rng, seconds, stops=stops))
        for k, joint in enumerate(self.robot.joints):
            slides = self.robot.is_prismatic(int(self.robot.actuated[k]))
            step = 5e-6 if slides else 2 * np.pi / 2**16
            frame[f"{joint}.q"] = step * np.rint(frame[f"{joint}.q"] / step)
            size = 0.01 * float(np.std(frame[f"{joint}.tau"]))
            e = rng.standard_normal(len(frame) + 1000)
            slow = np.convolve(e, 0.9 ** np.arange(200))[: len(e)][1000:]
            frame[f"{joint}.tau"] += size * slow * np.sqrt(1 - 0.9**2)
        return Log.from_frame(frame, name)


def _stick(f: np.ndarray, free: np.ndarray, A: np.ndarray, dry: np.ndarray) -> np.ndarray:
    """Return friction (n,) within ± dry that leaves velocities zero where it can."""
    v = free + A @ f
    for _ in range(SWEEPS):
        before = f.copy()
        for i in range(len(f)):
            new = min(max(f[i] - v[i] / A[i, i], -dry[i]), dry[i])
            v = v + A[:, i] * (new - f[i])
            f[i] = new
        if np.all(np.abs(f - before) <= 1e-9 * dry):
            break
    return f


def load(name: str) -> Robot:
    """Return one of the `ROBOTS`."""
    text = ROBOTS[name]
    if not text.startswith("<"):
        return Robot.load(text)
    path = Path(_FOLDER.name) / f"{name}.xml"
    path.write_text(text)
    return Robot.load(path)


def judge(name: str, seed: int, *, seconds: float, stops: bool) -> dict[str, object]:
    """Return what analyze and diagnose say of one robot in which nothing is missing."""
    rng, robot = np.random.default_rng((seed, *map(ord, name))), load(name)
    sticking = Sticking.of(robot)
    fitted, held = (
        sticking.log(rng, seconds, name=which, stops=stops) for which in ("fitted", "held out")
    )
    begin = time.process_time()
    a = analyze(robot, [fitted], [held], quick=True, seed=seed)
    d = diagnose(robot, [fitted], [held], quick=True, seed=seed)
    moving = [float(s.survey.rows.sum() / s.survey.outputs / len(robot.joints)) for s in a.samples]
    return {
        "robot": name,
        "seed": seed,
        "dwells": round(1 - moving[0], 3),
        "error": round(float(a.held_out.relative_error()[a.selected]), 4),
        "diagnosis": round(float(d.gap.relative_error()[0]), 4),
        "names": "; ".join(f"{e.name}@{'+'.join(e.joints)}" for e in d.effects),
        "card": answer_questions(a, answer_notes(a)).answers[2].tone,
        "seconds": round(time.process_time() - begin, 1),
    }


def main() -> None:
    """Print a table of false names and of what the trust card says."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--logs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--robots", nargs="*", default=list(ROBOTS), choices=ROBOTS)
    asked = parser.parse_args()
    rows = []
    for name in asked.robots:
        for k in range(asked.logs):
            rows.append(judge(name, 1000 * asked.seed + k, seconds=asked.seconds, stops=k % 2 == 1))
            print(rows[-1], flush=True)
    table = pd.DataFrame(rows)
    table["named"], table["green"] = table["names"] != "", table["card"] == "green"
    print(table.groupby("robot")[["dwells", "error", "diagnosis", "named", "green"]].mean())
    print(f"named: {table['named'].sum()} of {len(table)}; green: {table['green'].sum()}")


if __name__ == "__main__":
    main()
