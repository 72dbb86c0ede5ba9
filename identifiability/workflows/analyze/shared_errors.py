"""`SharedErrors`: changes of the values by errors that all samples of a log share."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from identifiability.effects import Part, Placed, find_family
from identifiability.effects.effect import EXPONENT
from identifiability.estimation.estimate import with_known
from identifiability.estimation.estimator import Estimator
from identifiability.foundation.names import Array, NumberByName
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Dataset, Preparation, prepare_log
from identifiability.logs.prepare.instruments import noise_again
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.logs.series import KINDS, measured_noise
from identifiability.regression.information import Information, gather_information
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import Model, Regression
from identifiability.robot import Robot
from identifiability.workflows.case import Data, WeightedRows


@frozen
class SharedErrors:
    """Changes of the values by errors that all samples of a log share.

    ``delay`` is due to delays and gains of servos. ``bias`` is due to noise in computed derivatives
    below the cut-off, where no second record of the motion removes it. Adding the same noise again
    moves the values by the bias that they already have [Cook 1994]. ``shape`` is due to speeds and
    exponents of friction, which were fitted and which the model takes as known.

    Attributes
    ----------
    information : Information
        About all columns, with equal rows.
    others : mapping of str to tuple of Information
        The same with commands of one log later by one standard deviation of its delay, with
        estimated gains changed by one standard deviation, with the noise of the motion added
        again, and with shapes of friction changed by one standard error.
    estimator : Estimator
    """

    information: Information
    others: Mapping[str, tuple[Information, ...]]
    estimator: Estimator

    def move(self, submodel: Submodel) -> dict[str, Array]:
        """Return the changes of the values of a model by each error, (w, k)."""
        if not self.others:
            return {}

        def fit(information: Information) -> Array:
            return self.estimator.fit(submodel.reduce(information)).value

        own = fit(self.information)
        each = self.others.items()
        return {name: np.array([fit(x) - own for x in others]) for name, others in each}

    def together(self, submodel: Submodel) -> Array:
        """Return all of them, (w, k)."""
        moved = self.move(submodel).values()
        return np.vstack([np.zeros((0, len(submodel))), *moved])


def measure_shared_errors(rows: WeightedRows) -> SharedErrors:
    """Return the changes of fitted values by delays, gains and noise of the motion."""
    data = rows.data
    later = (_prepare_again(data, logs) for logs in data.recordings.later)
    delayed = tuple(_gather(data, data.regression.with_torque(samples)) for samples in later)
    others = {"delay": delayed} if delayed else {}
    if _motion_is_noisy(rows):
        fitted = enumerate(data.recordings.fitted)
        rng = np.random.default_rng
        noisier = {k: noise_again(log, rng(0)) for k, log in fitted if not log.long}
        noisy = data.structure.regression(_prepare_again(data, noisier))
        others["bias"] = (_gather(data, noisy),)
    shifted = _shift_shapes(rows)
    if shifted:
        others["shape"] = shifted
    return SharedErrors(rows.unweighted, others, rows.estimator)


def _shift_shapes(rows: WeightedRows) -> tuple[Information, ...]:
    """Return the information with the shapes of friction changed by each of their errors.

    The errors are one standard error long and lie along the axes of the joint covariance of all
    shapes. That comes from a fit with the slope of torque over each shape as a further column. The
    slope of a small level has no information on its shape, and holds near it only. So the logarithm
    of each shape has a prior standard deviation of one, as those have that `diagnose` tries.
    """
    structure = rows.data.structure
    moved = _move_shapes(rows)
    if not moved:
        return ()
    names = structure.base.names
    count = len(names)
    wide = _gather_beside(rows.data, moved)
    of_model = np.eye(wide.size, count)
    of_shapes = block_diag(np.zeros((count, 0)), *moved.slopes)
    both = wide.reduce(np.hstack([of_model, of_shapes]), [*names, *moved.names])
    near = np.eye(len(moved.names), both.size, k=count)
    covariance = rows.estimator.fit(with_known(both, near)).covariance[count:, count:]
    squares, axes = np.linalg.eigh(covariance)
    errors = of_shapes @ axes * np.sqrt(np.maximum(squares, 0.0))
    shifted = (wide.reduce(of_model, names, error) for error in errors.T)
    return tuple(with_known(one, structure.known) for one in shifted)


class _MovedShapes(NamedTuple):
    """Friction with shapes that are a little smaller and larger than those of the model.

    Attributes
    ----------
    parts : mapping of str to list of Part
        By family; two of each shape.
    names : list of str
        Of the shapes.
    slopes : list of (2 k, 1)
        Derivative of the torque with respect to the logarithm of each shape, as levels of the
        columns of its two parts.
    """

    parts: defaultdict[str, list[Part]]
    names: list[str]
    slopes: list[Array]


def _gather_beside(data: Data, moved: _MovedShapes) -> Information:
    """Return the information about the model's columns and those of moved shapes."""
    structure = data.structure
    first = len(structure.parameters)
    last = first + sum(map(len, moved.slopes))
    columns = np.array([*structure.base.kept, *range(first, last)])
    model = Model((*structure.model.effects, *map(Placed, moved.parts.values())))
    return gather_information(replace(data.regression, model=model, columns=columns))


