"""`FirstAnswer`: the numbers of servos and joints from some windows of long logs of commands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from identifiability.foundation.names import Strings
from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.robot import Robot

from .rollouts import Rollouts

#: Numbers of a joint that a first answer states.
STATED = ("kp", "Ia", "Fv", "Fc", "off")


@frozen
class FirstAnswer(Result):
    """Numbers of joints from rollouts of some windows, before all windows are rolled out.

    Attributes
    ----------
    robot : Robot
    logs : tuple of str
        Names of the logs.
    seconds : float [s]
        Total length of the windows.
    of_seconds : float [s]
        Total length of the logs.
    found : Rollouts
        Of these windows.
    """

    schema: ClassVar[str] = "identifiability/first_answer/1"

    robot: Robot
    logs: Strings
    seconds: float
    of_seconds: float
    found: Rollouts

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the numbers of each joint, with the error of its rollouts [mrad or mm].

        The standard deviation of its gain is relative; it is 0 for a stated gain.
        """
        found = self.found
        problem = found.search[0]
        is_fitted = problem.varied[problem.at("kp")]
        sd = np.sqrt(np.diag(found.covariance))[2 * len(self.robot.joints) :]
        log_kp_sd = np.where(is_fitted, sd, 0.0)
        for j, joint in enumerate(self.robot.joints):
            numbers = {kind: float(found.numbers[kind][j]) for kind in STATED}
            error = 1e3 * float(found.errors[j])
            yield {"joint": joint, **numbers, "kp_sd": float(log_kp_sd[j]), "error": error}

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        return {
            "schema": self.schema,
            "robot": self.robot.name,
            "logs": list(self.logs),
            "seconds": self.seconds,
            "delays": self.found.delays.tolist(),
            "joints": [*self.rows()],
            "statement": self.statement,
        }
