"""From information to an estimate, by any estimator that is known by name."""

from __future__ import annotations

from typing import Literal

from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.instrumental import InstrumentalVariables
from identifiability.estimation.least_squares import OrdinaryLeastSquares, WeightedLeastSquares
from identifiability.foundation.options import OptionError, check_choice, checked
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


#: ``ls``: least squares. ``iv``: instrumental variables, which noise in the motion does not bias.
#: ``auto``: the latter if any log has a second record of its motion; else the former, corrected by
#: what new noise of the motion does to it where it does anything.
Kind = Literal["auto", "ls", "iv"]


def choose_estimator(method: Method, kind: Kind, *, instruments: bool) -> Estimator:
    """Return the estimator of a method that weighs actuators and of a kind.

    Parameters
    ----------
    method : str or Estimator
    kind : {"auto", "ls", "iv"}
    instruments : bool
        Whether there are any.

    Raises
    ------
    OptionError
        If instruments cannot be combined with the method.
    """
    base = find_estimator(method)
    if isinstance(base, OrdinaryLeastSquares):
        return InstrumentalVariables(base) if instruments else base
    if kind != "auto":
        raise OptionError(
            f"The estimator '{kind}' weighs actuators by the method 'wls' or 'ols', and "
            f"'{base.name}' is neither: choose one of them, or leave out the estimator."
        )
    return base


@checked
def estimate(information: Information, method: Method = "wls") -> Estimate:
    """Return the estimate.

    Parameters
    ----------
    information : Information
    method : str or Estimator
        ``"wls"`` weights actuators by 1 / (variance × memory) of their noise, ``"ols"`` all alike.
    """
    return find_estimator(method).fit(information)
