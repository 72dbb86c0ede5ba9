"""The rest of a path, and models as reductions of one another."""

import numpy as np
import pytest

from identifiability.regression.reduction import Submodel
from identifiability.report.answers.common import hint_note
from identifiability.workflows.prune import elimination
from identifiability.workflows.prune.elimination import find_path, thin_path

from .made import gather

NAMES = ("a", "b", "c", "d")


@pytest.fixture(scope="module")
def rows():
    """Four columns that partly act alike, the last of them on one actuator only."""
    rng = np.random.default_rng(0)
    W = rng.normal(size=(640, 2, 4)) @ (0.6 * np.ones((4, 4)) + 0.8 * np.eye(4))
    W[:, 1, 3] = 0.0
    return W, W @ [1.0, -2.0, 0.7, 0.3] + rng.normal(size=(640, 2)) * 0.3


def full_model(k=4):
    return Submodel(
        name="full", description="", columns=NAMES[:k], labels=NAMES[:k], units=("kg",) * k,
        M=np.eye(k), fixed=np.zeros(k), nonnegative=np.array([True, False, False, True])[:k],
    )  # fmt: skip


# Models


def test_equal_parameters_of_which_one_cannot_be_negative_cannot_be_negative():
    assert full_model().tied("x", ["b", "d"]).nonnegative.tolist() == [True, True, False]
    assert full_model().tied("x", ["b", "c"]).nonnegative.tolist() == [True, False, True]


def test_of_a_long_path_the_best_and_some_others_are_measured(rows, monkeypatch):
    search = find_path(gather(*rows, columns=NAMES), force=["a"])
    steps = search.steps
    assert len(steps) == 5
    assert thin_path(search, 1) == (search, 1, "")
    monkeypatch.setattr(elimination, "MEASURED", 2)
    thinned, chosen, said = thin_path(search, 3)
    best = sorted(range(1, 5), key=lambda k: -steps[k].density)[:2]
    kept = sorted({0, 1, *best, 3})  # before the search, what must go, the best, and the chosen one
    assert [steps.index(s) for s in thinned.steps] == kept
    assert kept[chosen] == 3
    assert said.startswith(f"Of the 5 models that prune made, the {len(kept)} that predict best")
    assert hint_note(said).level == "note"  # no caveat
