"""The library, then its semidefinite program on the compressed problem."""

from __future__ import annotations

from identifiability.physical.fitted_model import FittedModel, physical_set
from identifiability.physical.project import project
from identifiability.regression.reduction import full_model
from peers import ours
from peers.process import Run


def fit(run: Run) -> None:
    """Find the physically consistent values nearest to the data."""
    found = ours.fit(run)
    structure = found.structure
    with run.phase("semidefinite program"):
        information = found.information
        submodel = full_model(structure.base)
        model = FittedModel(structure, submodel, information, information, found.estimate)
        near = project(model.data, physical_set(structure), reference=structure.nominal)
    run.evidence |= {
        "rss": near.rss,
        "torque": (found.W @ near.phi).tolist(),
        "status": "optimal" if near.accurate else "not sure",
    }
