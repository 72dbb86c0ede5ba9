"""Dry friction that is not the same everywhere along a joint."""

from identifiability.effects.effect import Along
from identifiability.effects.family import Span
from identifiability.effects.position_torque import PositionTorque, reached_pieces
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array

#: Pieces that are tried over the range that was moved through.
PIECES = (1, 2, 3, 4, 6)


def _spacings(span: Span) -> tuple[float, ...]:
    return tuple(span.position_range / k for k in PIECES)


@declare(
    "friction that depends on the position",
    shapes=_spacings,
    reached=reached_pieces,
    against="position",
    needs="coulomb_friction",
    dry=True,
    late=True,
    flexible=True,
    told_by="pass each position in both directions",
    rank=6.5,
)
class PositionFriction(PositionTorque):
    """``τ = Σ cₖ Bₖ(q) sign(q̇)``: misaligned bearings, bent screws, worn teeth.

    The levels are cubic B-splines along the joint, as those of `position_torque`: what is added
    to the Coulomb friction that is there, of either sign. Its shape is the distance of the knots
    [rad or m].
    """

    name = "position_friction"
    equation = "τ = Σ cₖ Bₖ(q) sign(q̇)"
    source = "[Bittencourt 2012; de Boor 1978]"
    units = (("P", "N·m", "N"),)

    def curves(self, at: Along) -> list[Array]:
        """Return the splines, against the motion."""
        way = at.sign
        return [column * way for column in super().curves(at)]
