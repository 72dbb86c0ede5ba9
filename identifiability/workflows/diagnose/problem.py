"""`Problem`: the diagnosed model, prior knowledge of its values, and the rows of its residual."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import orth

from identifiability.effects.functions import has_session
from identifiability.estimation.differences import Known
from identifiability.estimation.estimate import Outliers, estimate_noise, find_estimator, with_known
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.groups import Excerpt
from identifiability.estimation.mixed_model import Terms
from identifiability.estimation.prediction import Prediction, change_interval
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.findings import phrase
from identifiability.foundation.linalg import ROUNDOFF, rms_of
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.rounding import percent
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Dataset, Preparation, Samples
from identifiability.logs.prepare.instruments import add_instrument
from identifiability.physical.cad_prior import WEAK, state_rows
from identifiability.physical.feasibility import PhysicalResult, choose_prior, find_nearest
from identifiability.physical.fitted_model import FittedModel
from identifiability.quality.hints import weigh_rows
from identifiability.regression.information import Information, gather_information
from identifiability.regression.reduction import LadderEntry, Submodel, full_model
from identifiability.regression.regression import Regression
from identifiability.regression.structure import OfStructure, Structure
from identifiability.robot import Robot
from identifiability.workflows.analyze.ladder import hold_folds
from identifiability.workflows.predict import Fit, Predicts, find_fit, read_fit


@frozen
class Recommended:
    """A model and its values to predict with.

    Attributes
    ----------
    reduction : Submodel
        With k parameters, as the ladder states it.
    submodel : Submodel
        The same, with the parameters fixed that it omits but physical bodies need.
    values, base : (k,), (b,)
        Of its parameters, and base parameters.
    """

    reduction: Submodel
    submodel: Submodel
    values: Array
    base: Array

    @staticmethod
    def of(
        submodel: Submodel, estimate: Array, robot: PhysicalResult, real: Submodel | None
    ) -> Recommended:
        """Return the values of the physical robot, or the estimate where its model is None."""
        if real is None:
            return Recommended(submodel, submodel, estimate, submodel.expand(estimate))
        return Recommended(submodel, real, robot.value, robot.base)

    @staticmethod
    def of_base(structure: Structure, base: Array) -> Recommended:
        """Return the model of all base parameters with given values."""
        full = full_model(structure.base)
        return Recommended(full, full, base, base)


@frozen
class Problem(OfStructure):
    """The diagnosed model and its logs.

    Attributes
    ----------
    structure : Structure
        The robot under the model that is diagnosed.
    samples, validation : tuple of Dataset
        Fitted and unseen motion, on which errors are stated.
    known : KnownValues
        Prior knowledge of the model's values.
    fixed : bool
        Whether the model keeps these values.
    seed : int
    verified_on : str
        The unseen motion in words, to follow "on".
    preparation : Preparation
        Preparation of the logs, with one cut-off.
    changes : tuple of Change
        Changes in the middle of fitted logs. The time of each change was left out.
    restored : bool
        Whether its rows are fitted in spite of that, because unseen motion refutes the values
        without them.
    commanded : bool
        Whether servos made the torque of commands.
    excerpt, unseen_excerpt : tuple of Dataset
        Fewer rows of fitted and unseen motion for the search of effects; empty if all rows are
        used.
    under : Structure or None
        The robot under the model that predicts without the missing effects, if that is another.
    recommended : Recommended or None
        The values that `analyze` recommends for it; None where values are known.
    ladder : LadderEntry or None
        The models that `analyze` compares; None where a model was given.
    columns : tuple of (Structure, Regression)
        Columns along the samples that were computed already.
    found : tuple of Term
        Missing effects that the case has found; the search for others begins with them.
    """

    structure: Structure
    samples: Samples
    known: KnownValues
    validation: Samples = ()
    fixed: bool = False
    seed: int = 0
    verified_on: str = ""
    preparation: Preparation = Preparation()
    changes: tuple[Any, ...] = ()
    restored: bool = False
    commanded: bool = False
    excerpt: Samples = ()
    unseen_excerpt: Samples = ()
    under: Structure | None = None
    recommended: Recommended | None = None
    ladder: LadderEntry | None = None
    columns: tuple[tuple[Structure, Regression], ...] = ()
    found: Terms = ()

    @property
    def left_out(self) -> tuple[Any, ...]:
        """Changes whose rows are not fitted."""
        return () if self.restored else self.changes

    def regression(self, structure: Structure, samples: Samples | None = None) -> Regression:
        """Return the columns of a structure along samples, by default the fitted ones.

        Structures with the same groupings share them. Effects that are tried and depend on loads
        are computed for the robot of the regression, so its loads are those of the structure.
        """
        samples = self.samples if samples is None else samples
        for known, regression in self.columns:
            if known.base is structure.base and regression.samples is samples:
                return regression.for_robot(structure.robot)
        return structure.regression(samples)

    @property
    def plain(self) -> Structure:
        """The robot under the model that predicts: missing effects are added to it."""
        return self.under or self.structure


#: Options for the values that a diagnosis keeps.
Given = bool | float | str | Path | Fit | Predicts


@frozen(kw_only=True)
class KnownValues(Known):
    """Base parameters with prior knowledge from sources other than the logs.

    Attributes
    ----------
    words : str
        Description of the values, as the beginning of a sentence: "the values of fit.json, with
        their errors,".
    share : float
        Share within which bodies equal the file's; 0 without such knowledge.
    hints : tuple of str
        Differences from the inputs with which a result was made, whose values these are.
    """

    words: str
    share: float = 0.0
    hints: Strings = ()

    @property
    def root(self) -> Array:
        """Rows of the prior knowledge of the coordinates, each of variance 1."""
        return np.diag(np.sqrt(self.precision))[self.precision > 0]

    @property
    def tells_nothing(self) -> bool:
        """Whether values are those of the logs alone."""
        return not (self.precision.any() or self.base.any())

    @property
    def hint(self) -> str:
        """A sentence on the values that are kept near the file."""
        return phrase("kept", "near", share=self.share)


def know_nothing(structure: Structure) -> KnownValues:
    """Return no prior knowledge, except of random parameters with the variance of the model."""
    b = len(structure.base.names)
    random = structure.model.random
    own = Known.nothing(np.eye(b), np.zeros(b))
    if random:
        sd = np.array([random.get(name, np.inf) for name in structure.columns])
        open_ = np.isinf(sd)
        covariance = np.diag(np.where(open_, 0.0, sd) ** 2)
        directions = np.eye(len(sd))[:, open_]
        own = Known.of(np.zeros(b), structure.G, covariance, directions)
        at = own.directions.any(0)
        own = replace(own, directions=own.directions[:, at], precision=own.precision[at])
    return KnownValues(**vars(own), words="the refitted model")


def know_file(structure: Structure) -> KnownValues:
    """Return the values of the robot file as exact."""
    base = structure.nominal_base
    own = Known.nothing(np.empty((len(base), 0)), base)
    return KnownValues(**vars(own), words="the robot file's own values")


def know_share(share: float, structure: Structure, *, refitted: bool = False) -> KnownValues:
    """Return the robot file's values as known within a share, or as its sidecar states.

    Parameters
    ----------
    share : float
        A relative standard deviation. It holds for mass, centre and inertia of a body together
        (`state_rows`), and for any other value that the file states: what is zero there is free.
    structure : Structure
    refitted : bool
        Whether parameters that only joints determine have no prior. Files of commanded robots do
        not state them.

    Raises
    ------
    IdentifiabilityError
        If it is no share.
    """
    if not 0 < share <= 1:
        raise IdentifiabilityError(phrase("kept", "share", share=share))
    rows, aim = state_rows(structure, share)
    if not refitted:
        nominal = structure.nominal
        own = np.flatnonzero(~rows.any(0) & (nominal != 0))
        sd = share * np.abs(nominal[own])
        alone = np.eye(len(nominal))[own]
        rows = np.vstack([rows, alone / sd[:, None]])
        aim = np.append(aim, nominal[own] / sd)
    words = f"the robot file's values, each within {percent(share)},"
    words = "the refitted model" if refitted else words
    return KnownValues(**vars(_know_rows(rows, aim, structure)), words=words, share=share)


def _know_rows(rows: Array, aim: Array, structure: Structure) -> Known:
    """Return the knowledge of the base parameters from unit-variance rows of the standard ones."""
    size = np.linalg.norm(rows, axis=0)
    size = np.where(size > 0, size, 1.0)
    scaled = rows / size
    G = structure.G / size
    _, s, Vt = np.linalg.svd(scaled)
    rank = int(np.sum(s > ROUNDOFF * s.max(initial=0.0)))
    moved = np.linalg.pinv(scaled) @ (aim - rows @ structure.nominal)
    base = structure.G @ (structure.nominal + moved)
    spread = G @ (Vt[:rank].T / s[:rank])
    unit = np.eye(len(base))
    unseen = G @ Vt[rank:].T
    return Known.of(base, unit, spread @ spread.T, orth(unseen))


def read_given(given: Given, robot: Robot) -> tuple[Fit | None, str]:
    """Return the fit whose values are kept, or None, and its name in messages."""
    if isinstance(given, str | Path):
        return read_fit(given, robot), Path(given).name
    if isinstance(given, Predicts):
        return find_fit(given, robot), "the result given"
    return None, ""


def know_fit(fit: Fit, structure: Structure, name: str) -> KnownValues:
    """Return the values of a fit with their covariance, that of the unpruned model.

    Parameters that a reduced model omits are not known to be zero. They are only too small to be
    seen.

    Parameters
    ----------
    fit : Fit
    structure : Structure
        The robot under the model that is diagnosed.
    name : str
        Its name in messages.

    Raises
    ------
    IdentifiabilityError
        If the fit is of another model.
    """
    if fit.structure.base.names != structure.base.names:
        models = {"kept": fit.structure.model.texts, "diagnosed": structure.model.texts}
        raise IdentifiabilityError(phrase("kept", "other", name=name, **models))
    own = Known.of(fit.base, np.eye(len(fit.base)), fit.base_covariance, fit.base_unknown)
    words = f"the values of {name}, with their errors,"
    return KnownValues(**vars(own), words=words, hints=fit.hints)


@frozen
class ResidualRows:
    """Rows of one or more logs, after decimation.

    Attributes
    ----------
    seen : Excerpt
        Rows minus the torque of known parameters, with the columns of parameters that are not known
        exactly.
    samples : tuple of Dataset
    measured : (N, n) [N·m or N]
        Measured torque, low-passed like the columns.
    """

    seen: Excerpt
    samples: Samples
    measured: Array

    @staticmethod
    def of(regression: Regression, known: KnownValues) -> ResidualRows:
        """Return the rows of some logs minus the torque of known parameters.

        Parameters
        ----------
        regression : Regression
            Columns of the base parameters along these logs.
        known : KnownValues
            Prior knowledge of the values.
        """
        samples = regression.samples
        every = sum(s.outputs for s in samples)
        seen = Excerpt.of(regression, (every, 1, every))
        torque = seen.y
        X = seen.X
        seen = replace(seen, X=X @ known.directions, y=torque - X @ known.base)
        return ResidualRows(seen, tuple(samples), torque)

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.measured)

    @cached_property
    def states(self) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration of the actuated joints, (N, n) each."""
        parts = []
        for s in self.samples:
            at = s.output_times()
            m = s.motion
            both = np.concatenate([m.actuated_q, m.actuated_v, m.actuated_a], axis=1)
            series = [np.interp(at, m.t, x) for x in both.T]
            parts.append(np.stack(series, axis=1))
        q, dq, ddq = np.split(np.concatenate(parts), 3, axis=1)
        return q, dq, ddq

    @cached_property
    def elapsed(self) -> Array:
        """Time since the first row of each log, (N,) [s]."""
        first = np.array([s.motion.first for s in self.samples])
        return self.seen.t - first[self.seen.log]

    def along(self, j: int) -> dict[str, Array]:
        """Return variables that the residual of joint j may depend on, each (N,)."""
        q, dq, ddq = (x[:, j] for x in self.states)
        out = {"velocity": dq, "position": q, "acceleration": ddq, "load": self.measured[:, j]}
        out |= {"time": self.elapsed, "log": self.seen.log}
        starts = [s.motion.start or 0.0 for s in self.samples]
        if has_session([s.motion for s in self.samples]):
            out["session"] = self.seen.t + np.array(starts)[self.seen.log]
        return out


