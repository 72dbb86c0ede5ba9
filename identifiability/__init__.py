"""Which dynamic parameters of a robot do your logs determine, and which model is worth using?

What to use when:

- `analyze` does the main job: robot and logs in, verdicts, models and a report out;
- `prune` finds the reduced model that is worth using, `diagnose` what a model misses;
- `Robot.load` and `Log.read` read files; `simulate` makes logs of a robot that is known;
- every stage in between (`prepare_samples`, `find_base_parameters`, `gather_information`,
  `estimate`, …) can be called by itself.

Names are imported when they are first used: ``import identifiability`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from identifiability.analysis import Analysis, analyze
    from identifiability.diagnosis import Diagnosis, diagnose
    from identifiability.errors import IdentifiabilityError
    from identifiability.estimation import Estimate, estimate
    from identifiability.excitation import Excitation, excite
    from identifiability.grouping import BaseParameters, find_base_parameters
    from identifiability.information import Information, gather_information
    from identifiability.logs import Log
    from identifiability.model import Model, Regression
    from identifiability.pruning import Ladder, prune
    from identifiability.robot import Motion, Robot
    from identifiability.samples import Preparation, Samples, prepare_samples
    from identifiability.simulation import Noise, Trajectory, simulate
    from identifiability.verdict import Verdict

__version__ = "0.1.0"

_HOMES = {
    "Analysis": "analysis",
    "BaseParameters": "grouping",
    "Diagnosis": "diagnosis",
    "Estimate": "estimation",
    "Excitation": "excitation",
    "IdentifiabilityError": "errors",
    "Information": "information",
    "Ladder": "pruning",
    "Log": "logs",
    "Model": "model",
    "Motion": "robot",
    "Noise": "simulation",
    "Preparation": "samples",
    "Regression": "model",
    "Robot": "robot",
    "Samples": "samples",
    "Trajectory": "simulation",
    "Verdict": "verdict",
    "analyze": "analysis",
    "diagnose": "diagnosis",
    "estimate": "estimation",
    "excite": "excitation",
    "find_base_parameters": "grouping",
    "gather_information": "information",
    "prepare_samples": "samples",
    "prune": "pruning",
    "simulate": "simulation",
}

__all__ = [
    "Analysis",
    "BaseParameters",
    "Diagnosis",
    "Estimate",
    "Excitation",
    "IdentifiabilityError",
    "Information",
    "Ladder",
    "Log",
    "Model",
    "Motion",
    "Noise",
    "Preparation",
    "Regression",
    "Robot",
    "Samples",
    "Trajectory",
    "Verdict",
    "__version__",
    "analyze",
    "diagnose",
    "estimate",
    "excite",
    "find_base_parameters",
    "gather_information",
    "prepare_samples",
    "prune",
    "simulate",
]


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'identifiability' has no attribute '{name}'")
    value = getattr(import_module(f"identifiability.{home}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
