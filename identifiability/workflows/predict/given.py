"""`find_fit`: the fitted model of a result, however the result is given."""

from pathlib import Path
from typing import Annotated

from identifiability.foundation.options import Expected, OptionError
from identifiability.robot import Robot
from identifiability.workflows.predict.fit import Fit, read_fit
from identifiability.workflows.predict.predicts import Predicts

FitLike = Annotated[
    Fit | Predicts | str | Path,
    Expected("a result of analyze, prune or diagnose, or the path of its JSON"),
]


def find_fit(result: FitLike, robot: Robot) -> Fit:
    """Return the fitted model of a result of a robot.

    Raises
    ------
    IdentifiabilityError
        If a file is no result with a fitted model, or a result is about another robot.
    """
    if isinstance(result, (str, Path)):
        return read_fit(result, robot)
    fit = result if isinstance(result, Fit) else result.fit
    if fit.robot.joints != robot.joints or fit.robot.bodies != robot.bodies:
        raise OptionError(
            f"The result is about {fit.robot.name}, and the robot given is {robot.name}; give the "
            "robot that the result was made with."
        )
    return fit