#: Bins over which the residual is averaged.
BINS = 12


def change_of(
    gap: Prediction, first: int, second: int, rng: np.random.Generator
) -> tuple[float, float]:
    """Return the 95 % interval of the change of ε_RA from one model to another."""
    both = gap.residual[:, :, [first, second]]
    return change_interval(np.abs(both), gap.apart(), rng)


#: Weighted residual rows, the fit of their columns, a sentence on outliers, and the outliers.
WeighedFit = tuple[Information, Estimate, str, Outliers | None]


def weigh_fit(robot: Robot, samples: Sequence[Dataset], information: Information) -> WeighedFit:
    """Return rows weighted by their noise, and the fit of their columns, as in `analyze`."""
    estimator = replace(find_estimator("wls"), instruments=information.instrumented)
    weighed, said, outliers = weigh_rows(robot.joints, samples, information, estimator)
    return weighed, estimate_noise(estimator, weighed).fit(weighed), said, outliers


def fit_structure(structure: Structure, regression: Regression) -> WeighedFit:
    """Return the same for the base parameters of a model, random ones with its variance."""
    information = with_known(gather_information(regression), structure.known)
    return weigh_fit(structure.robot, regression.samples, information)


def nearest_robot(
    structure: Structure,
    information: Information,
    fit: Estimate,
    cad_weight: float | None = None,
) -> PhysicalResult:
    """Return the physical robot nearest to a fit.

    Parameters
    ----------
    structure : Structure
    information : Information
        That was fitted.
    fit : Estimate
    cad_weight : float, optional
        Weight of the robot file; by default parts of the logs choose it.
    """
    model = FittedModel(structure, full_model(structure.base), information, information, fit)
    if cad_weight is None:
        held_out, short = hold_folds(information, fit.estimator)
        chosen = None if short else choose_prior(model, held_out)
        cad_weight = WEAK if chosen is None else chosen.weight
    return find_nearest(model, cad_weight)


