"""What the motion that verifies says of an effect, where it is, and both motions together."""

import numpy as np

from identifiability.foundation.numbers import REACH
from identifiability.foundation.values import frozen

#: Evidence beyond which more changes nothing [nats].
MOST = 500.0
#: Evidence below which a likelihood ratio is barely worth mentioning: half a decade
#: [Jeffreys 1961].
BARELY = 0.5 * float(np.log(10.0))
#: Times itself within which a motion tells the size of an effect, if it says anything of it.
BLIND = 4.0


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
    news : (float, float)
        95 % of how much of the effect of the fitted size is there, one being all of it, in what
        neither the memory of the noise nor errors of other values foretell: slow noise hides a
        small change in the error, and motion that the fitted one tells little of a large one.
    """

    before: float
    after: float
    interval: tuple[float, float]
    expected: float
    strength: float = float("inf")
    news: tuple[float, float] = (float("nan"), float("nan"))

    @property
    def there(self) -> bool:
        """Whether some of the effect is surely there in what the memory of the noise leaves."""
        return self.news[0] > 0

    @property
    def seen(self) -> bool:
        """Whether this motion says anything of its size."""
        low, high = self.news
        return high - low < 2 * BLIND

    @property
    def better(self) -> bool:
        """Whether the error surely falls, or the effect is surely there and it does not rise."""
        return self.interval[1] < 0 or (self.there and self.after <= self.before)

    @property
    def alike(self) -> bool:
        """Whether it may be as large here as where it was fitted, within 95 % of either.

        What only resembles the missing effect takes another size on every motion.
        """
        low, high = self.news
        reach = REACH / max(self.strength, REACH)
        return not (low > 1 + reach or high < 1 - reach)

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
        """Whether this motion would confirm a change as large as is expected, 39 times of 40.

        The change that it shows is off by less than half the interval so often, and must be
        larger than that to be sure.
        """
        low, high = self.interval
        return high - low < -self.expected


@frozen
class Both:
    """What the fitted motion and the one that verifies say of an effect together.

    Attributes
    ----------
    p_value : float
        Family-wise, of the fitted motion.
    evidence : float
        Logarithm of the likelihood ratio of the motion that verifies given the fitted one: the
        model with the effect over that without it.
    level : float
        Most chance with which it is given.
    within_noise : bool
        Whether the motion that verifies is predicted so beside it, but for errors of the fit: else
        the likelihood ratio is not what noise would make.
    """

    p_value: float
    evidence: float
    level: float
    within_noise: bool = True

    @property
    def chance(self) -> float:
        """The p-value of both: the one over the other's likelihood ratio.

        If noise alone made the effect, that ratio is one in the mean whatever was fitted elsewhere,
        so that it may weigh a p-value [Wasserman, Ramdas & Balakrishnan 2020; Ignatiadis, Wang &
        Ramdas 2024].
        """
        return self.p_value * float(np.exp(np.clip(-self.evidence, -MOST, MOST)))

    @property
    def unlikely(self) -> bool:
        """Whether noise makes the like too often; not where no p-value is known."""
        return self.chance > self.level

    @property
    def likely(self) -> bool:
        """Whether noise does not, and the motion that verifies speaks for it by itself, too."""
        return self.chance <= self.level and self.evidence > 0

    def opposes(self, shown: Shown) -> bool:
        """Whether unseen motion is likelier without it, and shows none of it for sure but could.

        What chance makes of hundreds of options is there on the fitted motion alone. A ratio that
        is barely worth mentioning is no opposition: half of all true effects that a motion hardly
        shows have one.
        """
        return self.evidence < -BARELY and shown.seen and not shown.there


#: Of an effect without a p-value nothing is asked.
UNASKED = Both(float("nan"), 0.0, float("nan"))
