"""FIGAROH's physically consistent fit: one matrix inequality a link, by PICOS and CVXOPT.

``physical_fit`` with its own settings; it compresses all rows by QR before it solves.
"""

from __future__ import annotations

import cvxopt  # noqa: F401 - imported before the clock starts
import numpy as np
import picos  # noqa: F401
from figaroh.identification.physical_fit import build_problem, solve_direct_effort_fit

from peers.figaroh_ways import Robot, build
from peers.process import Run


def fit(run: Run) -> None:
    """Find the physical parameters that fit the torque best."""
    robot = Robot(run.robot)
    W = build(run, robot)
    tau, prior = run.tau.T.reshape(-1), np.array(list(robot.parameters.values()))
    with run.phase("compression"):
        problem = build_problem(
            W, tau, list(robot.parameters), list(robot.model.names[1:]), prior=prior
        )
    with run.phase("semidefinite program"):
        found = solve_direct_effort_fit(problem, solver="cvxopt")
    if found.theta is None:
        raise RuntimeError(f"FIGAROH's solver says {found.solver_status}: {found.exception}")
    residual = W @ found.theta - tau
    run.evidence |= {
        "rss": float(residual @ residual),
        "torque": (W[run.shown_by_joint] @ found.theta).tolist(),
        "status": f"{found.solver_status}, {'' if found.accepted else 'not '}accepted",
    }
