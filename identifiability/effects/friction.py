"""Friction of joints over speed, from levels and slopes to the curves about standstill.

Coulomb friction with one level or one for each direction, viscous and quadratic friction;
Stribeck, rising and sigmoid friction, whose shapes are continuous; friction of passive joints, and
friction that drifts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.errors import ModelError
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array, NumberByName, Strings
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.robot import Axis, Robot

from .effect import EXPONENT, RESTS, SPEEDS, Along, AlongAxes, Family, Shaped, Span, actuated_joints
from .registry import declare

# Viscous friction at every actuated joint and coupled motor.


@declare("viscous friction", native=True, told_by=SPEEDS)
class ViscousFriction(AlongAxes):
    """``τ = Fv q̇``."""

    name = "viscous_friction"
    equation = "τ = Fv q̇"
    source = "[Díaz 2010, Eq. 10]"
    of_drive = True
    units = (("Fv", "N·m·s/rad", "N·s/m"),)
    nonnegative = True
    stated_as = ("damping",)

    def curves(self, at: Along) -> list[Array]:
        """Return the speed."""
        return [at.speed]


# Coulomb friction with the same level for both directions.


@declare("Coulomb friction", native=True)
class CoulombFriction(AlongAxes):
    """``τ = Fc sign(q̇)`` at every actuated joint and coupled motor."""

    name = "coulomb_friction"
    equation = "τ = Fc sign(q̇)"
    source = "[Díaz 2010, Eq. 10], with the condition on the velocity (printed on the position)"
    of_drive = True
    units = (("Fc", "N·m", "N"),)
    nonnegative = True
    stated_as = ("frictionloss",)

    def curves(self, at: Along) -> list[Array]:
        """Return the direction of motion."""
        return [at.sign]


# Coulomb friction with a level for each direction.


@declare(
    "asymmetric Coulomb friction",
    actuated_joints,
    needs="coulomb_friction",
    native=True,
    told_by=RESTS,
)
class CoulombAsymmetry(AlongAxes):
    """``τ = Fc⁺`` for q̇ > 0 and ``−Fc⁻`` for q̇ < 0; both are positive numbers.

    A motor that mixes joints has one level: the difference between its directions is a constant
    torque on its joints, which their levels contain already. A robot file has their mean.
    """

    name = "coulomb_asymmetry"
    equation = "τ = Fc⁺ for q̇ > 0, −Fc⁻ for q̇ < 0"
    source = "[Díaz 2010, Eq. 10], with the condition on the velocity (printed on the position)"
    supersedes = ("coulomb_friction",)
    of_drive = True
    units = (("Fc", "N·m", "N"), ("Fc+", "N·m", "N"), ("Fc-", "N·m", "N"))
    nonnegative = True

    def kinds(self, robot: Robot, axis: Axis) -> Strings:
        """Return both levels of a joint, one of a motor that mixes joints."""
        del robot
        return ("Fc",) if axis.mixed else ("Fc+", "Fc-")

    def curves(self, at: Along) -> list[Array]:
        """Return the parts of either direction."""
        sign = at.sign
        if at.axis.mixed:
            return [sign]
        moves = np.abs(np.sign(sign))
        return [0.5 * (sign + moves), 0.5 * (sign - moves)]


def complete_coulomb_levels(values: dict[str, float], given: NumberByName) -> None:
    """Make the Coulomb levels of some values consistent: one for both directions, and one for each.

    The given values decide: a level for both, else those of each direction.
    """
    owners = {name.rpartition(".")[0] for name in values if name.endswith(".Fc")}
    owners |= {name.rpartition(".")[0] for name in given if name.endswith((".Fc+", ".Fc-"))}
    for owner in owners:
        both, *ways = (f"{owner}.{kind}" for kind in ("Fc", "Fc+", "Fc-"))
        level = values.get(both, 0.0)
        alone = both in given and not any(way in given for way in ways)
        for way in ways:
            values[way] = level if alone else values.get(way, level)
        values[both] = 0.5 * sum(values[way] for way in ways)
        if all(abs(values[way] - values[both]) <= ROUNDOFF * abs(values[both]) for way in ways):
            values |= dict.fromkeys(ways, values[both])


# Drag that grows with the square of speed.


@declare("quadratic friction", needs="viscous_friction", told_by=SPEEDS)
class QuadraticFriction(AlongAxes):
    """``τ = Fq |q̇| q̇``: fans, oil, air.

    Over a narrow range of speeds it looks like viscous friction, or like a wide Stribeck curve.
    """

    name = "quadratic_friction"
    equation = "τ = Fq |q̇| q̇"
    source = "[Armstrong-Hélouvry 1994, Sec. 2]"
    of_drive = True
    units = (("Fq", "N·m·s²/rad²", "N·s²/m²"),)
    nonnegative = True

    def curves(self, at: Along) -> list[Array]:
        """Return the square of speed against the motion."""
        return [np.abs(at.speed) * at.speed]


# Friction that falls as motion begins.


#: Stribeck velocities that are tried, as shares of the joint's rms speed: neighbours are so close
#: that a value between them changes less than 1 % of the curve.
STRIBECK_SHARES = tuple(float(x) for x in np.geomspace(0.04, 1.6, 16))


#: Exponents that are tried, four in an octave: 1 is Tustin's curve, 2 a Gaussian.
EXPONENTS = tuple(round(2.0 ** (0.25 * k), 2) for k in range(-2, 9))


def stribeck_velocities(span: Span) -> tuple[float, ...]:
    """Return the velocities that are tried [rad/s or m/s]."""
    return tuple(s * span.rms_speed for s in STRIBECK_SHARES)


@declare(
    "Stribeck friction",
    shapes=stribeck_velocities,
    needs="coulomb_friction",
    continuous=True,
    told_by=SPEEDS,
)
@frozen
class StribeckFriction(Shaped):
    """``τ = Fs exp(−|q̇/vs|^δ) sign(q̇)``: Fs is the excess of static over Coulomb friction.

    Its shape is the Stribeck velocity vs [rad/s or m/s], by default a tenth of the speed limit, and
    the exponent δ, by default 1. A diagnosis chooses both. A model states them as
    ``stribeck_friction@joint:vs,δ``, a sidecar as ``joint.stribeck_friction`` and
    ``joint.stribeck_friction_exponent`` among its shapes. The level cannot be negative. Over a
    narrow range of speeds it looks like Coulomb with quadratic friction.

    Attributes
    ----------
    exponent : float or None
        δ; None takes the robot's, else 1.
    """

    name = "stribeck_friction"
    equation = "τ = Fs exp(−|q̇/vs|^δ) sign(q̇)"
    source = "[Olsson 1998, Eq. 4]; [Díaz 2010, Eq. 20] prints it without minus sign"
    of_drive = True
    units = (("Fs", "N·m", "N"),)
    symbol = "vs"
    nonnegative = True
    limits = ("coulomb_friction", "coulomb_friction")
    exponents = EXPONENTS

    exponent: float | None = None

    def about(self, shape: Sequence[float]) -> StribeckFriction:
        """Return the effect with a Stribeck velocity and an exponent."""
        given, exponent = shape
        if min(shape) <= 0:
            raise ModelError(
                f"{self.name}: speed and exponent {given:g},{exponent:g}; give numbers above zero."
            )
        return replace(self, given=given, exponent=exponent)

    def curves(self, at: Along) -> list[Array]:
        """Return the falling curve."""
        share = np.abs(at.speed / self.shape(at.robot, at.axis))
        return [np.exp(-(share ** self.power(at.robot, at.axis))) * at.sign]

    def power(self, robot: Robot, axis: Axis) -> float:
        """Return the exponent at an axis."""
        return self.exponent or robot.shapes.get(f"{axis.name}.{self.name}{EXPONENT}") or 1.0

    def shapes(self, robot: Robot) -> dict[str, float]:
        """Return the Stribeck velocity of every axis, and its exponent unless that is 1 anyway."""
        powers = {f"{a.name}.{self.name}{EXPONENT}": self.power(robot, a) for a in self.axes(robot)}
        stated = {name: x for name, x in powers.items() if x != 1.0 or name in robot.shapes}
        return super().shapes(robot) | stated

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return a share of the speed limit of an axis, or of a typical one [rad/s or m/s]."""
        limits = robot.speed_limits[[] if axis.row is None else np.flatnonzero(axis.row)]
        known = limits[np.isfinite(limits)]
        # Stribeck velocity where none is given, as a share of the joint's speed limit.
        # Speed of joints without a limit [rad/s, m/s].
        return 0.1 * (float(known.max()) if len(known) else (2.0, 0.3)[axis.prismatic])


