"""Pinocchio alone: one call a sample, into an array that is there already."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from peers.process import Run


def fill(run: Run) -> None:
    """Compute the rigid-body regressor of every sample."""
    model = pin.buildModelFromUrdf(run.robot)
    data, regressor = model.createData(), pin.computeJointTorqueRegressor
    W = np.ones((len(run.q), model.nv, 10 * model.nv))  # written once: its pages are there
    with run.phase("regressor"):
        for k in range(len(W)):
            W[k] = regressor(model, data, run.q[k], run.v[k], run.a[k])
    run.evidence["regressor"] = W[run.shown].tolist()
