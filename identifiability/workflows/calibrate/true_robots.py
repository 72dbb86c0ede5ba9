"""True robots that file and logs make likely: what simulated repetitions are made from.

The centre is the robot that the file's bodies, each to ± `SHARE` of its moments, and the logs make
likeliest together; every repetition draws its bodies anew around it, made physically possible.
"""

from __future__ import annotations

import numpy as np

from identifiability.estimation.omitted import body_scatter
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.pseudo_inertia import BASIS, natural_scale, scale_matrix, to_matrix
from identifiability.regression.reduction import Rung
from identifiability.regression.structure import Structure
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.assessment import RungResult

#: Residual variances below this share of the torque's are rounding.
ROUNDING = 1e-12

#: What a model leaves out, and no body has, is in a true robot if the unpruned model finds it this
#: many robust standard deviations from zero: less is noise, which must not be planted as truth.
SURE = 3.0

_TO_THETA = np.linalg.pinv(BASIS.reshape(10, 16))


@frozen
class TrueRobots:
    """Robots around a likely one.

    Attributes
    ----------
    structure : Structure
    bodies : (p,)
        Its standard parameters of bodies of which the file states a mass; zero for all others.
    scatter : (p,)
        Standard deviations around them; zero for what is no body's.
    others : (b,)
        Base parameters of all that is not in `bodies`: friction, rotors.
    """

    structure: Structure
    bodies: Array
    scatter: Array
    others: Array

    @staticmethod
    def of(analysis: Analysis, result: RungResult) -> TrueRobots:
        """Return the robots that file and logs make likely.

        What is no body's is as the model has it, with what it leaves out where the unpruned model
        is sure of that.
        """
        structure, full = analysis.structure, analysis.full
        scatter, rows = body_scatter(structure), structure.inertial
        stated = np.zeros(len(scatter), bool)
        stated[rows[scatter[rows].any(1)]] = True
        bodies = np.where(stated, structure.nominal, 0.0)
        of_others = np.any(structure.G[:, ~stated], axis=1)
        span, others = _free(result.rung, full, of_others, structure.G @ bodies)
        noise = full.estimate.variance * np.maximum(full.autocorrelation_time, 1.0)
        torque = analysis.information.torque.sum() / max(analysis.information.rows, 1)
        factor = analysis.information.factor(1.0 / np.maximum(noise, ROUNDING * torque + 1e-300))
        R = factor[:, :-1]
        left = factor[:, -1] - R @ (structure.G @ bodies + others)
        columns = R @ span
        size = np.linalg.norm(columns, axis=0)
        size[size == 0] = 1.0
        moved = scatter > 0
        prior = np.eye(moved.sum(), moved.sum() + span.shape[1])
        A = np.vstack(
            [np.hstack([R @ structure.G[:, moved] * scatter[moved], columns / size]), prior]
        )
        found = np.linalg.lstsq(A, np.append(left, np.zeros(len(prior))), rcond=None)[0]
        bodies[moved] += scatter[moved] * found[: len(prior)]
        return TrueRobots(structure, bodies, scatter, others + span @ (found[len(prior) :] / size))

    def draw(self, rng: np.random.Generator) -> Array:
        """Return the base parameters of a robot, (b,)."""
        theta = self.bodies + self.scatter * rng.standard_normal(len(self.bodies))
        rows = self.structure.inertial
        rows = rows[self.scatter[rows].any(1)]
        if len(rows):
            theta[rows] = make_possible(theta[rows], self.structure.nominal[rows])
        base: Array = self.structure.G @ theta + self.others
        return base


def _free(rung: Rung, full: RungResult, rows: np.ndarray, by_bodies: Array) -> tuple[Array, Array]:
    """Return what base parameters of others than bodies may be: span (b, f) and its origin (b,).

    Parameters
    ----------
    rung : Rung
    full : RungResult
        The unpruned model.
    rows : (b,) bool
        Base parameters in which something else than bodies acts.
    by_bodies : (b,)
        What bodies make of them in the file.
    """
    own = rung.M[rows]
    own = own[:, own.any(0)]
    left = np.eye(rows.sum()) - own @ np.linalg.pinv(own)
    found = full.rung.expand(full.estimate.value)[rows] - rung.held[rows]
    C = np.where(np.isfinite(full.estimate.covariance), full.estimate.covariance, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        wider = np.nan_to_num(full.uncertainty.robust / full.estimate.sigma, nan=1.0, posinf=1.0)
    half = left @ full.rung.M[rows]
    sd = np.sqrt(np.einsum("ij,jk,ik->i", half * wider, C, half * wider))
    open_ = (np.abs(half[:, ~full.estimate.determined]) > 0).any(1)
    sure = (np.abs(left @ found) > SURE * sd) & (sd > 0) & ~open_
    span, origin = np.zeros((len(rows), own.shape[1] + sure.sum())), np.zeros(len(rows))
    span[rows] = np.hstack([own, left[:, sure]])
    held = rows & (rung.held != 0)
    origin[held] = rung.held[held] - by_bodies[held]
    return span, origin


def make_possible(theta: Array, like: Array) -> Array:
    """Return the nearest bodies that can exist, (nb, 10).

    Parameters
    ----------
    theta : (nb, 10) [kg m², kg m, kg]
    like : (nb, 10)
        Bodies that give the scale in which distances count.
    """
    s = scale_matrix(*natural_scale(like))
    scale = s[:, :, None] * s[:, None, :]
    values, vectors = np.linalg.eigh(to_matrix(theta) / scale)
    J = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.swapaxes(1, 2) * scale
    possible: Array = J.reshape(-1, 16) @ _TO_THETA
    return possible