# Friction that builds up with speed, instead of jumping there.


@declare(
    "friction that builds up with speed",
    shapes=stribeck_velocities,
    needs="viscous_friction",
    continuous=True,
    told_by=SPEEDS,
)
class RisingFriction(StribeckFriction):
    """``τ = −Fr exp(−|q̇/vr|) sign(q̇)``: dry friction that is smaller at low speed.

    It is `stribeck_friction` of the other sign: seals, grease and preloaded gears whose friction
    rises to its level, or more slowly than viscous friction does. Its shape is the speed vr [rad/s
    or m/s] at which friction has reached 63 % of its rise.
    """

    name = "rising_friction"
    equation = "τ = −Fr exp(−|q̇/vr|) sign(q̇)"
    source = "[Olsson 1998, Eq. 4] with a static level below that of Coulomb"
    units = (("Fr", "N·m", "N"),)
    symbol = "vr"
    exponents = ()

    def curves(self, at: Along) -> list[Array]:
        """Return what is missing at low speed."""
        return [-column for column in super().curves(at)]


# Dry friction without a jump at standstill.


#: Speeds that are tried, as shares of the joint's rms speed.
SHARES = tuple(float(x) for x in np.geomspace(0.08, 3.2, 12))


@declare(
    "smooth (sigmoid) friction",
    shapes=lambda span: tuple(s * span.rms_speed for s in SHARES),
    needs="viscous_friction",
    continuous=True,
    told_by=SPEEDS,
)
class SigmoidFriction(StribeckFriction):
    """``τ = Ft tanh(q̇/vt)``: dry friction that turns smoothly from one direction to the other.

    Published models of the Franka Panda and of the UR10 have it. Its shape is the speed vt [rad/s
    or m/s] at which friction has 76 % of its level. With Coulomb friction in the model it resembles
    `rising_friction`.
    """

    name = "sigmoid_friction"
    equation = "τ = Ft tanh(q̇/vt)"
    source = "[Gaz 2019]"
    units = (("Ft", "N·m", "N"),)
    symbol = "vt"
    exponents = ()
    limits = ("coulomb_friction", "viscous_friction")

    def curves(self, at: Along) -> list[Array]:
        """Return the sigmoid."""
        return [np.tanh(at.speed / self.shape(at.robot, at.axis))]


