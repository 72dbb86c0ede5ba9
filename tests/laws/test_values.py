"""What passes between stages is frozen in fact, equal by identity where arrays are, and short."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen


@frozen
class Held:
    """An array, and a check of its own."""

    name: str
    x: Array
    maybe: Array | None = None

    def __post_init__(self):
        if len(self.x) == 0:
            raise ValueError("empty")


def test_arrays_are_read_only_and_the_givers_own_stays_writable():
    mine = np.zeros(3)
    held = Held("a", mine)
    with pytest.raises(ValueError, match="read-only"):
        held.x[0] = 1.0
    mine[0] = 2.0
    assert held.x[0] == 2.0
    with pytest.raises(FrozenInstanceError):
        held.x = mine
    with pytest.raises(ValueError, match="read-only"):
        Held("a", mine, mine).maybe[0] = 1.0
