"""Trials: noise drawn again and again, the four models fitted each time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from threadpoolctl import threadpool_limits

from identifiability.estimation.estimate import estimate
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.prediction import Prediction, predict
from identifiability.foundation.engines import Engine, Serial
from identifiability.foundation.names import Array
from identifiability.logs.prepare import Dataset
from identifiability.regression.information import Information, gather_information
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import Regression
from identifiability.robot import Motion
from paper_study.readings import READINGS, measured_motion
from paper_study.subject import SHIPPED, Subject, check_robot, exact_log, load_subject, robot_digest

Progress = Callable[[str, float], None]

#: Trials that one item of an engine does; small enough for an even load and a moving bar.
BATCH = 5


@dataclass(frozen=True)
class Case:
    """The conditions of a trial.

    Attributes
    ----------
    trajectory : str
    samples : int
    discrepancy : {"", "stribeck", "hinges", "actuators"}
        What the robot has and the models leave out.
    reading : str
        Of the noise, a key of `READINGS`.
    delta, eta : float
        Noise on the motion and on the torque.
    robot : str
        Shipped name or file.
    """

    trajectory: str
    samples: int = 750
    discrepancy: str = ""
    reading: str = "per sample"
    delta: float = 0.04
    eta: float = 0.05
    robot: str = SHIPPED


@dataclass(frozen=True)
class Trial:
    """Models fitted to one draw of the noise; arrays have one entry a model.

    Attributes
    ----------
    error_ra : (m,)
        ε_RA, Eq. 18, as a fraction.
    error_exact : (m,)
        The same against the torque before noise.
    error_av : (m,)
        ε_AV, Eq. 19, over the properly identified parameters, as a fraction.
    identified : (m,) int
        Parameters that pass the 10× rule.
    feasible : (m,) bool
        Whether the inertias of rows 3, 16, 22 and all friction are positive.
    sizes : (m,) int
    values, sigma_percent, paper_rule : tuples of (k_m,)
        Of each model's parameters.
    dropped : int
        Samples whose loops do not close.
    """

    error_ra: Array
    error_exact: Array
    error_av: Array
    identified: np.ndarray
    feasible: np.ndarray
    sizes: np.ndarray
    values: tuple[Array, ...]
    sigma_percent: tuple[Array, ...]
    paper_rule: tuple[np.ndarray, ...]
    dropped: int


def fit_models(
    subject: Subject, samples: Sequence[Dataset]
) -> tuple[Regression, Information, list[Estimate]]:
    """Fit every model by ordinary least squares, as the paper does."""
    regression = subject.structure.regression(samples)
    information = gather_information(regression)
    return regression, information, [estimate(r.reduce(information), "ols") for r in subject.models]


def expand_fits(subject: Subject, fits: Sequence[Estimate]) -> Array:
    """Return the base parameters of every model, (b, m)."""
    pairs = zip(subject.models, fits, strict=True)
    return np.stack([submodel.expand(fit.value) for submodel, fit in pairs], 1)


def physically_possible(submodel: Submodel, value: Array) -> bool:
    """Return whether inertias of rows 3, 16, 22 and friction are positive, the paper's list."""
    asked = [
        n and not c.endswith(".Jr")
        for n, c in zip(submodel.nonnegative, submodel.columns, strict=True)
    ]
    return bool((value[np.array(asked)] > 0).all())


def as_samples(name: str, motion: Motion, tau: Array) -> Dataset:
    """Return motion and the torque at its samples without any further preparation."""
    return Dataset(name, motion, tau[motion.kept], None, (), "")


@cache
def _subject(robot: str, discrepancy: str) -> Subject:
    whole = load_subject(robot)
    return whole.without_actuators() if discrepancy == "actuators" else whole


def parameter_error(value: Array, exact: Array, chosen: Sequence[bool] | np.ndarray) -> float:
    """Return ε_AV over the chosen parameters, ``mean |φ - φ̂|/|φ|`` [Díaz 2010, Eq. 19].

    The paper averages over all parameters; with exact values of zero that cannot be, and its
    numbers fit the mean over the properly identified ones.
    """
    used = np.asarray(chosen, bool) & (np.abs(exact) > 1e-12 * np.abs(exact).max(initial=0.0))
    if not used.any():
        return float("nan")
    return float(np.mean(np.abs((value[used] - exact[used]) / exact[used])))


