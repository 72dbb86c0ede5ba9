"""Rollout fits of commanded robots beside `mujoco.sysid`: the same logs, numbers and known delay.

Both find armature, damping, dry friction and offset of every joint, with the file's bodies, which
are the true ones here; errors are those of a log that neither saw, over those of the true numbers.
What `mujoco.sysid` states as intervals assumes white noise; beside them stand the verdicts of
`analyze`, with bodies within 20 % of the file's.

    pip install "mujoco[sysid]" && python studies/servo_sysid.py --seeds 2
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import servo_robots as servos
from mujoco import rollout, sysid

from identifiability import Log, Robot, analyze
from identifiability.estimation.rollouts import KINDS, fit_rollouts
from identifiability.foundation.names import Array
from identifiability.logs.commands import acting
from identifiability.logs.conventions import Conventions
from identifiability.simulation.forward import HARD
from identifiability.simulation.rollout import CommandedRobot, forgotten, starting_speeds

#: Step of the peer's simulator [s]: that at which the servos measure.
STEP = 1e-3


class Peer:
    """`mujoco.sysid` on a robot's joints, as its manual does it."""

    def __init__(self, robot: Robot, folder: Path) -> None:
        self.robot = robot
        text = robot.save(folder / "peer.xml").read_text()
        self.spec = mujoco.MjSpec.from_string(text)
        self.spec.option.timestep = STEP
        self.spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        self.spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        for joint in robot.joints:
            self.spec.joint(joint).solref_friction[:] = [2 * STEP, 1.0]  # MuJoCo's own is soft
            self.spec.joint(joint).solimp_friction[:2] = HARD
            self.spec.add_sensor(
                name=joint,
                type=mujoco.mjtSensor.mjSENS_JOINTPOS,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                objname=joint,
            )
        self.model = self.spec.compile()
        self.actuators = [a.name for a in self.spec.actuators]
        start = CommandedRobot(robot, {}).numbers()
        ends = {"Ia": 0.2, "Fv": 5.0, "Fc": 3.0, "off": 10.0}
        self.params = sysid.ParameterDict()
        for kind in KINDS:
            for k, joint in enumerate(robot.joints):
                low = -ends[kind] if kind == "off" else 0.0
                at = float(np.clip(start[kind][k], low + 1e-3, ends[kind]))
                self.params.add(
                    sysid.Parameter(
                        f"{joint}.{kind}", at, low, ends[kind], modifier=self._modifier(kind, k)
                    )
                )

    def _modifier(self, kind: str, k: int):
        def modify(spec: mujoco.MjSpec, parameter: sysid.Parameter) -> None:
            value = float(parameter.value[0])
            joint = spec.joint(self.robot.joints[k])
            if kind == "Ia":
                joint.armature = value
            elif kind == "Fv":
                joint.damping[0] = value
            elif kind == "Fc":
                joint.frictionloss = value
            else:
                spec.actuator(self.actuators[k]).biasprm[0] = -value

        return modify

    def sequences(self, log: Log, delay: float) -> sysid.ModelSequences:
        """Return a log as the peer takes it: held commands, late by what is known."""
        assert self.robot.servo is not None
        t = np.arange(log.t[0], log.t[-1], STEP)
        model = self.model
        q, v = model.qpos0.copy(), np.zeros(model.nv)
        joints = [model.joint(j) for j in self.robot.joints]
        q[[j.qposadr[0] for j in joints]] = log.q[0]
        v[[j.dofadr[0] for j in joints]] = starting_speeds(log)[0]
        target = acting(log, self.robot.servo, t, STEP, delay)
        control = sysid.TimeSeries.from_control_names(t - t[0], target, model)
        inside = log.t < t[-1]
        seen = sysid.TimeSeries.from_names(log.t[inside] - t[0], log.q[inside], model)
        first = sysid.create_initial_state(model, q, v)
        return sysid.ModelSequences("robot", self.spec, log.name, first, control, seen)

    def roll(self, log: Log, delay: float, fitted: sysid.ParameterDict) -> Array:
        """Return positions of the fitted robot along a log, (N, n), at the peer's own step."""
        model = sysid.apply_param_modifiers(fitted, self.spec)
        given = self.sequences(log, delay).measured_rollout[0]
        states, _ = rollout.rollout(
            [model],
            [mujoco.MjData(model)],
            np.atleast_2d(given.initial_state),
            given.control.data[None],
        )
        at = [1 + model.joint(j).qposadr[0] for j in self.robot.joints]
        path = np.concatenate([log.q[:1], states[0][:, at]])
        times = STEP * np.arange(len(path))
        return np.stack([np.interp(log.t - log.t[0], times, x) for x in path.T], axis=1)

    def residual(self, log: Log, delay: float):
        """Return the peer's residual function."""
        return sysid.build_residual_fn(
            models_sequences=[self.sequences(log, delay)], n_threads=1, resample_true=True
        )


