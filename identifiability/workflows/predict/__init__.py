"""Predict torque along a log: from a result, or from what its JSON keeps (`Fit`)."""

from identifiability.workflows.predict.fit import Fit, FitLike, Predicts, find_fit, read_fit
from identifiability.workflows.predict.prediction import TorquePrediction

__all__ = ["Fit", "FitLike", "Predicts", "TorquePrediction", "find_fit", "read_fit"]
