"""What a motion can never name, where the residual is, and what it depends on: numbers alone."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.workflows.diagnose.naming import determined_alone
from identifiability.workflows.diagnose.problem import find_aliases
from identifiability.workflows.diagnose.rows import explained_share, find_discrepancies


@pytest.fixture
def rng():
    return np.random.default_rng(6)


def test_an_alias_is_what_the_model_contains_but_for_three_per_cent(rng, missing_of, candidate):
    """Joints weigh by the size of their torque, so that N and N·m compare."""
    n = 400
    e = np.linalg.qr(rng.standard_normal((2 * n, 5)))[0].T.reshape(5, n, 2)
    size = np.array([1.0, 100.0])  # torque of the second joint
    tau = size * np.where(rng.random((n, 2)) > 0.5, 1.0, -1.0)
    X = np.stack([e[0] * size, 0.01 * e[1] * size], axis=2)

    def mixed(share):
        return 3 * np.sqrt(1 - share**2) * e[1] + share * 3 * e[2]

    columns = [mixed(0.029), mixed(0.031), 0.8 * e[0] + 0.6 * e[1], e[3]]
    D = np.stack([c * size for c in columns], axis=2)
    names = ("alike", "visible", "mixture", "free")
    options = [candidate(f, "j", k) for k, f in enumerate(names)]

    def aliases(some, model=X, names=("x0", "x1")):
        missing = missing_of(tau, model, D, some)
        return find_aliases(missing, missing.products, names)

    found = {a.family: a for a in aliases(options)}
    assert [found[f].structural for f in names] == [True, False, True, False]
    remaining = [found[f].remaining for f in names]
    np.testing.assert_allclose(remaining, [0.029, 0.031, 0.0, 1.0], atol=1e-9)
    assert found["alike"].behind == ("x1",)
    assert found["mixture"].behind == ("x0", "x1")  # the larger share first
    # Of several shapes or columns the most visible one decides.
    shapes = [candidate("f", "j", 0, shape=1.0), candidate("f", "j", 3, 0, shape=2.0)]
    (alias,) = aliases(shapes)
    assert alias.remaining == pytest.approx(1.0)
    # Of two columns together it is the most visible of all that they can be, whatever is added to
    # one of them of the other: a spring is no less visible where its rest is far away.
    for rest in (0.0, 1.0, 300.0):
        D[:, :, 3] = (e[3] + rest * e[1]) * size
        pair = candidate("f", "j", 0, 3)
        D[:, :, 0] = mixed(0.0) * size
        (alias,) = aliases([pair])
        assert alias.remaining == pytest.approx(1.0)
        assert not alias.structural
    # Rounding decides no tie: of shapes that are wholly hidden the first is told, of parameters
    # that say as much of it the first.
    for _ in range(8):
        nudge = 1.0 + 1e-14 * rng.standard_normal(len(tau))[:, None]
        D[:, :, 0], D[:, :, 1] = X[:, :, 0] * nudge, X[:, :, 1] / nudge
        D[:, :, 2] = (X[:, :, 0] + 100 * X[:, :, 1]) * nudge
        shapes = [candidate("f", "j", k, shape=float(k)) for k in (0, 1)]
        for first, order in (("x0", shapes), ("x1", shapes[::-1])):
            (alias,) = aliases(order)
            assert alias.behind == (first,)
        (alias,) = aliases(options[2:3])
        assert alias.behind == ("x0", "x1")
    # Without a model nothing hides.
    assert all(a.remaining == pytest.approx(1.0) for a in aliases(options, X[:, :, :0], ()))


def test_averages_over_bins_explain_what_they_explain_adjusted_for_their_number(rng):
    n = 1200
    x, noise = rng.uniform(size=n), rng.standard_normal(n)
    index = np.argsort(np.argsort(x)) * 12 // n
    level = np.arange(12.0)[rng.permutation(12)]
    assert explained_share(x, level[index]) == pytest.approx(1.0)
    r = level[index] + 3 * noise
    means = np.array([r[index == k].mean() for k in range(12)])
    between = np.sum((means[index] - r.mean()) ** 2) / np.sum((r - r.mean()) ** 2)
    assert explained_share(x, r) == pytest.approx(1 - (1 - between) * (n - 1) / (n - 12))
    assert explained_share(x, noise) < 0.03
    few = np.repeat([0, 1, 2], 400)  # few values are bins of their own
    assert explained_share(few, few**2 * 1.0) == pytest.approx(1.0)
    assert explained_share(x, np.ones(n)) == 0.0
    assert explained_share(np.zeros(n), noise) == 0.0


def test_a_discrepancy_says_where_the_residual_is(rng, rows_of):
    n = 1000
    dq = np.sin(2 * np.pi * np.arange(n) / 100)[:, None]
    residual = np.where(rng.random((n, 1)) > 0.5, 1.0, -3.0)
    tau = np.full((n, 1), 4.0)
    rows = rows_of(tau, dq=dq)
    (d,) = find_discrepancies(rows, residual, ["j"])
    assert d.joint == "j"
    assert d.rms == pytest.approx(np.sqrt(np.mean(residual**2)))
    assert d.share == pytest.approx(d.rms / 4.0)
    position = SimpleNamespace(x=np.linspace(-1, 1, n))
    rows = rows_of(tau, dq=dq, q=position.x[:, None])
    (d,) = find_discrepancies(rows, np.sign(position.x)[:, None], ["j"])
    assert max(d.explained, key=d.explained.get) == "position"


def test_what_two_columns_say_together_neither_says_alone():
    X = np.random.default_rng(0).standard_normal((50, 3))
    assert determined_alone(X.T @ X).tolist() == [True, True, True]
    X[:, 2] = 3.0 * X[:, 1]
    assert determined_alone(X.T @ X).tolist() == [True, False, False]
