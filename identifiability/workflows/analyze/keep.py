"""What analyze and prune keep of the model to use, to predict with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from identifiability.estimation.prediction import Prediction
from identifiability.estimation.spread import measure_spread
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.regression.information import Information
from identifiability.regression.structure import Structure
from identifiability.workflows.analyze.assessment import RungResult
from identifiability.workflows.predict.fit import Fit, settled


def keep_fit(
    structure: Structure,
    information: Information,
    result: RungResult,
    predictions: tuple[Prediction, Prediction],
    samples: Sequence[Prepared],
    settings: Mapping[str, object],
    nothing: str,
) -> Fit:
    """Return the fitted model of a result.

    Parameters
    ----------
    structure : Structure
    information : Information
        About the base parameters.
    result : RungResult
        The model to use.
    predictions : (Prediction, Prediction)
        By it alone, on the fitted logs and on what was held out.
    samples : sequence of Samples
        The fitted logs.
    settings : mapping
        Of the result; ``preparation`` counts.
    nothing : str
        Why no value is believed; empty where they are.

    Raises
    ------
    IdentifiabilityError
        If none is.
    """
    if nothing:
        raise IdentifiabilityError(
            f"Nothing can be predicted, because {nothing}; give other logs to fit."
        )
    own, unseen = ((p.joint_rms()[:, 0], p.joint_rms(raw=True)[:, 0]) for p in predictions)
    part = result.rung.reduce(information)
    spread = measure_spread(part, result.estimate, result.uncertainty, own, unseen)
    return Fit(
        structure=structure,
        rung=result.rung,
        values=result.estimate.value,
        spread=spread,
        preparation=settled(settings.get("preparation"), samples),
    )
