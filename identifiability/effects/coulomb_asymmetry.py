"""Coulomb friction with a level for each direction."""

from collections.abc import Mapping

import numpy as np

from identifiability.effects.effect import Along, AlongAxes
from identifiability.effects.family import RESTS, actuated_joints
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot

#: Levels of both directions that differ by less, as a share, are one: a solver rounded them.
ROUNDING = 1e-9


@declare(
    "asymmetric Coulomb friction",
    actuated_joints,
    needs="coulomb_friction",
    native=True,
    told_by=RESTS,
    rank=3,
)
class CoulombAsymmetry(AlongAxes):
    """``τ = Fc⁺`` for q̇ > 0 and ``−Fc⁻`` for q̇ < 0; both are positive numbers.

    A motor that mixes joints has one level: what its two directions differ by is a constant torque
    on its joints, which their own levels hold already. A robot file has their
    mean.
    """

    name = "coulomb_asymmetry"
    equation = "τ = Fc⁺ for q̇ > 0, −Fc⁻ for q̇ < 0"
    source = "[Díaz 2010, Eq. 10], with the condition on the velocity (printed on the position)"
    supersedes = ("coulomb_friction",)
    units = (("Fc", "N·m", "N"), ("Fc+", "N·m", "N"), ("Fc-", "N·m", "N"))
    nonnegative = True

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
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


def settle_directions(values: dict[str, float], given: Mapping[str, float]) -> None:
    """Let every Coulomb level of some values stand as one for both directions and one for each.

    What was given decides: a level for both, else those of each direction.
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
        if all(abs(values[way] - values[both]) <= ROUNDING * abs(values[both]) for way in ways):
            values |= dict.fromkeys(ways, values[both])
