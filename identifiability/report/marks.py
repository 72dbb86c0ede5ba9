"""How a verdict looks, in tables and figures alike: colour and symbol, never colour alone."""

from __future__ import annotations

from typing import Literal

from identifiability.foundation.values import frozen

Tone = Literal["blue", "green", "amber", "vermilion", "purple", "sky", "grey"]


@frozen
class Mark:
    """The look of a class.

    Attributes
    ----------
    tone : str
        Colour of the colour-blind-safe palette [Okabe & Ito 2008].
    symbol : str
        Stands before the word.
    marker, fill : str
        The same in Matplotlib's terms.
    """

    tone: Tone
    symbol: str
    marker: str = "o"
    fill: Literal["full", "left", "none"] = "full"


MARKS = {
    "identifiable": Mark("blue", "●"),
    "weak": Mark("amber", "◐", "o", "left"),
    "negligible": Mark("grey", "○", "o", "none"),
    "model in doubt": Mark("amber", "!", "^", "none"),
    "not identifiable": Mark("vermilion", "✕", "x"),
    "not judged": Mark("grey", "?", "s", "none"),
    "constraint-determined": Mark("purple", "◆", "D"),
    "prior-dominated": Mark("sky", "◇", "D", "none"),
    "data": Mark("blue", "●"),
    "constraint": Mark("purple", "◆", "D"),
    "prior": Mark("sky", "◇", "D", "none"),
    "structure": Mark("grey", "✕", "x"),
    "model": Mark("grey", "○", "o", "none"),
    "pass": Mark("green", "✓"),
    "partly": Mark("amber", "◐", "o", "left"),
    "differs": Mark("vermilion", "✕", "x"),
    "not checked": Mark("grey", "○", "o", "none"),
}

_OTHER = Mark("grey", "·", ".")


def mark_of(kind: str) -> Mark:
    """Return the look of a verdict, or a neutral one for a word that has none."""
    return MARKS.get(kind, _OTHER)
