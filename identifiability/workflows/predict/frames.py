"""Values and their covariance as labelled tables."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterable
from typing import TYPE_CHECKING

import numpy as np

from identifiability.foundation.names import Array

if TYPE_CHECKING:
    import pandas as pd


def correlation_of(covariance: Array) -> Array:
    """Return the correlation matrix of a covariance; NaN where a variance is zero or unknown."""
    sd = np.sqrt(np.where(np.diag(covariance) > 0, np.diag(covariance), np.nan))
    out: Array = covariance / np.outer(sd, sd)
    return out


def square_frame(matrix: Array, names: Iterable[Hashable]) -> pd.DataFrame:
    """Return a matrix (k, k) with the names of the parameters at its rows and columns."""
    import pandas as pd  # noqa: PLC0415 - only who wants a table pays for it

    return pd.DataFrame(matrix, index=list(names), columns=list(names))


class Covaries(ABC):
    """What knows parameters by name and how their values vary together."""

    @abstractmethod
    def covariance_frame(self) -> pd.DataFrame:
        """Return the covariance of the values with what the noise remembers, (k, k).

        Rows and columns are parameters; units are those of the two multiplied.
        """

    def correlation_frame(self) -> pd.DataFrame:
        """Return the correlation of the values, (k, k); NaN where a variance is zero or unknown.

        Near −1 the sum of two parameters is known better than either, near 1 their difference.
        """
        covariance = self.covariance_frame()
        return square_frame(correlation_of(covariance.to_numpy()), list(covariance.columns))
