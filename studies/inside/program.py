"""The semidefinite program: the real robot nearest to the data."""

from __future__ import annotations

import cvxpy as cp
import numpy as np
from peers.cvxpy_rows import pseudo_inertia

from identifiability.estimation.least_squares import WeightedLeastSquares
from identifiability.physical.fitted_model import FittedModel, physical_set
from identifiability.physical.project import project
from identifiability.workflows.analyze import Analysis
from inside.pair import Pair, all_rows, timed


def measure(analysis: Analysis, repeats: int) -> Pair:
    """Project on the bodies that can exist, from the compressed problem and from all rows.

    By least squares: rows alone have no instruments, by which an analysis fits noisy motion.
    """
    structure, full = analysis.structure, analysis.full
    region, nominal = physical_set(structure), structure.nominal
    fitted = FittedModel.of(structure, full.submodel, analysis.information, WeightedLeastSquares())
    data, fit = fitted.data, fitted.estimate
    project(data, region, reference=nominal)  # what is imported on the way is not the program's
    ours, found = timed(lambda: project(data, region, reference=nominal), repeats)

    rows = all_rows(analysis, full.submodel, fitted.information)
    W, tau = rows.weighted(fit.weights)
    W = W @ np.linalg.pinv(full.submodel.M) @ structure.G

    def naive() -> np.ndarray:
        phi = cp.Variable(W.shape[1])
        bodies = [pseudo_inertia(phi, k) >> 0 for k in range(len(structure.robot.bodies))]
        limits = [phi[10 * len(structure.robot.bodies) :] >= 0, *bodies]
        cp.Problem(cp.Minimize(cp.sum_squares(W @ phi - tau)), limits).solve(solver="CLARABEL")
        return np.asarray(phi.value)

    slow, phi = timed(naive)
    residual = W @ phi - tau
    # Ours pulls what the data leave open towards the robot file, which costs a little.
    variance = float(fit.weights @ fit.rss) / fit.dof
    gap = abs(float(residual @ residual) - found.rss) / variance
    return Pair(
        "semidefinite program", "all rows of the regressor into cvxpy",
        f"{len(W)} rows, {W.shape[1]} parameters, {len(structure.robot.bodies)} bodies",
        ours, slow, gap, 0.1, "residual sum of squares, in σ²",
    )  # fmt: skip
