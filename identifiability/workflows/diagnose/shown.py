"""`Shown`: what the motion that verifies says of an effect, where the effect is."""

from identifiability.foundation.shares import REACH
from identifiability.foundation.values import frozen


@frozen
class Shown:
    """What the motion that verifies shows of an effect at the joints where it is.

    Attributes
    ----------
    before, after : float
        Error over each of these joints' own scale, without and with the effect.
    interval : (float, float)
        95 % of the change.
    expected : float
        The change that an effect of the fitted size would bring; zero or less.
    strength : float
        That size in standard errors of the fit.
    """

    before: float
    after: float
    interval: tuple[float, float]
    expected: float
    strength: float = float("inf")

    @property
    def least(self) -> float:
        """The change were its true size at the near end of its 95 % interval; zero or less."""
        true = 1 - REACH / self.strength if self.strength > 0 else 0.0
        return max(2 * true - 1, 0.0) * self.expected

    @property
    def contradicts(self) -> bool:
        """Whether the error surely rises, or does not fall where it surely should fall further."""
        low, high = self.interval
        return low > 0 or (high >= 0 and low > self.least)

    @property
    def telling(self) -> bool:
        """Whether this motion can show a change as large as is expected."""
        low, high = self.interval
        return (high - low) / 2 < -self.expected
