"""FIGAROH: regressor, base parameters and least squares by its public functions.

They are called in the order of ``BaseIdentification.solve`` without decimation, less its
bookkeeping, logging and plots. Its workflow decomposes by double QR; pivoting is the other
documented way and does one QR less.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from figaroh.identification.identification_tools import relative_stdev
from figaroh.identification.parameter import (
    add_standard_additional_parameters,
    get_standard_parameters,
)
from figaroh.tools.qrdecomposition import QRDecomposer
from figaroh.tools.regressor import (
    build_regressor_basic,
    build_regressor_reduced,
    get_index_eliminate,
)

from peers.process import Array, Run


class Robot:
    """The interface of a robot that FIGAROH's functions need, and its settings of the model."""

    def __init__(self, path: str) -> None:
        self.model = pin.buildModelFromUrdf(path)
        self.data = self.model.createData()
        none = [0.0] * self.model.nv
        self.settings = {
            "is_joint_torques": True,
            "has_friction": True,
            "act_idxv": list(range(self.model.nv)),
            "fv": none,
            "fs": none,
        }
        self.parameters = get_standard_parameters(self.model, self.settings)
        self.parameters |= add_standard_additional_parameters(self.model, self.settings)


def build(run: Run, robot: Robot) -> Array:
    """Return the regressor, (n N, p), all samples of a joint together."""
    with run.phase("regressor"):
        W = build_regressor_basic(robot, run.q, run.v, run.a, robot.settings)
    rigid = W[run.shown_by_joint, : 10 * robot.model.nv]
    run.evidence["regressor"] = rigid.tolist()
    return W


def fit_double(run: Run) -> None:
    """Estimate the base parameters with σ as the workflow does."""
    _fit(run, double=True)


def fit_pivoting(run: Run) -> None:
    """Estimate the base parameters with σ by the quicker decomposition."""
    _fit(run, double=False)


def _fit(run: Run, *, double: bool) -> None:
    robot = Robot(run.robot)
    W = build(run, robot)
    tau = run.tau.T.reshape(-1)
    with run.phase("base parameters"):
        idle, names = get_index_eliminate(W, robot.parameters, tol_e=1e-3)
        reduced = build_regressor_reduced(W, idle)
        del W  # a script that goes on with the reduced one would
        decomposer = QRDecomposer(tolerance=1e-6)
        if double:
            base, _, _, value = decomposer.double_decomposition(tau, reduced, names)
        else:
            base, found = decomposer.decompose_with_pivoting(tau, reduced, names)
            value = np.array(list(found.values()))
    with run.phase("least squares and σ"):
        relative_stdev(base, value, tau)
    # It rounds to a hundredth of a per cent; the comparison uses its formula without rounding.
    residual = tau - base @ value
    variance = float(residual @ residual) / (len(tau) - len(value))
    covariance = variance * np.linalg.inv(base.T @ base)
    run.show_fit(base[run.shown_by_joint], value, covariance, variance)
