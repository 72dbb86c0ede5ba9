"""`TorquePrediction`: the torque of a fitted model along logs, beside the measured one."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.estimation.prediction import Prediction
from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.logs.tables import write_table
from identifiability.robot import Robot

#: Share of samples inside their 95 % interval below which something must have changed.
FEW_INSIDE = 0.8


@frozen(kw_only=True)
class TorquePrediction(Result):
    """Predicted torque along logs. `to_frame` and `write` give it away, sample by sample.

    Torque is *low-passed* like the columns of the model where derivatives were computed from
    filtered positions, and *raw* as it was measured; without a filter they are the same. The
    prediction has the band of the former.

    Attributes
    ----------
    robot : Robot
    model : str
        Name of the model.
    logs : tuple of str
    log : (N,) int
        Which log a sample comes from.
    t : (N,) [s]
    tau, raw : (N, n) [N·m or N]
        Measured torque, low-passed and as it was measured.
    predicted : (N, n) [N·m or N]
    mean, low, new : (N, n) [N·m or N]
        Half widths of the 95 % intervals of the mean (the model with its true values), of a new
        low-passed and of a new raw sample; infinite where the motion acts on what the fitted
        motion never showed.
    notes : mapping
        How each log was prepared.
    hints : tuple of str
    """

    schema: ClassVar[str] = "identifiability/prediction/1"

    robot: Robot
    model: str
    logs: tuple[str, ...]
    log: np.ndarray
    t: Array
    tau: Array
    raw: Array
    predicted: Array
    mean: Array
    low: Array
    new: Array
    notes: Mapping[str, tuple[str, ...]]
    hints: tuple[str, ...] = ()

    @cached_property
    def errors(self) -> tuple[Prediction, Prediction]:
        """Errors of low-passed and of raw torque."""
        times = [self.t[self.log == k] for k in range(len(self.logs))]
        low, raw = (
            Prediction.of(times, tau, self.predicted[:, :, None], self.log)
            for tau in (self.tau, self.raw)
        )
        return low, raw

    @property
    def error_ra(self) -> float:
        """ε_RA of low-passed torque."""
        return float(self.errors[0].relative_error()[0])

    @property
    def error_ra_raw(self) -> float:
        """ε_RA of raw torque."""
        return float(self.errors[1].relative_error()[0])

    @property
    def inside(self) -> Array:
        """Share of low-passed samples inside the interval of a new one, of each joint, (n,)."""
        share: Array = (np.abs(self.tau - self.predicted) <= self.low).mean(0)
        return share

    @property
    def unknown(self) -> Array:
        """Share of samples of each joint whose interval is infinite, (n,)."""
        share: Array = np.isinf(self.mean).mean(0)
        return share

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        raw, share = "", float(self.inside.mean())
        if not np.isclose(self.error_ra, self.error_ra_raw, rtol=1e-6):
            raw = f" ({100 * self.error_ra_raw:.3g} % of the torque as it was measured)"
        size = f"with an error of {100 * self.error_ra:.3g} %{raw}"
        if not np.isfinite(self.error_ra):
            size = "and does not vary"
        text = (
            f"The torque of {listing(self.logs, 4)} is predicted by the model '{self.model}' "
            f"{size}; {100 * share:.3g} % of the samples lie in the 95 % interval of a new one."
        )
        few = [j for j, s in zip(self.robot.joints, self.inside, strict=True) if s < FEW_INSIDE]
        if few:
            text += (
                f" Of {listing(few, 6)} too few do: a load, a temperature or the robot changed "
                "since the fitted logs, or this motion shows what the model leaves out (diagnose "
                "looks for it)."
            )
        new = [j for j, s in zip(self.robot.joints, self.unknown, strict=True) if s > 0]
        if new:
            text += (
                f" At {listing(new, 6)} this motion acts on parameters that the fitted motion "
                "never showed: nothing is known of the torque where the interval is infinite."
            )
        return " ".join((text, *self.hints))

    def to_frame(self) -> pd.DataFrame:
        """Return one row a sample: ``log``, ``t``, and of each joint nine columns [N·m or N].

        ``<joint>.tau`` and ``.tau_raw`` measured, ``.predicted``, ``.residual`` and
        ``.residual_raw`` measured less predicted; the 95 % interval of the mean from ``.mean_from``
        to ``.mean_to`` and those of new samples from ``.from`` to ``.to`` and ``.raw_from`` to
        ``.raw_to``.
        """
        columns: dict[str, Any] = {"log": np.array(self.logs)[self.log], "t": self.t}
        for k, joint in enumerate(self.robot.joints):
            tau, raw, found = self.tau[:, k], self.raw[:, k], self.predicted[:, k]
            own = {"tau": tau, "tau_raw": raw, "predicted": found}
            own |= {"residual": tau - found, "residual_raw": raw - found}
            for name, half in (("mean_", self.mean), ("", self.low), ("raw_", self.new)):
                own |= {f"{name}from": found - half[:, k], f"{name}to": found + half[:, k]}
            columns |= {f"{joint}.{what}": values for what, values in own.items()}
        return pd.DataFrame(columns)

    def error_frame(self) -> pd.DataFrame:
        """Return one row a joint: its error over its own scale, in N or N·m, and inside what."""
        low, raw = self.errors
        columns = {
            "joint": self.robot.joints,
            "unit": self.robot.torque_units,
            "error": low.joint_error()[:, 0],
            "rms": low.joint_rms()[:, 0],
            "error_raw": raw.joint_error()[:, 0],
            "rms_raw": raw.joint_rms()[:, 0],
            "inside": self.inside,
            "unknown": self.unknown,
        }
        return pd.DataFrame(columns)

    def parameters_frame(self) -> pd.DataFrame:
        """Return no parameters: a prediction has none of its own."""
        return pd.DataFrame()

    def to_dict(self) -> dict[str, Any]:
        """Return errors and shares in the documented JSON schema; samples go to `write`."""
        low = self.errors[0]
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "model": self.model,
            "statement": self.statement,
            "samples": len(self.t),
            "error_ra": self.error_ra,
            "error_ra_raw": self.error_ra_raw,
            "joints": self.error_frame().to_dict("records"),
            "logs": [
                {"log": name, "error": float(low.relative_error(k)[0])}
                for k, name in enumerate(self.logs)
            ],
            "preparation": {name: list(notes) for name, notes in self.notes.items()},
        }

    def write(self, path: str | Path) -> Path:
        """Write all samples as CSV or Parquet, whole or not at all.

        Raises
        ------
        OutputError
            If it cannot be written, or is none of these.
        """
        return write_table(path, self.to_frame())
