"""`TorqueScale`: by which factor torque is read too large, as the masses of the robot file tell.

Wrong torque constants make the fitted robot and a load heavier by one factor. Nobody knows it
before: it has a prior. The gravity torque of the fitted robot over that of the file measures it.
How far each body of the file errs is not known either. It has a prior, and the scatter of the
gravity parameters about one factor tells it. Centres of bodies may err as well, by another size: if
they are right, this must not make the masses look right. A file of placeholders scatters much, and
then the prior of the factor remains.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import softmax

from identifiability.effects.nominal import has_masses
from identifiability.estimation.rules import RULES
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.rounding import REACH
from identifiability.foundation.values import frozen
from identifiability.regression.structure import Structure
from identifiability.robot import Motion, complete_motion

from .predict import Fit

#: Logs of the factor that are summed over: four standard deviations of the prior.
FACTORS: Array = np.linspace(-4.0, 4.0, 801) * RULES.constants_within
#: Errors that bodies of a file may have, as shares of each, and how likely each is: half of all
#: files err by less than 4.5 %, and a factor of 1.5 is one standard deviation.
FILE_ERRORS: Array = np.geomspace(0.01, 2.0, 20)
LOG_PRIOR: Array = -0.5 * (np.log(FILE_ERRORS / 0.045) / np.log(1.5)) ** 2
#: Poses at which gravity torque is computed.
POSES = 200


@frozen(kw_only=True)
class TorqueScale:
    """The factor by which torque is read too large, the same at all joints.

    Attributes
    ----------
    factor, sd : float
        The most probable factor, and the rms deviation of the posterior from its logarithm.
    ratio, ratio_sd : float
        The gravity torque of the fitted robot over that of the file, without the prior, and the
        standard error of its logarithm; NaN where the file or the motion does not tell.
    """

    factor: float = 1.0
    sd: float = RULES.constants_within
    ratio: float = np.nan
    ratio_sd: float = np.nan

    @property
    def ratio_interval(self) -> tuple[float, float]:
        """The 95 % interval of the ratio."""
        reach = float(np.exp(REACH * self.ratio_sd))
        return self.ratio / reach, self.ratio * reach

    @property
    def contradicts(self) -> bool:
        """Whether the 95 % interval of the ratio does not contain one."""
        low, high = self.ratio_interval
        return low > 1.0 or high < 1.0


#: That of torque columns that are right as they are read.
UNSCALED = TorqueScale(sd=0.0)


def measure_torque_scale(fit: Fit, motions: Sequence[Motion]) -> TorqueScale:
    """Return by which factor a robot was fitted too heavy, as its file tells.

    Parameters
    ----------
    fit : Fit
    motions : sequence of Motion
        Their poses are those at which gravity torque is compared.
    """
    structure = fit.structure
    if not has_masses(structure.robot) or structure.robot.base is not None:
        return TorqueScale()
    lengths = _gravity_sizes(structure, motions)
    heavy = np.flatnonzero(lengths > 0)
    stated = lengths[heavy] * structure.nominal_base[heavy]
    typical = float(np.linalg.norm(stated) / np.sqrt(max(len(stated), 1)))
    if not typical > 0:
        return TorqueScale()
    # All in shares of the torque of a typical gravity parameter of the file.
    unit = lengths[heavy] / typical
    values, covariance = fit.of_labels
    unknown = unit[:, None] * fit.base_unknown[heavy]
    spread = np.outer(unit, unit) * covariance[np.ix_(heavy, heavy)]
    # Only in directions that the fitted logs determine.
    share, axes = np.linalg.eigh(unknown @ unknown.T)
    towards = axes[:, share < NEARLY].T
    if not len(towards):
        return TorqueScale()
    fitted = towards @ (unit * values[heavy])
    bodies = towards @ (unit * _gravity_of_bodies(structure)[:, heavy]).T
    spread = towards @ spread @ towards.T
    return compare_gravity(fitted, spread, towards @ stated / typical, bodies @ bodies.T)


def _gravity_of_bodies(structure: Structure) -> Array:
    """Return what each body of the file adds to the base parameters, (B, b)."""
    owners = np.array([name.rpartition(".")[0] for name in structure.columns])
    parts = [structure.nominal * (owners == body) for body in structure.robot.bodies]
    return np.array(parts) @ structure.G.T


def _gravity_sizes(structure: Structure, motions: Sequence[Motion]) -> Array:
    """Return the rms torque of each base parameter at rest, (b,); zero if it is no body's."""
    q = np.concatenate([motion.actuated_q for motion in motions])
    q = q[:: max(1, len(q) // POSES)]
    still = np.zeros_like(q)
    pose = complete_motion(structure.robot, np.arange(len(q), dtype=float), q, still, still)
    W = structure.model.regressor(structure.robot, pose)[:, :, structure.base.kept]
    inertial = [name.rpartition(".")[2] in INERTIAL_KINDS for name in structure.base.names]
    squares = np.mean(W**2, axis=(0, 1))
    return np.where(inertial, np.sqrt(squares), 0.0)


def compare_gravity(fitted: Array, covariance: Array, stated: Array, errors: Array) -> TorqueScale:
    """Return the factor between gravity parameters (k,) that were fitted and those of a file.

    ``fitted ~ N(factor * stated, covariance + error² errors + other² I / k)``, where the logarithms
    of the factor and of the error are normal, and that of the other error is uniform.

    Parameters
    ----------
    fitted, stated : (k,)
    covariance : (k, k)
        Of the fitted parameters.
    errors : (k, k)
        Covariance of the stated parameters where each body errs by its own size.
    """
    error, other = np.meshgrid(FILE_ERRORS, FILE_ERRORS, indexing="ij")
    log_prior = np.repeat(LOG_PRIOR, len(FILE_ERRORS))
    apart = np.eye(len(stated)) / len(stated)
    of_errors = error.reshape(-1, 1, 1) ** 2
    of_others = other.reshape(-1, 1, 1) ** 2 * apart
    size, axes = np.linalg.eigh(covariance + of_errors * errors + of_others)
    towards, seen = stated @ axes, fitted @ axes
    variance = 1.0 / np.sum(towards**2 / size, axis=1)
    best = variance * np.sum(towards * seen / size, axis=1)
    expected = best[:, None] * towards
    squares = (seen - expected) ** 2
    rest = np.sum(squares / size + np.log(size), axis=1)
    off = (np.exp(FACTORS) - best[:, None]) ** 2 / variance[:, None]
    likely = log_prior - 0.5 * rest
    log_density = likely[:, None] - 0.5 * (off + (FACTORS / RULES.constants_within) ** 2)
    weight = softmax(log_density).sum(axis=0)
    mode = float(FACTORS[np.argmax(weight)])
    sd = float(np.sqrt(weight @ (FACTORS - mode) ** 2))
    share = softmax(likely + 0.5 * np.log(variance))
    ratio = float(share @ best)
    ratio_sd = float(np.sqrt(share @ (variance + (best - ratio) ** 2)))
    if not ratio > 0:
        return TorqueScale(factor=float(np.exp(mode)), sd=sd)
    return TorqueScale(factor=float(np.exp(mode)), sd=sd, ratio=ratio, ratio_sd=ratio_sd / ratio)
