"""The answer of a calibration, in planted worlds: yes where all is well, no with its cause."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import default_rng

from identifiability import Noise, analyze, calibrate
from identifiability.foundation.rounding import Share
from identifiability.physical.pseudo_inertia import margin, natural_scale
from identifiability.regression.reduction import LadderEntry, ModelEntry
from identifiability.workflows.calibrate.calibration import decide
from identifiability.workflows.calibrate.world import TrueRobots, make_possible

from .laws.numbers.made import ar1

ONE = {"replicates": 60, "refits": 60}
#: What is wrong shows in fewer.
FEW = ONE | {"replicates": 32, "refits": 40}


@pytest.fixture
def log(simulated_session):
    return lambda noise: simulated_session("two-link", "a", 0, noise)


def test_yes_where_intervals_hold(log):
    found = calibrate(analyze("two-link", log(Noise(torque=0.05)), replicates=60), **ONE)
    assert found.word == "yes"
    first, second, third = found.statement.splitlines()
    assert re.match(r"Yes: \S+ ± \S+ % of the 95 % intervals hold the true value\.", first)
    assert second.startswith(
        "None of the parameters called identifiable are off by more than half."
    )
    assert third.endswith("This is so if the model lacks no effect: diagnose looks for one.")
    told = found.to_dict()
    assert (told["answer"], told["statement"]) == ("yes", found.statement)


def test_no_where_noise_remembers_longer_than_the_log(log):
    """Correlation .997 from each of 200 samples to the next: not one of them is independent."""
    exact = log(Noise())
    slow = ar1(default_rng(1), 0.997, *exact.tau.shape)
    noisy = replace(exact, tau=exact.tau + 0.05 * exact.tau.std() * slow)
    found = calibrate(analyze("two-link", noisy, replicates=60), **FEW)
    assert found.word == "no"
    assert "Give longer logs" in found.statement


def cell(coverage, *, se=0.005, wrong=(0.0, 0.0, 0.01), single=(0.95, 0.9, 0.99), silent=0.0):
    return SimpleNamespace(
        coverage=coverage, coverage_se=se, wrong=Share(*wrong), not_judged=silent,
        each=(Share(0.96, 0.9, 0.99), Share(*single)),
    )  # fmt: skip


@pytest.mark.parametrize(
    "found, word",
    [
        (cell(0.94), "yes"),
        (cell(0.91), "yes"),
        (cell(0.905), "not enough trials"),
        (cell(0.895), "not enough trials"),
        (cell(0.88), "no"),
        (cell(0.94, se=0.03), "not enough trials"),
        (cell(0.94, wrong=(0.01, 0.001, 0.03)), "not enough trials"),
        (cell(0.94, wrong=(0.05, 0.03, 0.08)), "no"),
        (cell(0.94, single=(0.7, 0.6, 0.84)), "no"),
        (cell(0.94, single=(0.8, 0.7, 0.86)), "yes"),
        (cell(0.94, silent=0.6), "no"),
        (cell(0.94, wrong=(0.0, float("nan"), float("nan"))), "yes"),
    ],
)
def test_the_answer_is_only_given_beyond_monte_carlo_error(found, word):
    assert decide(found) == word


def test_true_robots_are_possible_and_scatter_around_what_file_and_log_say(log):
    effects = ["rigid_body", "viscous_friction", "coulomb_asymmetry", "actuator_inertia"]
    ties = {f"{j}.Fc": [f"{j}.Fc+", f"{j}.Fc-"] for j in ("shoulder", "elbow")}
    submodels = [ModelEntry(name="two levels", effects=effects), ModelEntry(name="one", tie=ties)]
    ladder = LadderEntry(models=submodels)
    analysis = analyze("two-link", log(Noise(torque=0.02)), ladder=ladder, replicates=60)
    robots = TrueRobots.of(analysis.structure, analysis.chosen)
    rng = default_rng(0)
    structure = analysis.structure
    like = structure.nominal[structure.inertial]
    for body in like + robots.scatter[structure.inertial] * rng.standard_normal((200, *like.shape)):
        assert (margin(make_possible(body, like), *natural_scale(like)) > -1e-9).all()
    # Friction stays as tied as the model ties it.
    fc = [structure.base.names.index(f"elbow.Fc{s}") for s in "+-"]
    drawn = np.array([robots.draw(rng) for _ in range(400)])
    at = structure.base.names.index("link2.mx")
    column = structure.columns.index("link2.mx")
    assert drawn[:, at].std() == pytest.approx(robots.scatter[column], rel=0.3)
    assert np.ptp(drawn[:, fc], axis=0).max() == 0.0
