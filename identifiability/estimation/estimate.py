"""From information to an estimate, by any estimator that is known by name."""

from __future__ import annotations

from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.least_squares import OrdinaryLeastSquares, WeightedLeastSquares
from identifiability.foundation.options import check_choice, checked
from identifiability.regression.information import Information

#: An estimator, or its name.
Method = str | Estimator

ESTIMATORS: dict[str, Estimator] = {
    e.name: e for e in (OrdinaryLeastSquares(), WeightedLeastSquares())
}


def register_estimator(estimator: Estimator) -> None:
    """Let an estimator be asked for by its name."""
    ESTIMATORS[estimator.name] = estimator


def find_estimator(method: Method) -> Estimator:
    """Return the estimator of a name.

    Raises
    ------
    OptionError
        If there is none, with those that there are.
    """
    if not isinstance(method, str):
        return method
    check_choice("method", method, tuple(ESTIMATORS))
    return ESTIMATORS[method]


@checked
def estimate(information: Information, method: Method = "wls") -> Estimate:
    """Return the estimate.

    Parameters
    ----------
    information : Information
    method : str or Estimator
        ``"wls"`` weights actuators by their own residual variance, ``"ols"`` all alike.
    """
    return find_estimator(method).fit(information)
