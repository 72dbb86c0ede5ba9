"""The library, then its semidefinite program on the compressed problem."""

from __future__ import annotations

from identifiability.physical.feasibility import full_problem, nominal_vector, physical_set
from identifiability.physical.project import project
from identifiability.regression.reduction import full_rung
from peers import ours
from peers.process import Run


def fit(run: Run) -> None:
    """Find the real robot that is nearest to the data."""
    found = ours.fit(run)
    base, robot = found.base, found.robot
    with run.phase("semidefinite program"):
        data = full_problem(found.information, found.estimate, full_rung(base), base.G)
        near = project(data, physical_set(robot, base), reference=nominal_vector(robot, base))
    run.evidence |= {
        "rss": near.rss,
        "torque": (found.W @ near.phi).tolist(),
        "status": near.status,
    }
