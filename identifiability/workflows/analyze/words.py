"""The answer of an analysis in plain words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from identifiability.estimation.doubt import NO_DOUBT, Doubt
from identifiability.estimation.instrumental import InstrumentalVariables
from identifiability.estimation.prediction import Prediction
from identifiability.estimation.renoised import RenoisedLeastSquares
from identifiability.estimation.verdict import Class
from identifiability.foundation.errors import listing
from identifiability.regression.base_parameters import BaseParameters
from identifiability.workflows.analyze.assessment import RungResult

#: Why no verdict is believed where a model would be used that is no better than no model.
WORSE = "no model predicts motion that it has not seen better than a constant torque would"

#: Error on unseen motion, of how much torque varies, up to which it is called so; a rule of thumb.
GRADES = ((0.03, "very-good"), (0.08, "good"), (0.15, "fair"), (0.5, "poor"), (math.inf, "useless"))


def grade_of(error: float) -> str:
    """Return the name of the grade of an error on unseen motion."""
    return next(name for limit, name in GRADES if error <= limit)


def state_answer(
    base: BaseParameters,
    models: Sequence[RungResult],
    chosen: RungResult,
    physics: str,
    nothing: str = "",
    missing: Doubt = NO_DOUBT,
) -> str:
    """Return how many parameters the logs determine, and which model to use.

    Parameters
    ----------
    base : BaseParameters
    models : sequence of RungResult
        The unpruned one first.
    chosen : RungResult
        The selected one.
    physics : str
        What `state_physics` says of the selected model.
    nothing : str
        Why no verdict is believed, if that is so (`doubt`).
    missing : Doubt, optional
        Functions that are missing in it.
    """
    total, full = len(base.parameters), models[0]
    size = f"The robot has {total} parameters, {base.rank} of them independent in principle."
    why = nothing or _why_none(base, models, chosen)
    if why:
        return f"Nothing is identifiable, because {why}. {size}"
    if chosen.unjudged:
        return f"Nothing is judged. {chosen.unjudged} {size}"
    held = 100 * chosen.error_ra_validation
    known = f"determine {full.count(Class.IDENTIFIABLE)} of them in the unpruned model"
    if full.unjudged:
        known = "do not suffice to judge the unpruned model"
    text = (
        f"Of {total} parameters {base.rank} can be told apart in principle; these logs {known}. "
        f"The model to use is {chosen.name}: {chosen.count(Class.IDENTIFIABLE)} of its "
        f"{len(chosen.rung)} parameters are identifiable, and it predicts motion that it has not "
        f"seen with an error of {held:.3g} %."
    )
    if not (full.count(Class.IDENTIFIABLE) or chosen.count(Class.IDENTIFIABLE)):
        most = max(models, key=lambda m: m.count(Class.IDENTIFIABLE))
        count = most.count(Class.IDENTIFIABLE)
        text += f" In {most.name} {count} of {len(most.rung)} parameters are identifiable."
    if missing.functions:
        text += f" That holds only if nothing is missing: {missing.statement}: diagnose."
    why_not = f"The unpruned model is not judged. {full.unjudged}" if full.unjudged else ""
    return " ".join(filter(None, (text, physics, why_not)))


def state_physics(chosen: RungResult) -> str:
    """Return what physics says of a model."""
    if chosen.feasible:
        return "A real robot can have its values."
    if chosen.physical.nearest is None:
        return chosen.physical.sentence
    near = f"the nearest real robot errs by {100 * chosen.error_ra_physical:.3g} %."
    if chosen.physical_used:
        near = (
            f"the nearest real robot errs by {100 * chosen.error_ra_physical:.3g} %, not surely "
            "more than they do: its values are those to use, and predictions and exports have them."
        )
    if chosen.infeasible:
        return (
            f"But {len(chosen.infeasible)} of its values have a sign that physics forbids "
            f"({listing(chosen.infeasible, 4)}); {near}"
        )
    if chosen.physical.certificate is None:
        return f"The motion leaves some of its parameters open; {near}"
    return f"No real robot has exactly its values, although each sign is possible; {near}"


def state_weak(chosen: RungResult) -> str:
    """Return one sentence on values without a strong instrument, or nothing."""
    correction = chosen.estimate.correction
    if correction is None:
        return ""
    known = {v.name for v in chosen.verdicts if v.verdict is Class.IDENTIFIABLE}
    touched = [name for name in correction.touched if name in known]
    if not touched:
        return ""
    why, counted = "the second record of the motion says too little", ""
    estimator = chosen.estimate.estimator
    if isinstance(estimator, RenoisedLeastSquares):
        why = "noise of the motion leaves too little to be corrected"
    elif isinstance(estimator, InstrumentalVariables) and estimator.record != "command":
        counted = " (σ holds it)"
    return (
        f"In {correction.weak} of {len(chosen.estimate.kept)} directions {why}, and least squares "
        "stays, with the bias that noise in the motion "
        f"gives it{counted}; {listing(touched, 4)} lean on them: move faster or longer, or measure "
        "the motion better."
    )


def doubt(
    why: str, results: tuple[RungResult, ...], at: int, held_out: Prediction
) -> tuple[tuple[RungResult, ...], str]:
    """Take the verdicts back where none can be believed; return them, and why not.

    Parameters
    ----------
    why : str
        What speaks against all of them: the fitted logs have nothing to explain, or are misread;
        empty if nothing does.
    results : tuple of RungResult
    at : int
        The selected model.
    held_out : Prediction
    """
    if not why and not results[at].error_ra_validation < held_out.constant_error():
        why = WORSE
    return (tuple(r.withdraw(why) for r in results) if why else results), why


def _why_none(base: BaseParameters, models: Sequence[RungResult], chosen: RungResult) -> str:
    """Return why no parameter is called identifiable, or nothing if some are."""
    if chosen.unjudged or any(m.count(Class.IDENTIFIABLE) for m in models):
        return ""
    excited = len(models[0].estimate.kept)
    if excited < base.rank:
        return (
            f"the motion excites only {excited} independent combinations of parameters and "
            "noise hides these"
        )
    return "the residual hides every parameter"
