"""Of one model what analyze and prune tell alike: errors by joint and log, its real robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from identifiability.estimation.prediction import Prediction
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.physical.mass import real_robot_dict
from identifiability.robot import Robot
from identifiability.workflows.analyze.assessment import RungResult


def tell_errors(
    joints: Sequence[str],
    samples: Sequence[Prepared],
    validation: Sequence[Prepared],
    fitted: Prediction,
    unseen: Prediction,
) -> pd.DataFrame:
    """Return one row a joint and a log: its error fitted and held out; NaN where it has none.

    Parameters
    ----------
    joints : sequence of str
        The n actuated ones.
    samples, validation : sequences of Samples
        Logs that were fitted, and that were held out; without these the former were held out in
        turns.
    fitted, unseen : Prediction
        By the model alone, on the former and on what was held out.
    """
    parts = zip(joints, fitted.joint_error(), unseen.joint_error(), strict=True)
    rows = [("joint", name, float(a[0]), float(b[0])) for name, a, b in parts]
    for k, s in enumerate(samples):
        crossed = float("nan") if validation else float(unseen.relative_error(k)[0])
        rows.append(("log", s.name, float(fitted.relative_error(k)[0]), crossed))
    for k, s in enumerate(validation):
        rows.append(("log", s.name, float("nan"), float(unseen.relative_error(k)[0])))
    return pd.DataFrame(rows, columns=["of", "name", "error", "error_validation"])


def errors_dict(errors: pd.DataFrame) -> dict[str, Any]:
    """Return the rows of `tell_errors` as plain values, those of joints and those of logs."""
    return {
        f"{kind}s": part.drop(columns="of").rename(columns={"name": kind}).to_dict("records")
        for kind, part in errors.groupby("of")
    }


def physical_dict(robot: Robot, result: RungResult, shapes: Mapping[str, float]) -> dict[str, Any]:
    """Return the nearest real robot of a model as plain values, as `export` reads them."""
    real, errors = result.physical, (result.error_ra_real, result.error_ra_file)
    return {
        "feasible": result.feasible,
        "margin": result.margin,
        "infeasible": list(result.infeasible),
        "error_ra_validation": result.error_ra_physical,
        **real_robot_dict(robot, real.parameters(), errors, shapes, real.cad_weight),
    }
