"""`PrescribedMotion`: what the simulated robot is made to do."""

from __future__ import annotations

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.simulation.trajectory import Trajectory


@frozen
class PrescribedMotion:
    """Motion of the actuated joints that the simulated robot follows exactly.

    Attributes
    ----------
    t : (N,) [s]
    q, dq, ddq : (N, n)
    name : str
    """

    t: Array
    q: Array
    dq: Array
    ddq: Array
    name: str = "motion"

    @staticmethod
    def of(trajectory: Trajectory, samples: int | None = None) -> PrescribedMotion:
        """Return one period of a trajectory."""
        t = trajectory.times(samples)
        return PrescribedMotion(t, *trajectory.motion(t), name=trajectory.name)
