"""What became of a name that an earlier diagnosis gave, once there is a log more."""

from typing import Literal

from identifiability.foundation.values import frozen

Outcome = Literal["decided", "kept", "open", "gone"]


@frozen
class Turn:
    """What became of a name.

    Attributes
    ----------
    before, after : str
        In words; empty where it went.
    outcome : {"decided", "kept", "open", "gone"}
    """

    before: str
    after: str
    outcome: Outcome

    @property
    def text(self) -> str:
        """One sentence."""
        ends = {
            "decided": f"is {self.after}",
            "kept": "stays",
            "open": f"is {self.after}: still open",
            "gone": "is not named any more",
        }
        return f"{self.before[0].upper()}{self.before[1:]} {ends[self.outcome]}."