def error(apart: Array, log: Log) -> float:
    """Return the rms of errors of positions without the beginning."""
    return float(np.sqrt(np.mean(apart[forgotten(log) :] ** 2)))


def compare(name: str, seed: int, folder: Path) -> dict[str, float | str]:
    """Return errors and processor times of both on one drawn robot."""
    robot, (draw, rate, size) = servos.load(name, folder), servos.JUDGED[name]
    rng = np.random.default_rng(seed)
    truth = draw(robot, 0.0, rng)
    how = servos.Recorder(200.0, rate, 0.005, 12)
    frames = []
    for seconds in (8.0, 6.0):
        commands = servos.draw_commands(robot, seconds, rate, size, rng)
        frames.append(servos.record(robot, truth, commands, seconds, how, rng))
    log, sealed = (
        Log.from_frame(f, conventions=Conventions.of(robot)).select(robot.joints) for f in frames
    )
    delays = [how.delay - x.t[0] % (1 / how.rate) for x in (log, sealed)]
    least = error(CommandedRobot(robot, truth).roll(sealed, delay=delays[1])[0] - sealed.q, sealed)
    began = time.process_time()
    found = fit_rollouts(robot, [log], delay=delays[0])
    own = time.process_time() - began
    machine = CommandedRobot(robot, found.parameters(robot))
    ours = error(machine.roll(sealed, delay=delays[1])[0] - sealed.q, sealed)
    began = time.process_time()
    one = analyze(
        replace(robot, servo=replace(robot.servo, delay=delays[0])), frames[0], quick=True
    )
    whole = time.process_time() - began
    peer = Peer(robot, folder)
    began = time.process_time()
    fitted, _ = sysid.optimize(
        peer.params, peer.residual(log, delays[0]), optimizer="mujoco", verbose=False
    )
    other = time.process_time() - began
    # Its states are up to a step off its times: the best of few shifts counts.
    shifts = STEP * np.linspace(-2, 2, 9)
    theirs = min(error(peer.roll(sealed, delays[1] + d, fitted) - sealed.q, sealed) for d in shifts)
    table = one.to_frame().set_index("name")["verdict"]
    names = [f"{j}.{k}" for k in KINDS for j in robot.joints]
    open_ = [n for n in names if table.get(n) != "identifiable"]
    values = dict(zip(names, fitted.as_vector(), strict=True))
    off = [abs(values[n] / truth[n] - 1) for n in names if n.endswith((".Ia", ".Fv", ".Fc"))]
    return {
        "robot": name,
        "ours": ours / least,
        "peer": theirs / least,
        "ours / peer": ours / theirs,
        "cpu ours [s]": own,
        "cpu analyze [s]": whole,
        "cpu peer [s]": other,
        "peer's numbers off, median": float(np.median(off)),
        "of its numbers not determined": f"{len(open_)} of {len(names)}",
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    # The quadruped floats by its file, and the peer has no stand to bolt it to.
    parser.add_argument("--robot", nargs="+", default=["two-link", "hobby-arm"])
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = [
            compare(name, seed, Path(folder)) for name in given.robot for seed in range(given.seeds)
        ]
    print(pd.DataFrame(rows).round(3).T.to_string())


if __name__ == "__main__":
    main()
