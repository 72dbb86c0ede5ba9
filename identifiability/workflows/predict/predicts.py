"""`Predicts`: what results that hold one fitted model have in common."""

from abc import abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING

from identifiability.foundation.engines.mapping import Engine
from identifiability.robot import RobotLike
from identifiability.workflows.opening import Logs
from identifiability.workflows.predict.fit import Fit, read_fit
from identifiability.workflows.predict.frames import Covaries
from identifiability.workflows.predict.result import TorquePrediction

if TYPE_CHECKING:
    import pandas as pd


class Predicts(Covaries):
    """A result with a fitted model: it predicts torque, and is read back from JSON as a `Fit`."""

    @property
    @abstractmethod
    def fit(self) -> Fit:
        """The model to use: values, covariance, and how torque scatters about it."""

    def covariance_frame(self) -> "pd.DataFrame":
        """Return the covariance of the values of the model to use, by name, (k, k)."""
        return self.fit.covariance_frame()

    def predict(self, logs: Logs, *, engine: Engine | None = None) -> TorquePrediction:
        """Return the torque of the model to use along logs, with its intervals.

        Parameters
        ----------
        logs : log, path, DataFrame, or several
            They are prepared like the fitted ones, with the same cut-off. They need no torque.
        engine : Engine, optional
            Where logs that are too long for memory are surveyed.

        Raises
        ------
        IdentifiabilityError
            If the fitted logs had nothing to explain, or a log does not fit the robot.
        """
        return self.fit.predict(logs, engine=engine)

    @staticmethod
    def from_json(path: str | Path, robot: RobotLike) -> Fit:
        """Read the model to use back from the JSON of a result.

        It has names, values, covariance and everything that predicting takes. Not read back:
        verdicts, sentences, other models, posteriors, samples and resampled values.

        Parameters
        ----------
        path : path
        robot : Robot, path or shipped name
            The robot that the result is about.

        Raises
        ------
        IdentifiabilityError
            If the file is no such result, or is about another robot.
        """
        return read_fit(path, robot)
