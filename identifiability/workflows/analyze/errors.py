"""Of one model what analyze and prune tell alike: its errors by joint and log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from identifiability.estimation.prediction import Prediction
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.robot import Robot

#: What is told of a log, and more of a joint: in N or N·m, and of the torque as it was measured.
OF_LOG = ("error", "error_validation")
OF_JOINT = (
    *("rms", "rms_validation", "error_raw", "error_raw_validation"),
    *("rms_raw", "rms_raw_validation"),
)


def tell_errors(
    robot: Robot,
    samples: Sequence[Prepared],
    validation: Sequence[Prepared],
    fitted: Prediction,
    unseen: Prediction,
) -> pd.DataFrame:
    """Return one row a joint and a log: its error fitted and held out; NaN where it has none.

    Of a joint it is over the joint's own scale (`torque_errors.joint_errors`), and in N or N·m
    (`rms`), of the torque that was fitted, low-passed with the columns where these were; `raw` is
    the same prediction against the torque as it was measured at the same samples.

    Parameters
    ----------
    robot : Robot
    samples, validation : sequences of Samples
        Logs that were fitted, and that were held out; without these the former were held out in
        turns.
    fitted, unseen : Prediction
        By the model alone, on the former and on what was held out.
    """
    both = (fitted, unseen)
    numbers = [p.joint_error()[:, 0] for p in both]
    for raw in (False, True):
        numbers += [p.joint_error(raw=True)[:, 0] for p in both] if raw else []
        numbers += [p.joint_rms(raw=raw)[:, 0] for p in both]
    each = zip(robot.joints, robot.torque_units, *map(np.ndarray.tolist, numbers), strict=True)
    rows = [("joint", *row) for row in each]
    blank = (np.nan,) * len(OF_JOINT)
    for k, s in enumerate(samples):
        crossed = np.nan if validation else float(unseen.relative_error(k)[0])
        rows.append(("log", s.name, "", float(fitted.relative_error(k)[0]), crossed, *blank))
    for k, s in enumerate(validation):
        error = float(unseen.relative_error(k)[0])
        rows.append(("log", s.name, "", np.nan, error, *blank))
    return pd.DataFrame(rows, columns=["of", "name", "unit", *OF_LOG, *OF_JOINT])


def errors_dict(errors: pd.DataFrame) -> dict[str, Any]:
    """Return the rows of `tell_errors` as plain values, those of joints and those of logs."""
    told = {"joint": ["name", "unit", *OF_LOG, *OF_JOINT], "log": ["name", *OF_LOG]}
    return {
        f"{kind}s": part[told[str(kind)]].rename(columns={"name": kind}).to_dict("records")
        for kind, part in errors.groupby("of")
    }


def state_raw(unseen: Prediction) -> str:
    """Return what torque the error is of, where it was low-passed; nothing where it was not.

    Parameters
    ----------
    unseen : Prediction
        By the model alone.
    """
    error, raw = unseen.relative_error()[0], unseen.relative_error(raw=True)[0]
    if not np.isfinite(raw) or np.isclose(error, raw, rtol=1e-6):
        return ""
    return (
        "This error is of torque that was low-passed like the model's columns; of the torque as "
        f"it was measured it is {100 * raw:.3g} %."
    )