@frozen
class Discrepancy:
    """Size and dependence of the residual of a joint.

    Attributes
    ----------
    joint : str
    rms : float [N·m or N]
    share : float
        Of the measured torque's rms.
    explained : mapping
        Adjusted share of the residual's variance explained by its means over bins. The bins are of
        velocity, position, acceleration, load, time, log and session.
    """

    joint: str
    rms: float
    share: float
    explained: dict[str, float]


def find_discrepancies(
    rows: ResidualRows, residual: Array, joints: Sequence[str]
) -> Iterator[Discrepancy]:
    """Yield size and dependence of the residual (N, n) of each joint."""
    for j, joint in enumerate(joints):
        data = rows.seen.data[:, j]
        r = residual[data, j]
        if not len(r):
            yield Discrepancy(joint, 0.0, 0.0, {})
            continue
        explained = {name: explained_share(x[data], r) for name, x in rows.along(j).items()}
        measured = rows.measured[data, j]
        size, whole = (float(rms_of(x)) for x in (r, measured))
        yield Discrepancy(joint, size, size / (whole or 1.0), explained)


def explained_share(x: Array, r: Array) -> float:
    """Return the share of the variance of r that its means over bins of x explain, adjusted."""
    below = np.searchsorted(np.sort(x), x)
    _, bins = np.unique(below * BINS // len(x), return_inverse=True)
    own = r - r.mean()
    k = int(bins.max()) + 1
    left = own - (np.bincount(bins, own) / np.bincount(bins))[bins]
    if not own.any() or len(r) <= k or k < 2:
        return 0.0
    left_share = (left @ left) / (own @ own)
    share = 1 - left_share * (len(r) - 1) / (len(r) - k)
    return float(np.clip(share, 0.0, 1.0))


# Samples of commanded robots along the motion of their rollouts.


def along_rollouts(
    structure: Structure,
    samples: Sequence[Dataset],
    logs: Sequence[Log],
    rolled: Any,
) -> Samples:
    """Return samples of logs of commands along the motion of their rollouts.

    Torque from commands and the columns use the same positions, so encoder steps are in both.
    Columns for which no fit was calibrated then correlate with these steps. The returned motion is
    therefore the rollout, which has no steps and differs little from the measured motion. Its
    torque is corrected by the change of the rolled-out robot's torque between the two motions.

    Parameters
    ----------
    structure : Structure
    samples : sequence of Dataset
    logs : sequence of Log
        The logs before preparation.
    rolled : Rollouts
    """
    robot = structure.robot
    model = structure.model
    known = {**robot.nominal, **rolled.parameters}
    phi = np.array([known.get(name, 0.0) for name in structure.columns])
    out = list[Dataset]()
    for own, log in zip(samples, logs, strict=True):
        found = None if log.rollout is None else add_instrument(robot, log, own)
        moved = None if found is None else found.instrument
        if moved is not None:
            more = (model.regressor(robot, moved) - model.regressor(robot, own.motion)) @ phi
            own = replace(own, motion=moved, tau=own.tau + more)  # noqa: PLW2901 - the same
        out.append(own)
    return tuple(out)
