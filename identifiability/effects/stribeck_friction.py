"""Friction that falls as motion begins."""

import numpy as np

from identifiability.effects.effect import Along, Shaped
from identifiability.effects.family import SPEEDS, Span
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot

#: Stribeck velocity where none is given, as a share of the joint's speed limit.
TYPICAL_SHARE = 0.1
#: Speed of joints without a limit [rad/s, m/s].
TYPICAL_SPEED = (2.0, 0.3)

#: Stribeck velocities that are tried, as shares of the joint's rms speed: neighbours are so close
#: that what falls between them leaves less than 1 % of the curve.
STRIBECK_SHARES = tuple(float(x) for x in np.geomspace(0.04, 1.6, 16))


def stribeck_velocities(span: Span) -> tuple[float, ...]:
    """Return the velocities that are tried [rad/s or m/s]."""
    return tuple(s * span.rms_speed for s in STRIBECK_SHARES)


@declare(
    "Stribeck friction",
    shapes=stribeck_velocities,
    needs="coulomb_friction",
    dry=True,
    continuous=True,
    told_by=SPEEDS,
    rank=6,
)
class StribeckFriction(Shaped):
    """``τ = (Fs − Fc) exp(−|q̇/vs|) sign(q̇)``: the excess of static over Coulomb friction.

    Its shape is the Stribeck velocity vs [rad/s or m/s], by default a tenth of the speed limit.
    The level cannot be negative. Over a narrow range of speeds it looks like Coulomb with quadratic
    friction.
    """

    name = "stribeck_friction"
    equation = "τ = (Fs − Fc) exp(−|q̇/vs|) sign(q̇)"
    source = "[Olsson 1998, Eq. 4]; [Díaz 2010, Eq. 20] prints it without minus sign"
    units = (("Fs", "N·m", "N"),)
    nonnegative = True

    def curves(self, at: Along) -> list[Array]:
        """Return the falling curve."""
        share = np.abs(at.speed / self.shape(at.robot, at.axis))
        return [np.exp(-share) * at.sign]

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return a share of the speed limit of an axis, or of a typical one [rad/s or m/s]."""
        limits = robot.speed_limits[[] if axis.row is None else np.flatnonzero(axis.row)]
        known = limits[np.isfinite(limits)]
        return TYPICAL_SHARE * (float(known.max()) if len(known) else TYPICAL_SPEED[axis.prismatic])
