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
    #: Numbers that no real joint has below zero.
    bounded: ClassVar[Strings] = ("Ia", "Fv", "Fc")

    robot: Robot
    logs: Strings
    seconds: float
    of_seconds: float
    found: Rollouts

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the numbers of each joint, with the error of its rollouts [mrad or mm].

        The standard deviation of its gain is relative; it is 0 for a stated gain. Where the command
        of a joint stands, numbers are None, but for a stated gain.
        """
        found = self.found
        problem = found.search[0]
        moves = problem.moves.any(0)
        is_fitted = problem.varied[problem.at("kp")]
        sd = np.sqrt(np.diag(found.covariance))[2 * len(self.robot.joints) :]
        log_kp_sd = np.where(is_fitted, sd, 0.0)
        columns = {kind: found.numbers[kind] for kind in STATED}
        # Rounding passes a bound.
        columns |= {kind: np.maximum(columns[kind], 0.0) for kind in self.bounded}
        columns |= {"kp_sd": log_kp_sd, "error": 1e3 * found.errors}
        assert self.robot.servo is not None
        stated = ~np.isnan(self.robot.servo.kp)
        for j, joint in enumerate(self.robot.joints):
            numbers = {
                kind: float(column[j]) if moves[j] or (kind == "kp" and stated[j]) else None
                for kind, column in columns.items()
            }
            yield {"joint": joint, **numbers}

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
