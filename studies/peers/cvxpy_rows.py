"""A plain program: all rows of the regressor into cvxpy, one matrix inequality a body."""

from __future__ import annotations

import cvxpy as cp

from identifiability.regression.regression import Model
from identifiability.robot import Robot, complete_motion
from peers.ours import EFFECTS
from peers.process import Run


def fit(run: Run) -> None:
    """Find the physical parameters that fit the torque best, by Clarabel."""
    robot, model = Robot.load(run.robot), Model.of(*EFFECTS)
    n = robot.nv
    with run.phase("regressor"):
        motion = complete_motion(robot, run.t, run.q, run.v, run.a)
        W = model.regressor(robot, motion).reshape(n * len(motion), -1)
    tau = run.tau.reshape(-1)
    with run.phase("semidefinite program"):
        phi = cp.Variable(W.shape[1])
        limits = [phi[10 * n :] >= 0, *(pseudo_inertia(phi, k) >> 0 for k in range(n))]
        problem = cp.Problem(cp.Minimize(cp.sum_squares(W @ phi - tau)), limits)
        problem.solve(solver="CLARABEL")
    residual = W @ phi.value - tau
    shown = W.reshape(len(motion), n, -1)[run.shown]
    run.evidence |= {
        "rss": float(residual @ residual),
        "torque": (shown @ phi.value).tolist(),
        "status": str(problem.status),
    }


def pseudo_inertia(phi: cp.Variable, body: int) -> cp.Expression:
    """Return the matrix that a real body has positive definite [Wensing 2017]."""
    m, mx, my, mz, xx, xy, yy, xz, yz, zz = (phi[10 * body + i] for i in range(10))
    half = 0.5 * (xx + yy + zz)
    return cp.bmat(
        [
            [half - xx, -xy, -xz, mx],
            [-xy, half - yy, -yz, my],
            [-xz, -yz, half - zz, mz],
            [mx, my, mz, m],
        ]
    )
