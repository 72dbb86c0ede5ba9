"""ArviZ sees the posterior that the report shows."""

import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import analyze

pytest.importorskip("arviz_base", reason="needs the extra 'arviz'")
arviz = pytest.importorskip("arviz_stats")


@pytest.fixture(scope="module")
def result(simulated_session, few_draws):
    log = simulated_session("two-link", "a", samples=200)
    with few_draws():
        return analyze("two-link", log, replicates=0, posterior=True)


def test_every_draw_is_there_with_names_and_units(result):
    tree = result.to_arviz()
    summary = result.belief.physical
    posterior = tree["posterior"].dataset
    phi = posterior["phi"]
    assert phi.dims == ("chain", "draw", "parameter")
    assert phi["parameter"].values.tolist() == list(result.chosen.submodel.columns)
    units = tree["constant_data"]["unit"].values.tolist()
    assert units == [v.unit for v in result.chosen.verdicts]
    assert_allclose(phi.mean(("chain", "draw")), summary.mean, rtol=1e-9)
    assert_allclose(phi.std(("chain", "draw"), ddof=1), summary.sd, rtol=1e-9)
    assert len(np.unique(posterior["ensemble"])) == 4


def test_arviz_judges_the_chains_as_we_do(result):
    tree = result.to_arviz()
    posterior = tree["posterior"].dataset
    ids = posterior["ensemble"].values
    theirs = arviz.rhat_nested(posterior, superchain_ids=ids)["standard"]
    ours = result.belief.physical.convergence.rhat
    assert_allclose(theirs, ours, rtol=1e-6)
    assert f"phi[{result.chosen.submodel.columns[0]}]" in arviz.summary(tree).index
    assert bool(tree.attrs["trustworthy"]) == result.belief.physical.convergence.trustworthy
    assert tree.attrs["reasons"] == " ".join(result.belief.physical.convergence.reasons)
    assert tree.attrs["seed"] == "0"


def test_standard_parameters_stand_beside_those_of_the_model(result):
    free = [n for n in result.belief.standard if not n.endswith(".off")]  # held at 0
    assert result.to_arviz()["posterior"].dataset["standard_parameter"].values.tolist() == free


def test_what_is_not_there_is_said_in_a_sentence(result, simulated_session, monkeypatch, rejected):
    bare = analyze("two-link", simulated_session("two-link", "a", samples=200), replicates=0)
    with rejected(r"ask for it with analyze\(…, posterior=True\)\.$"):
        bare.to_arviz()
    monkeypatch.setitem(sys.modules, "xarray", None)
    with rejected(r"pip install '\.\[arviz\]'\.$"):
        result.to_arviz()