def run_trial(case: Case, seed: int) -> Trial:
    """Draw the noise of a seed, fit the models, and judge them."""
    subject = _subject(case.robot, case.discrepancy)
    kind = "" if case.discrepancy == "actuators" else case.discrepancy
    exact = exact_log(case.robot, case.trajectory, case.samples, kind)
    reading = READINGS[case.reading]
    rng = np.random.default_rng([seed, int(case.trajectory), case.samples])
    with threadpool_limits(1, "blas"):
        noisy = reading.disturb(exact, case.delta, case.eta, rng)
        motion = measured_motion(subject, exact, noisy, reading)
        samples = as_samples(case.trajectory, motion, noisy.tau)
        regression, _, fits = fit_models(subject, [samples])
        prediction = predict(regression, expand_fits(subject, fits))
        truth = Prediction.of(
            prediction.t, exact.tau[motion.kept], prediction.predicted, prediction.log
        )
    pairs = list(zip(fits, subject.exact, strict=True))
    return Trial(
        prediction.relative_error(),
        truth.relative_error(),
        np.array([parameter_error(f.value, x, f.paper_rule) for f, x in pairs]),
        np.array([int(f.paper_rule.sum()) for f in fits]),
        np.array(
            [physically_possible(r, f.value) for r, f in zip(subject.models, fits, strict=True)]
        ),
        np.array([len(r) for r in subject.models]),
        tuple(f.value for f in fits),
        tuple(f.sigma_percent for f in fits),
        tuple(f.paper_rule for f in fits),
        len(motion.dropped),
    )


_done: dict[tuple[Case, int], Trial] = {}


def run_trials(
    cases: Iterable[Case],
    seeds: int,
    engine: Engine | None = None,
    progress: Progress | None = None,
) -> dict[Case, list[Trial]]:
    """Return the trials of seeds 0, 1, … of every case; finished trials are not run again.

    Parameters
    ----------
    cases : iterable of Case
    seeds : int
        Trials a case; a case without noise gets one.
    engine : Engine, optional
        Where they run; by default here.
    progress : callable(str, float), optional
    """
    wanted = {c: 1 if c.delta == c.eta == 0 else seeds for c in cases}
    items = [
        batch
        for case, count in wanted.items()
        for start in range(0, count, BATCH)
        if (batch := _missing(case, range(start, min(start + BATCH, count))))
    ]
    robots = tuple(sorted({(c.robot, robot_digest(c.robot)) for c in wanted}))
    total = sum(map(len, items))

    def say(done: int, of: int) -> None:
        if progress:
            progress(f"{total} trials", done / of)

    results = (engine or Serial()).map(partial(run_batch, robots), items, progress=say)
    for batch, trials in zip(items, results, strict=True):
        _done.update(zip(batch, trials, strict=True))
    return {c: [_done[c, s] for s in range(n)] for c, n in wanted.items()}


def forget_trials() -> None:
    """Forget all trials that were done in this process."""
    _done.clear()


def _missing(case: Case, seeds: Iterable[int]) -> tuple[tuple[Case, int], ...]:
    return tuple((case, s) for s in seeds if (case, s) not in _done)


def run_batch(
    robots: tuple[tuple[str, str], ...], batch: Sequence[tuple[Case, int]]
) -> list[Trial]:
    """Run some trials.

    Parameters
    ----------
    robots : tuple of (name, digest)
        What the files of the robots hold; see `check_robot`.
    batch : sequence of (Case, seed)
    """
    for name, digest in robots:
        check_robot(name, digest)
    return [run_trial(case, seed) for case, seed in batch]


def variants(case: Case, **changes: Sequence[object]) -> list[Case]:
    """Return a case with every combination of some changes."""
    out = [case]
    for name, options in changes.items():
        out = [replace(c, **{name: option}) for c in out for option in options]
    return out


def stack(trials: Sequence[Trial], name: str) -> Array:
    """Return an attribute of all trials, (trials, m)."""
    return np.array([getattr(t, name) for t in trials], float)
