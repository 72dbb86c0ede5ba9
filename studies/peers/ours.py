"""The library: samples, base parameters, the regressor compressed as it is made, least squares."""

from __future__ import annotations

from dataclasses import dataclass

from identifiability.estimation.estimate import estimate
from identifiability.estimation.estimator import Estimate
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.regression.information import Information, gather_information
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from peers.process import Array, Run

EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction")


@dataclass(frozen=True)
class Fit:
    """The data for later steps, and the regressor W (S, n, p) at the shown samples."""

    structure: Structure
    information: Information
    estimate: Estimate
    W: Array


def fit(run: Run) -> Fit:
    """Estimate the base parameters with σ by ordinary least squares."""
    robot, model = Robot.load(run.robot), Model.of(*EFFECTS)
    with run.phase("preparation"):
        log = Log("samples", robot.joints, run.t, run.q, run.tau, run.v, run.a, "")
        samples = prepare_log(robot, log, Preparation("given", keep_rest=True))
    with run.phase("base parameters"):
        structure = Structure.of(robot, model)
    with run.phase("regressor"):  # and its compression: the whole is never in memory
        information = gather_information(structure.regression([samples]))
    with run.phase("least squares and σ"):
        found = estimate(information, "ols")
    W = model.regressor(robot, samples.motion[run.shown])
    run.evidence["regressor"] = W[:, :, : 10 * robot.nv].tolist()
    variance = float(found.rss.sum()) / found.dof
    run.show_fit(W[:, :, structure.base.kept], found.value, found.covariance, variance)
    return Fit(structure, information, found, W)
