"""Refits of a model to physically consistent values, with one number fixed: for its profile."""

from dataclasses import replace

import numpy as np

from identifiability.estimation.profile import Refit
from identifiability.foundation.names import Array

from .fitted_model import FittedModel, Fixed
from .project import Projection


def refit_consistent(model: FittedModel, direction: Array, unit: float) -> Refit:
    """Return the refits with ``direction @ phi`` fixed and all bodies physically consistent.

    Parameters
    ----------
    model : FittedModel
    direction : (p,)
        The number as a combination of the standard parameters.
    unit : float [torque²]
        Rise of the squared residual that counts as one.
    """
    held = model.fixed
    data = model.data.beside(*model.left_out)
    rows = np.vstack([held.rows, direction])
    plain = Projection(model.region, reference=model.structure.nominal)

    def refit(value: float) -> tuple[float, Array]:
        fixed = Fixed(rows, np.append(held.value, value))
        try:
            found = replace(plain, fixed=fixed).solve(data)
        except ValueError:  # no body has that value
            return np.inf, np.full(len(direction), np.nan)
        return (found.rss - data.rss_min) / unit, found.phi

    return refit
