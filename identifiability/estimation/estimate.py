"""From information to an estimate, by any estimator that is known by name."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.instrumental import InstrumentalVariables
from identifiability.estimation.least_squares import OrdinaryLeastSquares, WeightedLeastSquares
from identifiability.estimation.memory import LogNoise, Noise
from identifiability.estimation.renoised import RenoisedLeastSquares
from identifiability.foundation.options import OptionError, check_choice, checked
from identifiability.regression.information import Information

#: An estimator, or its name.
Method = str | Estimator

#: Estimators that mend what another one finds.
CORRECTED = (InstrumentalVariables, RenoisedLeastSquares)

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


#: So many independent outputs for each of its parameters leave a model a residual that is noise.
ENOUGH = 3.0

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


def settle_noise(estimator: Estimator, whole: Information) -> Estimator:
    """Return the estimator with the noise of the logs, for all models of them.

    A model that leaves something out leaves it in the residual, where it looks like noise, slow
    noise above all: a constant torque remembers for ever. Noise is a property of the logs, so it is
    measured once, beside all columns. To its variance comes what a model leaves more than the whole
    one (`Noise.beside`): an actuator whose torque the model cannot explain must not decide what
    others need. Where too few outputs are independent to fit all columns, and for other estimators,
    each model measures its own.

    Parameters
    ----------
    estimator : Estimator
    whole : Information
        About all columns.
    """
    fresh = forget_noise(estimator)
    plain = fresh.base if isinstance(fresh, CORRECTED) else fresh
    if not isinstance(plain, OrdinaryLeastSquares):
        return fresh
    fit = fit_whole(plain, whole)
    if fit is None:
        return fresh
    noise, fits = Noise(fit.variance, fit.times), (OrdinaryLeastSquares().fit(whole), fit)
    left = np.stack([noise.count_left(whole, f) for f in fits])
    return _with_noise(fresh, LogNoise(noise.variance, noise.times, left))


def forget_noise(estimator: Estimator) -> Estimator:
    """Return the estimator that measures the noise of what it fits, a part of the logs say."""
    return _with_noise(estimator, None)


def _with_noise(estimator: Estimator, noise: LogNoise | None) -> Estimator:
    if isinstance(estimator, CORRECTED):
        return replace(estimator, base=replace(estimator.base, noise=noise))
    if isinstance(estimator, OrdinaryLeastSquares):
        return replace(estimator, noise=noise)
    return estimator


def fit_whole(estimator: Estimator, whole: Information) -> Estimate | None:
    """Return the fit of all columns; None where too few outputs are independent for them."""
    fit = estimator.fit(whole)
    independent = whole.samples * float(np.sum(1 / fit.times))
    return fit if fit.kept and independent >= ENOUGH * len(fit.kept) else None


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
