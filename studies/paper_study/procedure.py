"""The paper's experimental procedure, from repeated periods to fitted models.

Periods are averaged, control actions filtered by a second-order Butterworth, positions fitted by a
Fourier series that is differentiated analytically; 750 points, ordinary least squares.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import signal

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.prediction import Prediction, predict
from identifiability.foundation.names import Array
from identifiability.logs.prepare import Dataset
from identifiability.robot import complete_motion
from paper_study.command import Options
from paper_study.monte_carlo import as_samples, expand_fits, fit_models, physically_possible
from paper_study.stand_in import CONTROL_STEP, Record, record_all
from paper_study.subject import TRAJECTORIES, Subject, fit_periodic, load_subject

#: Cut-off of the Butterworth low-pass [Hz]; the paper does not say its own.
CUTOFF = 10.0

#: Harmonics of the fitted series: those of the trajectories.
HARMONICS = 5

#: Recorded periods.
PERIODS = 5


@dataclass(frozen=True)
class Fitted:
    """Models fitted to one trajectory of the stand-in.

    Attributes
    ----------
    samples : Dataset
    fits : list of Estimate
        Of Models 1 to 4.
    values : (b, m)
        Base parameters of each.
    prediction : Prediction
        On the same trajectory.
    possible : list of bool
    """

    samples: Dataset
    fits: list[Estimate]
    values: Array
    prediction: Prediction
    possible: list[bool]

    @property
    def error_ra(self) -> Array:
        """ε_RA of each model as a fraction, (m,)."""
        return self.prediction.relative_error()

    @property
    def identified(self) -> np.ndarray:
        """Parameters that pass the 10× rule, (m,)."""
        return np.array([int(f.paper_rule.sum()) for f in self.fits])


def filter_periodic(x: Array, cutoff: float) -> Array:
    """Return a period (N, n) low-passed forwards and backwards, without ends."""
    sos = signal.butter(2, cutoff, fs=1 / CONTROL_STEP, output="sos")
    three = np.concatenate([x, x, x])
    middle: Array = signal.sosfiltfilt(sos, three, axis=0)[len(x) : 2 * len(x)]
    return middle


def process(
    subject: Subject, record: Record, cutoff: float = CUTOFF, harmonics: int = HARMONICS
) -> Dataset:
    """Turn the periods of a record into 750 points of motion and force."""
    period = len(record.t) * CONTROL_STEP
    fitted = fit_periodic(record.t, record.q.mean(0), period, harmonics)
    motion = complete_motion(subject.robot, record.t, *fitted)
    force = filter_periodic(record.force.mean(0), cutoff)
    return as_samples(f"stand-in {record.trajectory}", motion, force)


def fit_record(subject: Subject, samples: Dataset) -> Fitted:
    """Fit Models 1 to 4 to one record."""
    regression, _, fits = fit_models(subject, [samples])
    values = expand_fits(subject, fits)
    possible = [physically_possible(r, f.value) for r, f in zip(subject.models, fits, strict=True)]
    return Fitted(samples, fits, values, predict(regression, values), possible)


def predict_record(subject: Subject, samples: Dataset, values: Array) -> Prediction:
    """Predict the forces of a record with base parameters (b, m)."""
    regression = subject.structure.regression([samples])
    return predict(regression, values)


def records(options: Options) -> Mapping[str, Record]:
    """Return the stand-in's records along the three trajectories."""
    options.say("stand-in", 0.1)
    return record_all(options.robot, TRAJECTORIES, 2 if options.quick else PERIODS, options.engine)


def fitted_records(options: Options) -> dict[str, Fitted]:
    """Return the models fitted to each trajectory of the stand-in."""
    subject = load_subject(options.robot)
    found = records(options)
    return {name: fit_record(subject, process(subject, found[name])) for name in TRAJECTORIES}
