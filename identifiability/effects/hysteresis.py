"""Friction that builds up over the way after each reversal: presliding, hysteresis."""

from identifiability.effects.effect import Along, Shaped
from identifiability.effects.family import Span
from identifiability.effects.path_memory import stretch_of_springs
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array

#: Ways that are tried, as shares of the joint's range.
SHARES = (0.003, 0.01, 0.03, 0.1)
#: Ways of the elements over the shape.
ELEMENTS = (1.0, 2.0, 4.0)


def _ways(span: Span) -> tuple[float, ...]:
    return tuple(s * span.position_range for s in SHARES)


@declare(
    "presliding hysteresis",
    shapes=_ways,
    needs="coulomb_friction",
    dry=True,
    remembers=True,
    late=True,
    told_by="reverse often, after short ways and after long ones,",
    rank=6.3,
)
class Hysteresis(Shaped):
    """``τ = Σ Hₖ zₖ``, springs that slip: generalised Maxwell slip, linear in its levels.

    Each element is a spring that slips when it is stretched by rₖ: z goes with the way from −1
    to 1 after a reversal. The three ways are the shape r [rad or m] times 1, 2 and 4. Beyond them
    it is Coulomb friction.
    """

    name = "hysteresis"
    equation = "τ = Σ Hₖ zₖ(q), zₖ ← clip(zₖ + Δq/rₖ, ±1)"
    source = "[Iwan 1966; Al-Bender 2005]"
    units = tuple((f"H{k + 1}", "N·m", "N") for k in range(len(ELEMENTS)))
    usual = (0.01, 0.001)
    nonnegative = True

    def curves(self, at: Along) -> list[Array]:
        """Return how far each spring is stretched."""
        r = self.shape(at.robot, at.axis)
        return [stretch_of_springs(at.motion, at.travel, at.speed, r * k) for k in ELEMENTS]
