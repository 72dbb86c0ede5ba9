"""What a motion asks of the drives: torque and power by the nominal model of the robot file."""

from __future__ import annotations

import numpy as np

from identifiability.effects import default_effects
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.model import Model
from identifiability.regression.reduction import USUAL_EFFECTS
from identifiability.regression.structure import Structure
from identifiability.robot import Motion, Robot
from identifiability.workflows.excite.limits import Limits


@frozen
class Drive:
    """The nominal model, and what its drives can do.

    Attributes
    ----------
    structure : Structure
        The robot under its nominal model; what the robot file does not state is zero.
    torque, power : (n,) [N·m or N; W]
        Largest of each drive; infinite where nobody stated it.
    """

    structure: Structure
    torque: Array
    power: Array

    @staticmethod
    def of(robot: Robot, limits: Limits) -> Drive | None:
        """Return the drives of a robot; None where nobody stated what they can do."""
        if not (np.isfinite(limits.torque).any() or np.isfinite(limits.power).any()):
            return None
        structure = Structure.of(robot, Model.of(*default_effects(robot, USUAL_EFFECTS)))
        return Drive(structure, limits.torque, limits.power)

    def torques(self, motion: Motion) -> Array:
        """Return the torque that a motion takes, (N, n) [N·m or N]."""
        of = self.structure
        out: Array = of.model.regressor(of.robot, motion) @ of.nominal
        return out

    def load(self, motion: Motion) -> Array:
        """Return the largest share of a limit that each sample asks for, (N,)."""
        torque = np.abs(self.torques(motion))
        power = np.abs(torque * motion.actuated_v)
        share: Array = np.maximum(torque / self.torque, power / self.power).max(1)
        return share
