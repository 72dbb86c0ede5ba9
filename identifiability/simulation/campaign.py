"""`Campaign`: several motions of one simulated robot, of which many noisy logs can be made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.robot import Robot
from identifiability.simulation import forces
from identifiability.simulation.hidden import hidden_torque
from identifiability.simulation.mujoco_robot import MujocoRobot, RigidTorque
from identifiability.simulation.noise import Noise
from identifiability.simulation.prescribed import PrescribedMotion
from identifiability.simulation.simulator import joint_torque
from identifiability.simulation.trajectory import Trajectory

#: Pause between two motions [s]: no effect reaches from one to the next.
PAUSE = 10.0


@frozen
class Campaign:
    """Motions that share one robot; a hidden effect has one size in all of them.

    Attributes
    ----------
    robot : Robot
    move : PrescribedMotion
        All motions one after the other.
    rigid : RigidTorque
    torque : (N, n)
        Without hidden effects and noise.
    log : (N,) int
        Which motion a sample belongs to.
    """

    robot: Robot
    move: PrescribedMotion
    rigid: RigidTorque
    torque: Array
    log: np.ndarray

    @staticmethod
    def of(
        robot: Robot,
        motions: Sequence[PrescribedMotion | Trajectory],
        parameters: Mapping[str, float] | None = None,
    ) -> Campaign:
        """Compute the torque along some motions once."""
        moves = [m if isinstance(m, PrescribedMotion) else PrescribedMotion.of(m) for m in motions]
        start, times = 0.0, []
        for m in moves:
            times.append(m.t - m.t[0] + start)
            start = times[-1][-1] + PAUSE
        q, dq, ddq = (np.concatenate([getattr(m, k) for m in moves]) for k in ("q", "dq", "ddq"))
        whole = PrescribedMotion(np.concatenate(times), q, dq, ddq)
        rigid = MujocoRobot(robot).inverse_dynamics(whole.q, whole.dq, whole.ddq)
        values = {**robot.nominal, **(parameters or {})}
        tau = rigid.tau + joint_torque(robot, whole, rigid, values)
        index = np.repeat(np.arange(len(moves)), [len(m.t) for m in moves])
        return Campaign(robot, whole, rigid, tau, index)

    def hidden(self, hide: Sequence[str], laws: Mapping[str, forces.Law] | None = None) -> Array:
        """Return the torque of hidden effects as in `simulate`, (N, n)."""
        out = np.zeros_like(self.torque)
        for text in hide:
            found = forces.parse_hidden(text, laws)
            out += hidden_torque(self.robot, self.move, self.rigid, self.torque, found)
        return out

    def logs(
        self,
        hide: Sequence[str] | Array = (),
        noise: Noise | None = None,
        rng: np.random.Generator | None = None,
        *,
        derivatives: bool = False,
    ) -> list[Log]:
        """Return one noisy log a motion.

        Parameters
        ----------
        hide : sequence of str, or (N, n)
            Hidden effects as in `simulate`, or their torque.
        noise : Noise, optional
        rng : numpy.random.Generator
        derivatives : bool
            Whether logs have velocities and accelerations.
        """
        rng = rng or np.random.default_rng(0)
        noise = noise or Noise()
        added = hide if isinstance(hide, np.ndarray) else self.hidden(hide)
        clean = self.torque + added
        out = []
        level = np.sqrt(np.mean(self.torque**2, axis=0))
        for k in range(int(self.log.max()) + 1):
            rows = self.log == k
            tau = noise.on_torque(clean[rows], rng, level)
            q = noise.on_encoder(noise.on_motion(self.move.q[rows], rng))
            dq, ddq = (noise.on_motion(x[rows], rng) for x in (self.move.dq, self.move.ddq))
            t = self.move.t[rows] - self.move.t[rows][0]
            log = Log(
                f"motion {k + 1}", self.robot.joints, t, q, tau, dq if derivatives else None,
                ddq if derivatives else None, "",
            )  # fmt: skip
            out.append(Log.from_frame(log.to_frame(), log.name))
        return out
