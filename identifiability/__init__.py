"""Which dynamic parameters of a robot do your logs determine, and which model is worth using?

What to use when:

- `analyze` does the main job: robot and logs in, verdicts, models and a report out;
- `inspect` needs no logs: what a robot file holds, which columns a log must have; with logs it says
  what is in them and what is odd about them;
- `prune` finds the reduced model that is worth using, `diagnose` what a model misses;
- `predict` gives torque along other logs by a result, or with ``forward=True`` the positions to
  which commands or torques move its robot; `from_json` reads a result back;
- `payload` weighs what hangs on a body of a robot that was fitted without it, `compare` says what
  changed between two logs or results;
- `analyze_many` asks the same of many robots: one table, and a page each;
- `calibrate` measures how far the answers can be trusted, `export` writes them as a robot file;
- `Robot.load` and `Log.read` read files; `simulate` makes logs of a robot that is known;
- `plot` draws the figures of a report one by one;
- every stage in between (`prepare_samples`, `find_base_parameters`, `gather_information`,
  `estimate`, …) can be called by itself.

Names are imported when they are first used: ``import identifiability`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from identifiability.foundation import __version__, hand_down

if TYPE_CHECKING:
    from identifiability.effects.effect import Effect
    from identifiability.estimation.estimate import estimate
    from identifiability.estimation.estimator import Estimate
    from identifiability.estimation.rules import Thresholds
    from identifiability.estimation.verdict import Verdict
    from identifiability.foundation.errors import IdentifiabilityError
    from identifiability.logs import Log
    from identifiability.logs.prepare import Preparation, Samples, prepare_samples
    from identifiability.regression.gather import gather_information
    from identifiability.regression.information import Information
    from identifiability.regression.regression import Model, Regression
    from identifiability.regression.structure import BaseParameters, find_base_parameters
    from identifiability.report import plot
    from identifiability.robot import Motion, Robot
    from identifiability.simulation import Noise, Trajectory, simulate
    from identifiability.workflows.analyze import Analysis, analyze
    from identifiability.workflows.calibrate.calibration import Calibration, calibrate
    from identifiability.workflows.compare import Comparison, compare
    from identifiability.workflows.diagnose import Diagnosis, diagnose
    from identifiability.workflows.excite import Excitation, excite
    from identifiability.workflows.export import Exported, export
    from identifiability.workflows.inspect import Inspection, inspect
    from identifiability.workflows.many import Fleet, analyze_many
    from identifiability.workflows.payload import Load, payload
    from identifiability.workflows.predict import Fit, PositionPrediction, TorquePrediction, predict
    from identifiability.workflows.prune import Ladder, prune
    from identifiability.workflows.study import Study, new_study


#: Where each public name stands.
_HOMES = {
    name: home
    for home, names in {
        "effects.effect": ("Effect",),
        "estimation.estimate": ("estimate",),
        "estimation.estimator": ("Estimate",),
        "estimation.rules": ("Thresholds",),
        "estimation.verdict": ("Verdict",),
        "foundation.errors": ("IdentifiabilityError",),
        "logs": ("Log",),
        "logs.prepare": ("Preparation", "Samples", "prepare_samples"),
        "regression.structure": ("BaseParameters", "find_base_parameters"),
        "regression.gather": ("gather_information",),
        "regression.information": ("Information",),
        "regression.regression": ("Model", "Regression"),
        "report": ("plot",),
        "robot": ("Motion", "Robot"),
        "simulation": ("Noise", "Trajectory", "simulate"),
        "workflows.analyze": ("Analysis", "analyze"),
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

__all__ = [
    "Analysis",
    "BaseParameters",
    "Calibration",
    "Comparison",
    "Diagnosis",
    "Effect",
    "Estimate",
    "Excitation",
    "Exported",
    "Fit",
    "Fleet",
    "IdentifiabilityError",
    "Information",
    "Inspection",
    "Ladder",
    "Load",
    "Log",
    "Model",
    "Motion",
    "Noise",
    "PositionPrediction",
    "Preparation",
    "Regression",
    "Robot",
    "Samples",
    "Study",
    "Thresholds",
    "TorquePrediction",
    "Trajectory",
    "Verdict",
    "__version__",
    "analyze",
    "analyze_many",
    "calibrate",
    "compare",
    "diagnose",
    "estimate",
    "excite",
    "export",
    "find_base_parameters",
    "gather_information",
    "inspect",
    "new_study",
    "payload",
    "plot",
    "predict",
    "prepare_samples",
    "prune",
    "simulate",
]


#: Functions that went, and what does their work.
_GONE = {"identify_gains": "payload(robot, empty, loaded, mass=kg, centre=(x, y, z))"}


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if name in _GONE:
        raise AttributeError(f"'{name}' is gone: call {_GONE[name]}")
    if home is None:
        raise AttributeError(f"module 'identifiability' has no attribute '{name}'")
    value = getattr(import_module(f"identifiability.{home}"), name)
    globals()[name] = value
    return value


def _notebook_piece(*given: Any) -> Any:
    from identifiability.report.results import notebook_piece  # noqa: PLC0415

    return notebook_piece(*given)


def _notebook_result(*given: Any) -> Any:
    from identifiability.report.results import notebook_result  # noqa: PLC0415

    return notebook_result(*given)


def _write_page(*given: Any) -> Any:
    from identifiability.report.results import write_result  # noqa: PLC0415

    return write_result(*given)


def _draw_figures(*given: Any) -> Any:
    from identifiability.report.results import draw_figures  # noqa: PLC0415

    return draw_figures(*given)


def _result_plots(*given: Any) -> Any:
    from identifiability.report.plot import Plots  # noqa: PLC0415

    return Plots(*given)


def _save_robot(*given: Any) -> Any:
    from identifiability.workflows.export.workflow import save_robot  # noqa: PLC0415

    return save_robot(*given)


# Lower rooms ask for these, which stand above them, or are extras that no room imports.
hand_down(
    notebook_piece=_notebook_piece,
    notebook_result=_notebook_result,
    draw_figures=_draw_figures,
    result_plots=_result_plots,
    write_page=_write_page,
    save_robot=_save_robot,
)


def __dir__() -> list[str]:
    return sorted(__all__)