# Friction in the joints of a closed chain that have no motor.


def _cables(robot: Robot) -> bool:
    """Whether the file states the friction of a tendon, which is there for its force alone."""
    names = [t.name for t in robot.cables if t.name in robot.passive]
    return any(robot.nominal.get(f"{name}.{kind}") for name in names for kind in ("Fv", "Fc"))


@declare(
    "passive-joint friction",
    lambda robot: tuple(a.name for a in robot.passive_axes),
    stated=_cables,
    separate=True,
    native=True,
)
class PassiveJointFriction(AlongAxes):
    """Viscous and Coulomb friction at passive joints, projected on the actuated ones by -Xᵀ."""

    name = "passive_joint_friction"
    equation = "τ = −Xᵀ (Fv q̇ₑ + Fc sign(q̇ₑ))"
    source = "[Díaz 2010, Eq. 10], projected as in [Díaz 2010, Eq. 7]"
    units = (("Fv", "N·m·s/rad", "N·s/m"), ("Fc", "N·m", "N"))
    nonnegative = True
    stated_as = ("damping", "frictionloss")

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return every passive joint of one degree of freedom."""
        return robot.passive_axes

    def curves(self, at: Along) -> list[Array]:
        """Return the speed and its sign."""
        return [at.speed, at.sign]


# Friction that changes with time, as grease that warms up.


@declare(
    "friction that changes with time",
    needs="viscous_friction",
    against="time",
    separate=True,
    told_by="repeat the motion later",
)
class FrictionDrift(AlongAxes):
    """``τ = (dv q̇ + dc sign(q̇)) t``: viscous and dry friction that change at a steady rate.

    Grease that warms up turns thinner; t is the time since the first row of each log.
    """

    name = "friction_drift"
    equation = "τ = (dv q̇ + dc sign(q̇)) t"
    source = "[Bittencourt 2012; Simoni 2015]"
    of_drive = True
    units = (("dv", "N·m/rad", "N/m"), ("dc", "N·m/s", "N/s"))

    def curves(self, at: Along) -> list[Array]:
        """Return both frictions, growing with time."""
        return [at.motion.elapsed * at.speed, at.motion.elapsed * at.sign]


# Dry friction at reversals, where joints stick for milliseconds that no encoder resolves.


class ReversalFriction(AlongAxes):
    """``τ = (r₀ + r₁ |q̈|^-½ + r₂ |q̈|^½) d sign(q̇)/dt``: friction that turns later than its sign.

    A joint sticks at a reversal until its drive overcomes the friction, the longer the less it is
    accelerated. It is no effect to be named: every model of dry friction has it, and without it a
    diagnosis takes it for delays.
    """

    name = "reversal_friction"
    equation = "τ = (r₀ + r₁ |q̈|^-½ + r₂ |q̈|^½) d sign(q̇)/dt"
    source = "[Karnopp 1985]"
    of_drive = True
    units = (("r0", "N·m·s", "N·s"), ("r1", "N·m·s", "N·s"), ("r2", "N·m·s", "N·s"))

    def curves(self, at: Along) -> list[Array]:
        """Return pulses at reversals, weighed by the acceleration over its median."""
        pulse = at.slope(at.sign)
        size = np.abs(at.acceleration)
        root = np.sqrt(np.clip(size / (np.median(size) or 1.0), SLOWEST, None))
        return [pulse, pulse / root, pulse * root]


#: Least acceleration at a reversal, over the median of all.
SLOWEST: Tolerance = 0.05
#: Candidates that every hypothesis has in addition to Coulomb friction.
REVERSALS = Family(ReversalFriction(), "friction at reversals", needs="coulomb_friction")
