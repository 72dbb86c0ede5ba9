"""Which dynamic parameters of a robot do your logs determine, and which model is worth using?

What to use when:

- `analyze` does the main job: robot and logs in, verdicts, models and a report out;
- `inspect` lists the content of a robot file and the columns that a log must have; with logs it
  also lists their content and their data-quality problems;
- `prune` finds the reduced model that is worth using; `diagnose` finds effects that a model lacks;
- `predict` computes torque along other logs from a result; with ``forward=True`` it simulates the
  positions that follow from commands or torques; `from_json` reads a result back;
- `payload` identifies a load on a body of a robot that was fitted without it; `compare` finds the
  changes between two logs or results;
- `analyze_many` analyzes many robots and returns one table, and a page for each;
- `calibrate` measures the reliability of the answers; `export` writes them as a robot file;
- `Robot.load` and `Log.read` read files; `simulate` makes logs of a known robot;
- `plot` draws the figures of a report one by one;
- every stage in between (`prepare_log`, `find_base_parameters`, `gather_information`,
  `estimate`, …) can be called by itself.

Names are imported when they are first used: ``import identifiability`` is quick.
"""

# ruff: noqa: I001 - a type checker wants each name twice, and isort then a line for each

from importlib import import_module
from typing import TYPE_CHECKING, Any

from identifiability.foundation import __version__

#: The distribution that this package is of; another one has a package of the same name.
__distribution__ = "robot-identifiability"

if TYPE_CHECKING:
    from identifiability.effects.effect import Effect as Effect
    from identifiability.estimation.estimate import estimate as estimate
    from identifiability.estimation.estimator import Estimate as Estimate
    from identifiability.estimation.rules import Thresholds as Thresholds
    from identifiability.estimation.verdict import Verdict as Verdict
    from identifiability.foundation.errors import IdentifiabilityError as IdentifiabilityError
    from identifiability.foundation.keyed import Row as Row
    from identifiability.logs import Log as Log
    from identifiability.logs.prepare import (
        Dataset as Dataset,
        Preparation as Preparation,
        prepare_log as prepare_log,
    )
    from identifiability.regression.information import gather_information as gather_information
    from identifiability.regression.information import Information as Information
    from identifiability.regression.regression import Model as Model, Regression as Regression
    from identifiability.regression.structure import (
        BaseParameters as BaseParameters,
        find_base_parameters as find_base_parameters,
    )
    from identifiability.report import plot as plot
    from identifiability.robot import Motion as Motion, Robot as Robot
    from identifiability.simulation import (
        Noise as Noise,
        Trajectory as Trajectory,
        simulate as simulate,
    )
    from identifiability.workflows.analyze import Analysis as Analysis, analyze as analyze
    from identifiability.workflows.case import Case as Case
    from identifiability.workflows.calibrate.calibration import (
        Calibration as Calibration,
        calibrate as calibrate,
    )
    from identifiability.workflows.compare import Comparison as Comparison, compare as compare
    from identifiability.workflows.diagnose import Diagnosis as Diagnosis, diagnose as diagnose
    from identifiability.workflows.excite import Excitation as Excitation, excite as excite
    from identifiability.workflows.export import Exported as Exported, export as export
    from identifiability.workflows.inspect import Inspection as Inspection, inspect as inspect
    from identifiability.workflows.many import Fleet as Fleet, analyze_many as analyze_many
    from identifiability.workflows.payload import Load as Load, payload as payload
    from identifiability.workflows.predict import (
        Fit as Fit,
        PositionPrediction as PositionPrediction,
        TorquePrediction as TorquePrediction,
        predict as predict,
    )
    from identifiability.workflows.prune import Ladder as Ladder, prune as prune
    from identifiability.workflows.study import Study as Study, new_study as new_study


#: The module of each public name.
_HOMES = {
    name: home
    for home, names in {
        "effects.effect": ("Effect",),
        "estimation.estimate": ("estimate",),
        "estimation.estimator": ("Estimate",),
        "estimation.rules": ("Thresholds",),
        "estimation.verdict": ("Verdict",),
        "foundation.errors": ("IdentifiabilityError",),
        "foundation.keyed": ("Row",),
        "logs": ("Log",),
        "logs.prepare": ("Dataset", "Preparation", "prepare_log"),
        "regression.structure": ("BaseParameters", "find_base_parameters"),
        "regression.information": ("Information", "gather_information"),
        "regression.regression": ("Model", "Regression"),
        "report": ("plot",),
        "robot": ("Motion", "Robot"),
        "simulation": ("Noise", "Trajectory", "simulate"),
        "workflows.analyze": ("Analysis", "analyze"),
        "workflows.case": ("Case",),
        "workflows.calibrate.calibration": ("Calibration", "calibrate"),
        "workflows.compare": ("Comparison", "compare"),
        "workflows.diagnose": ("Diagnosis", "diagnose"),
        "workflows.excite": ("Excitation", "excite"),
        "workflows.export": ("Exported", "export"),
        "workflows.inspect": ("Inspection", "inspect"),
        "workflows.many": ("Fleet", "analyze_many"),
        "workflows.payload": ("Load", "payload"),
        "workflows.predict": ("Fit", "PositionPrediction", "TorquePrediction", "predict"),
        "workflows.prune": ("Ladder", "prune"),
        "workflows.study": ("Study", "new_study"),
    }.items()
    for name in names
}

__all__ = ["__version__", *_HOMES]  # noqa: PLE0604 - names


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'identifiability' has no attribute '{name}'")
    value = getattr(import_module(f"identifiability.{home}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
