"""`Verification`: a test of a reading on rows that did not choose its numbers.

Blocks of all fitted logs form two parts. Each part chooses the numbers of the reading, and the
other part keeps only these numbers. It fits the base parameters again, together with smooth
functions of the motion. An effect that the model lacks is such a function. It repeats in both
parts, so it must not count as evidence.
"""

import numpy as np

from identifiability.foundation.values import Json, frozen

from .rules import RULES


@frozen
class Verification:
    """Gain of a reading on rows that did not choose its numbers.

    Attributes
    ----------
    gain : float [nat]
        Log evidence against the literal reading, summed over both parts.
    least : float [nat]
        The smaller gain of the two parts.
    predicted : float [nat]
        The gain that each part promises for rows that it did not see, summed.
    candidates : int
        Number of readings that were tried.
    against : float [nat]
        Evidence of the file's masses for the literal reading; negative if for this reading.
    """

    gain: float
    least: float
    predicted: float
    candidates: int
    against: float = 0.0

    @property
    def needed(self) -> float:
        """The gain from which a reading is used [nat]; each candidate had its chance."""
        price = float(np.log(max(self.candidates, 1))) + self.against
        return RULES.unseen_gain + max(price, 0.0)

    @property
    def can_confirm(self) -> bool:
        """Return whether the logs can confirm the reading at all."""
        return self.predicted >= RULES.unseen_gain

    @property
    def holds(self) -> bool:
        """Return whether the reading is used."""
        # A gain of z²/2 has a standard deviation of z.
        sd = float(np.sqrt(2.0 * max(self.predicted, 0.0)))
        replicates = self.gain >= self.predicted - 2.0 * sd
        return bool(
            self.can_confirm
            and replicates
            and self.gain >= self.needed
            and self.least >= -RULES.unseen_gain
        )

    @property
    def doubt(self) -> str:
        """Why a reading is not used, in a sentence."""
        if not self.can_confirm:
            return "These logs cannot confirm it."
        return "Rows that did not choose it do not confirm it, so it is not used."

    def to_dict(self) -> Json:
        """Return it as plain values."""
        return {
            "gain": self.gain,
            "least": self.least,
            "predicted": self.predicted,
            "needed": self.needed,
            "candidates": self.candidates,
            "holds": self.holds,
        }
