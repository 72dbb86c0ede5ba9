"""`TorquePrediction`: the torque of a fitted model along logs, beside the measured one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.estimation.prediction import Prediction
from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.result import Result, shown
from identifiability.foundation.values import frozen
from identifiability.logs.tables import write_table
from identifiability.robot import Robot

if TYPE_CHECKING:
    import pandas as pd


# Values and their covariance as labelled tables.


def correlation_of(covariance: Array) -> Array:
    """Return the correlation matrix of a covariance; NaN where a variance is zero or unknown."""
    sd = np.sqrt(np.where(np.diag(covariance) > 0, np.diag(covariance), np.nan))
    out: Array = covariance / np.outer(sd, sd)
    return out


def square_frame(matrix: Array, names: Iterable[Hashable]) -> pd.DataFrame:
    """Return a matrix (k, k) with the names of the parameters at its rows and columns."""
    import pandas as pd  # noqa: PLC0415 - only who wants a table pays for it

    return pd.DataFrame(matrix, index=list(names), columns=list(names))


class Covaries(ABC):
    """What knows parameters by name and how their values vary together."""

    @abstractmethod
    def covariance_frame(self) -> pd.DataFrame:
        """Return the covariance of the values with what the noise remembers, (k, k).

        Rows and columns are parameters; units are those of the two multiplied.
        """

    def correlation_frame(self) -> pd.DataFrame:
        """Return the correlation of the values, (k, k); NaN where a variance is zero or unknown.

        Near −1 the sum of two parameters is known better than either, near 1 their difference.
        """
        covariance = self.covariance_frame()
        return square_frame(correlation_of(covariance.to_numpy()), list(covariance.columns))


# `TorquePrediction`: the torque of a fitted model along logs, beside the measured one.


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
    measured : tuple of bool
        Which logs have torque; of the others only the prediction is known.
    t : (N,) [s]
    tau, raw : (N, n) [N·m or N]
        Measured torque, low-passed and as it was measured; NaN where it was not.
    predicted : (N, n) [N·m or N]
    mean, low, new : (N, n) [N·m or N]
        Half widths of the 95 % intervals of the mean (the model with its true values), of a new
        low-passed and of a new raw sample; infinite where the motion acts on what the fitted
        motion never showed.
    notes : mapping
        How each log was prepared.
    hints : tuple of str
    origin : str
        Name of the file of the result that predicts.
    onward : (str, str)
        What it is exported for, and to.
    """

    schema: ClassVar[str] = "identifiability/prediction/1"

    robot: Robot
    model: str
    logs: tuple[str, ...]
    log: np.ndarray
    measured: tuple[bool, ...]
    t: Array
    tau: Array
    raw: Array
    predicted: Array
    mean: Array
    low: Array
    new: Array
    data: np.ndarray
    notes: Mapping[str, tuple[str, ...]]
    hints: tuple[str, ...] = ()
    origin: str = "result.json"
    onward: tuple[str, str] = ("Take its parameters along:", "fitted.json")

    @cached_property
    def errors(self) -> tuple[Prediction, Prediction] | None:
        """Errors of low-passed and of raw torque in the logs that have torque; None without."""
        if not any(self.measured):
            return None
        known = np.flatnonzero(self.measured)
        rows = np.isin(self.log, known)
        log = np.searchsorted(known, self.log[rows])
        times = [self.t[self.log == k] for k in known]
        low, raw = (
            Prediction.of(times, tau[rows], self.predicted[rows, :, None], log, self.data[rows])
            for tau in (self.tau, self.raw)
        )
        return low, raw

    @property
    def error_ra(self) -> float:
        """ε_RA of low-passed torque; nan where none was measured."""
        return float("nan") if self.errors is None else float(self.errors[0].relative_error()[0])

    @property
    def error_ra_raw(self) -> float:
        """ε_RA of raw torque; nan where none was measured."""
        return float("nan") if self.errors is None else float(self.errors[1].relative_error()[0])

    @property
    def inside(self) -> Array:
        """Share of low-passed samples inside the interval of a new one, of each joint, (n,)."""
        rows = np.isin(self.log, np.flatnonzero(self.measured))
        if not rows.any():
            return np.full(len(self.robot.joints), np.nan)
        data = self.data[rows]
        hit = (np.abs(self.tau - self.predicted) <= self.low)[rows] & data
        share: Array = hit.sum(0) / np.maximum(data.sum(0), 1)
        return share

    @property
    def unknown(self) -> Array:
        """Share of samples of each joint whose interval is infinite, (n,)."""
        share: Array = np.isinf(self.mean).mean(0)
        return share

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        pairs = list(zip(self.logs, self.measured, strict=True))
        known, silent = ([n for n, m in pairs if m is kind] for kind in (True, False))
        if not known:
            text = (
                f"The torque of {listing(self.logs, 4)} is predicted by the model "
                f"'{self.model}'; none was measured, so nothing is known of its error."
            )
            return " ".join((text, *self._unknown_words, *self.hints))
        raw, share = "", float(self.inside.mean())
        if not np.isclose(self.error_ra, self.error_ra_raw, rtol=1e-6):
            raw = f" ({100 * self.error_ra_raw:.3g} % of the torque as it was measured)"
        size = f"with an error of {100 * self.error_ra:.3g} %{raw}"
        if not np.isfinite(self.error_ra):
            size = "and does not vary"
        text = (
            f"The torque of {listing(known, 4)} is predicted by the model '{self.model}' {size}; "
            f"{100 * share:.3g} % of the samples lie in the 95 % interval of a new one."
        )
        few = [j for j, s in zip(self.robot.joints, self.inside, strict=True) if s < FEW_INSIDE]
        if few:
            text += (
                f" Of {listing(few, 6)} too few do: a load, a temperature or the robot changed "
                "since the fitted logs, or this motion shows what the model leaves out (diagnose "
                "looks for it)."
            )
        if silent:
            text += f" {listing(silent, 4)} has no torque: it is predicted alone."
        return " ".join((text, *self._unknown_words, *self.hints))

    @property
    def _unknown_words(self) -> tuple[str, ...]:
        new = [j for j, s in zip(self.robot.joints, self.unknown, strict=True) if s > 0]
        if not new:
            return ()
        return (
            f"At {listing(new, 6)} this motion acts on parameters that the fitted motion never "
            "showed: nothing is known of the torque where the interval is infinite.",
        )

    def to_frame(self) -> pd.DataFrame:
        """Return one row a sample: ``log``, ``t``, and of each joint nine columns [N·m or N].

        ``<joint>.tau`` and ``.tau_raw`` measured (empty where it was not), ``.predicted``,
        ``.residual`` and ``.residual_raw`` measured less predicted; the 95 % interval of the mean
        from ``.mean_from`` to ``.mean_to`` and those of new samples from ``.from`` to ``.to`` and
        ``.raw_from`` to ``.raw_to``.
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

    def _repr_html_(self) -> str:
        return shown(self.statement, self.error_frame())

    def error_frame(self) -> pd.DataFrame:
        """Return one row a joint: its error over its own scale, in N or N·m, and inside what."""
        columns: dict[str, Any] = {"joint": self.robot.joints}
        columns["unit"] = self.robot.torque_units
        for name, part in zip(("", "_raw"), self.errors or (None, None), strict=True):
            nothing = np.full(len(self.robot.joints), np.nan)
            columns |= {
                f"error{name}": nothing if part is None else part.joint_error()[:, 0],
                f"rms{name}": nothing if part is None else part.joint_rms()[:, 0],
            }
        return pd.DataFrame({**columns, "inside": self.inside, "unknown": self.unknown})

    def parameters_frame(self) -> pd.DataFrame:
        """Return no parameters: a prediction has none of its own."""
        return pd.DataFrame()

    def to_dict(self) -> dict[str, Any]:
        """Return errors and shares in the documented JSON schema; samples go to `write`."""
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
                {"log": name, "error": error}
                for name, error in zip(self.logs, self._errors_by_log(), strict=True)
            ],
            "preparation": {name: list(notes) for name, notes in self.notes.items()},
        }

    def _errors_by_log(self) -> list[float]:
        """Return ε_RA of low-passed torque of each log; nan where none was measured."""
        places = np.cumsum(self.measured) - 1
        return [
            float(self.errors[0].relative_error(int(at))[0])
            if self.errors is not None and known
            else float("nan")
            for at, known in zip(places, self.measured, strict=True)
        ]

    def write(self, path: str | Path) -> Path:
        """Write all samples as CSV or Parquet, whole or not at all.

        Raises
        ------
        OutputError
            If it cannot be written, or is none of these.
        """
        return write_table(path, self.to_frame())