def _move_shapes(rows: WeightedRows) -> _MovedShapes | None:
    """Return friction of the fitted levels beside the shapes of the model, if it has any."""
    structure = rows.data.structure
    fitted = rows.estimator.fit(rows.unweighted).value.tolist()
    values = dict(zip(structure.base.names, fitted, strict=True))
    step = 0.01  # a hundredth changes the slope little
    moved = _MovedShapes(defaultdict(list), [], [])
    shapes = _list_fitted_shapes(structure.shapes)
    for family, place in sorted(shapes):  # columns follow each other by family
        shape = shapes[family, place]
        levels = Placed([_friction_at(place, family, shape)]).parameters(structure.robot)
        level = np.array([values.get(p.name, 0.0) for p in levels])
        if not level.any():
            continue
        for number, one in enumerate(np.eye(len(shape))):
            ends = shape * (1 - step * one), shape * (1 + step * one)
            moved.parts[family] += [_friction_at(place, family, end) for end in ends]
            moved.names.append(f"{place}.{family}{number}")
            slope = np.concatenate([-level, level]) / (2 * step)
            moved.slopes.append(slope[:, None])
    return moved if moved.slopes else None


def _friction_at(place: str, family: str, shape: Array) -> Part:
    """Return friction at a joint with a shape, and its exponent if there is one."""
    first, *powers = shape.tolist()
    return Part(find_family(family).at((first, *powers) if powers else first, place), place)


def _list_fitted_shapes(shapes: NumberByName) -> dict[tuple[str, str], Array]:
    """Return the shapes of friction with their exponents, by family and joint."""
    out = {}
    for name, shape in shapes.items():
        place, _, family = name.rpartition(".")
        if not name.endswith(EXPONENT) and find_family(family).continuous:
            numbers = shape, shapes.get(f"{name}{EXPONENT}")
            out[family, place] = np.array([x for x in numbers if x is not None])
    return out


def _has_loud_motion(data: Data) -> bool:
    """Return whether the motion has more than little noise; that of a base always has."""
    band = data.band
    derived = band is not None and band.noise > LOG_RULES.small
    how = data.preparation
    return data.robot.base is not None or derived or how.derivatives in KINDS or _is_noisy(data)


def _is_noisy(data: Data) -> bool:
    """Return whether derivatives were measured with more than negligible noise."""
    for log in data.recordings.fitted:
        if log.long or log.ddq is None:
            continue
        for x in (log.q, log.dq, log.ddq):
            if x is not None and np.any(measured_noise(x, log.t) > LOG_RULES.small * x.std(0)):
                return True
    return False


def _motion_is_noisy(rows: WeightedRows) -> bool:
    """Return whether noise of the motion reaches the columns and nothing else accounts for it."""
    accounted = rows.estimator.instruments or rows.data.recordings.commanded
    return _has_loud_motion(rows.data) and not accounted


def _gather(data: Data, regression: Regression) -> Information:
    """Return the information of other rows about the model of some data."""
    return with_known(gather_information(regression), data.structure.known)


def _prepare_again(data: Data, logs: Mapping[int, Log]) -> list[Dataset]:
    """Return the samples with some fitted logs in another version, by their place."""
    samples = list(data.samples)
    for k, log in logs.items():
        samples[k] = measure_again(data.robot, log, samples[k], data.preparation)
    return samples


def measure_again(robot: Robot, log: Log, prepared: Dataset, how: Preparation) -> Dataset:
    """Return motion and torque of another version of a log, if the same rows are kept."""
    again = prepare_log(robot, log, how)
    same = np.array_equal(again.motion.kept, prepared.motion.kept)
    if same:
        return replace(prepared, motion=again.motion, tau=again.tau)
    return prepared
