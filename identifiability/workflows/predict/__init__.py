"""Predict torque along a log: from a result, or from what its JSON keeps (`Fit`)."""

from identifiability.workflows.predict.fit import Fit, read_fit
from identifiability.workflows.predict.given import FitLike, find_fit
from identifiability.workflows.predict.predicts import Predicts
from identifiability.workflows.predict.result import TorquePrediction

__all__ = ["Fit", "FitLike", "Predicts", "TorquePrediction", "find_fit", "read_fit"]
