"""Names under other preparations, rivals of names, aliases, and what is left: numbers alone."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from identifiability.logs import Log
from identifiability.workflows.diagnose.evidence import Bench
from identifiability.workflows.diagnose.gates import CLOCK, Survival
from identifiability.workflows.diagnose.lookalikes import find_aliases, find_rivals
from identifiability.workflows.diagnose.residual import (
    explained_share,
    find_discrepancies,
    smallest_sizes,
)
from identifiability.workflows.diagnose.stress import (
    blur_motion,
    list_variations,
    shift_torque,
    stress_effects,
    white_noise,
)


@pytest.fixture
def rng():
    return np.random.default_rng(6)


# --- stress -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("score", "same", "survived"),
    [(4.61, True, True), (4.59, True, False), (50.0, False, False)],
)
def test_an_effect_survives_at_one_per_cent_and_with_its_sign(score, same, survived):
    """4.6 is −ln .01."""
    s = Survival(variation="filter 20 % lower", score=score, same_sign=same)
    assert s.survived == survived
    assert s.refutes == (not survived)
    for clock in CLOCK:  # a shifted clock warns
        assert not Survival(variation=clock, score=score, same_sign=same).refutes


def test_what_grows_with_the_noise_of_the_motion_does_not_survive():
    grown = Survival(
        variation="twice the noise in the motion", score=50.0, same_sign=True, grown=True
    )
    assert not grown.survived
    assert grown.refutes


def test_the_clock_the_noise_and_the_filter_are_varied(rng):
    asked = []

    def prepare(log, cutoff, change):
        asked.append((log, cutoff, change))
        return "made"

    tau = np.arange(6.0)[:, None]
    log = Log(name="log", joints=("j",), t=np.arange(30) * 0.01, q=np.ones((30, 1)),
              tau=np.ones((30, 1)), dq=None, ddq=None, sha256="")  # fmt: skip
    found = list_variations(10.0, prepare, rng)
    assert list(found) == [
        *CLOCK, "twice the noise in the motion", "filter 20 % lower", "filter 20 % higher",
    ]  # fmt: skip
    from identifiability.logs.prepare import Samples

    samples = Samples("log", None, tau, None, (), "")
    early, late = (found[name](log, samples).tau.ravel().tolist() for name in CLOCK)
    assert early == [1, 2, 3, 4, 5, 5]  # what was recorded later belongs here
    assert late == [0, 0, 1, 2, 3, 4]
    for vary in list(found.values())[2:]:
        assert vary(log, samples) == "made"
    assert [cutoff for _, cutoff, _ in asked] == [None, 8.0, 12.0]
    assert [change(log) is log for *_, change in asked[1:]] == [True, True]
    assert asked[0][2](log) is not log
    # Measured derivatives have no filter to vary.
    assert len(list_variations(None, prepare, rng)) == 3
    np.testing.assert_array_equal(shift_torque(tau, 2).ravel(), [2, 3, 4, 5, 5, 5])


def test_white_noise_is_found_under_any_polynomial_and_added_once_more(rng):
    t = np.linspace(-1, 1, 5000)
    smooth = np.stack([3 + t - 4 * t**3 + t**7, 100 * t**2], axis=1)
    sd = np.array([0.02, 3.0])
    noisy = smooth + sd * rng.standard_normal(smooth.shape)
    np.testing.assert_allclose(white_noise(noisy), sd, rtol=0.08)
    assert (white_noise(smooth) < 1e-10 * 100).all()
    assert white_noise(smooth[:8]).tolist() == [0.0, 0.0]  # too few for differences
    log = Log(name="log", joints=("a", "b"), t=t, q=noisy, tau=noisy, dq=2 * noisy, ddq=None,
              sha256="")  # fmt: skip
    again = blur_motion(log, rng)
    np.testing.assert_allclose(np.std(again.q - noisy, axis=0), sd, rtol=0.1)
    np.testing.assert_allclose(np.std(again.dq - 2 * noisy, axis=0), 2 * sd, rtol=0.1)
    assert again.ddq is None
    np.testing.assert_array_equal(again.tau, noisy)


@pytest.mark.parametrize(("level", "same"), [(30.0, True), (-30.0, False), (0.5, True)])
def test_a_named_effect_is_scored_anew_beside_the_other_names(
    world, candidate, white_noise, level, same
):
    """Its score is that of its level; with the other sign it does not stand, however strong."""
    e = world.basis
    other = world.unit(1.0, 1.0)
    chosen = [
        candidate("a", "j", 7, positive=True),
        candidate("b", "j", 9),
    ]  # columns of the search
    torque = level * e[:, 0] + 50 * other
    rows = world.make(torque, [e[:, 0], other])
    (fares, rest) = stress_effects(
        lambda v: rows, {"any": None}, white_noise(1.0), chosen, [12.0, 50.0],
    )  # fmt: skip
    (s,) = fares
    # Beside the other one, half of whose square is this one, only 1/√2 of the level is left.
    z = level / np.sqrt(2)
    assert s.variation == "any"
    assert s.same_sign == same
    assert s.score == pytest.approx(-np.log(2) - stats.norm.logsf(abs(z)))
    assert s.survived == (level == 30.0)
    assert rest[0].survived


def test_evidence_that_grows_with_the_noise_of_the_motion_speaks_against(
    world, candidate, white_noise
):
    e = world.basis
    rows = world.make(30 * e[:, 0], [e[:, 0]])
    chosen = [candidate("a", "j", 0)]
    variations = dict.fromkeys(("twice the noise in the motion", "any"))
    (whole,) = stress_effects(lambda v: rows, variations, white_noise(1.0), chosen, [30.0])
    for share, grown in ((0.6, True), (0.8, False)):
        (fares,) = stress_effects(
            lambda v: rows, variations, white_noise(1.0), chosen, [30.0], [share * whole[0].score]
        )
        assert [s.grown for s in fares] == [grown, False]


def test_several_columns_have_no_sign(world, candidate, white_noise):
    e = world.basis
    rows = world.make(-40 * e[:, 0], [e[:, 0], e[:, 1]])
    ((s,),) = stress_effects(
        lambda v: rows, {"any": None}, white_noise(1.0), [candidate("ripple", "j", 0, 1)], [+3.0],
    )  # fmt: skip
    assert s.survived


# --- rivals and aliases -----------------------------------------------------------------------


def rivals(world, candidate, torque, columns, similar=0.9, rest=(), **flags):
    rows = world.make(torque, columns)
    options = [candidate(f"f{k}", "j", k, **(flags if k == 1 else {})) for k in range(len(columns))]
    found = find_rivals(
        world.bench(rows, 5).whiten(), options[0], [options[k] for k in rest], options, similar
    )
    return {r.family: r for r in found}, [r.family for r in found]


def test_similarity_is_the_cosine_beside_the_model(world, candidate):
    e = world.basis
    columns = [e[:, 0], world.unit(0.6, 0.8), world.unit(-0.95, 0.0, np.sqrt(1 - 0.95**2)), e[:, 3]]
    found, order = rivals(world, candidate, 20 * e[:, 0], columns)
    assert order == ["f2", "f1", "f3"]
    assert found["f2"].similarity == pytest.approx(0.95)
    assert found["f1"].similarity == pytest.approx(0.6)
    assert found["f3"].similarity == pytest.approx(0.0, abs=1e-9)
    # With e1 in the model what is left of the second is e0 itself.
    columns.append(e[:, 1])
    found, _ = rivals(world, candidate, 20 * e[:, 0], columns, rest=(4,))
    assert found["f1"].similarity == pytest.approx(1.0)
    assert "f4" not in found


def test_two_names_are_undecided_where_they_are_alike_and_explain_about_the_same(world, candidate):
    """Alike above .9, and a likelihood less than e⁴ times smaller."""
    e = world.basis
    near = [e[:, 0], world.unit(0.95, np.sqrt(1 - 0.95**2))]

    def undecided(columns, level, similar=0.9):
        (r,) = rivals(world, candidate, level * e[:, 0], columns, similar)[0].values()
        gap = np.subtract(*(-stats.norm.logsf(level * c) for c in (1.0, e[:, 0] @ columns[1])))
        return r.undecided, gap

    for level, expected in ((5.0, True), (12.0, False)):
        found, gap = undecided(near, level)
        assert (gap < 4.0) == expected
        assert found is expected
    assert undecided(near, 5.0, similar=0.96)[0] is False
    apart = [e[:, 0], world.unit(0.85, np.sqrt(1 - 0.85**2))]
    assert undecided(apart, 2.0)[0] is False


def test_levels_that_act_against_each_other_and_may_not_be_negative_are_no_rivals(world, candidate):
    e = world.basis
    rows = world.make(20 * e[:, 0], [e[:, 0], -world.unit(0.95, 0.3), world.unit(0.95, 0.3)])
    for signs, expected in (((True,) * 3, {"f2"}), ((True, False, True), {"f1", "f2"})):
        options = [candidate(f"f{k}", "j", k, positive=signs[k]) for k in range(3)]
        white = world.bench(rows, 5).whiten()
        assert {r.family for r in find_rivals(white, options[0], [], options, 0.9)} == expected


def test_a_function_without_a_name_is_no_rival_of_a_name(world, candidate):
    e = world.basis
    columns = [e[:, 0], world.unit(0.95, 0.3)]
    assert rivals(world, candidate, 20 * e[:, 0], columns)[1] == ["f1"]
    assert rivals(world, candidate, 20 * e[:, 0], columns, unnamed=True)[1] == []


def test_what_refines_a_name_is_no_rival_of_it(world, candidate):
    e = world.basis
    columns = [e[:, 0], world.unit(0.95, 0.3)]
    assert rivals(world, candidate, 20 * e[:, 0], columns, needs="f0")[1] == []
    assert rivals(world, candidate, 20 * e[:, 0], columns, needs="f7")[1] == ["f1"]


def test_an_alias_is_what_the_model_contains_but_for_three_per_cent(rng, rows_of, candidate):
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
    rows = rows_of(tau, X, D)
    found = {a.family: a for a in find_aliases(rows, options, ("x0", "x1"), 0.03)}
    assert [found[f].structural for f in names] == [True, False, True, False]
    remaining = [found[f].remaining for f in names]
    np.testing.assert_allclose(remaining, [0.029, 0.031, 0.0, 1.0], atol=1e-9)
    assert found["alike"].behind == ("x1",)
    assert found["mixture"].behind == ("x0", "x1")  # the larger share first
    # Of several shapes or columns the most visible one decides.
    shapes = [candidate("f", "j", 0, shape=1.0), candidate("f", "j", 3, 0, shape=2.0)]
    (alias,) = find_aliases(rows, shapes, ("x0", "x1"), 0.03)
    assert alias.remaining == pytest.approx(1.0)
    # Of two columns together it is the most visible of all that they can be, whatever is added to
    # one of them of the other: a spring is no less visible where its rest is far away.
    for rest in (0.0, 1.0, 300.0):
        D[:, :, 3] = (e[3] + rest * e[1]) * size
        pair = candidate("f", "j", 0, 3)
        D[:, :, 0] = mixed(0.0) * size
        (alias,) = find_aliases(rows_of(tau, X, D), [pair], ("x0", "x1"), 0.03)
        assert alias.remaining == pytest.approx(1.0)
        assert not alias.structural
    # Rounding decides no tie: of shapes that are wholly hidden the first is told, of parameters
    # that say as much of it the first.
    for turn in (1.0, -1.0):
        nudge = 1.0 + turn * 1e-14 * rng.standard_normal(len(tau))[:, None]
        D[:, :, 0], D[:, :, 1] = X[:, :, 0] * nudge, X[:, :, 1] / nudge
        D[:, :, 2] = (X[:, :, 0] + 100 * X[:, :, 1]) * nudge
        shapes = [candidate("f", "j", k, shape=float(k)) for k in (0, 1)]
        (alias,) = find_aliases(rows_of(tau, X, D), shapes, ("x0", "x1"), 0.03)
        assert alias.behind == ("x0",)
        (alias,) = find_aliases(rows_of(tau, X, D), options[2:3], ("x0", "x1"), 0.03)
        assert alias.behind == ("x0", "x1")
    # Without a model nothing hides.
    fixed = rows_of(tau, X[:, :, :0], D)
    assert all(a.remaining == pytest.approx(1.0) for a in find_aliases(fixed, options, (), 0.03))


# --- what is left -----------------------------------------------------------------------------


def test_the_smallest_effect_reaches_the_limit_with_a_power_of_four_in_five(world, candidate):
    """z = Φ⁻¹(1 − e^−critical) + .8416 standard errors, as a share of the residual's rms."""
    e = world.basis
    columns = [2 * e[:, 0], world.unit(0.6, 0.8), e[:, 2]]
    rows = world.make(np.zeros(world.rows), columns)
    options = [candidate("a", "j", 0), candidate("b", "j", 1), candidate("c", "j", 2),
               candidate("a", "k", 2)]  # fmt: skip
    white = Bench.whiten(world.bench(rows, 3))
    p, rms = 1e-3, np.array([2.5])
    z = stats.norm.isf(p) + 0.8416
    found = smallest_sizes(rows, white, [options[2]], options, -np.log(p), rms)
    one = z / np.sqrt(world.rows) / 2.5  # rms of a unit vector times z
    assert set(found) == {"a", "b"}
    assert found["a"] == pytest.approx(one)
    assert found["b"] == pytest.approx(one)
    # Beside a name that it resembles an effect must be larger: .8 of it is left.
    found = smallest_sizes(rows, white, [options[0]], options, -np.log(p), rms)
    assert found["b"] == pytest.approx(one / 0.8)


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
    near = np.abs(dq[:, 0]) < 0.15 * np.sqrt(np.mean(dq**2))
    residual = np.where(near, 3.0, 1.0)[:, None] * np.where(rng.random((n, 1)) > 0.5, 1, -1)
    tau = np.full((n, 1), 4.0)
    rows = rows_of(tau, np.zeros((n, 1, 0)), np.zeros((n, 1, 0)), dq=dq)
    (d,) = find_discrepancies(rows, residual, ["j"])
    assert d.joint == "j"
    assert d.reversals == pytest.approx(9.0)
    assert d.rms == pytest.approx(np.sqrt(np.mean(residual**2)))
    assert d.share == pytest.approx(d.rms / 4.0)
    assert d.memory == pytest.approx(1.0, abs=0.3)
    position = SimpleNamespace(x=np.linspace(-1, 1, n))
    rows = rows_of(tau, np.zeros((n, 1, 0)), np.zeros((n, 1, 0)), dq=dq, q=position.x[:, None])
    (d,) = find_discrepancies(rows, np.sign(position.x)[:, None], ["j"])
    assert max(d.explained, key=d.explained.get) == "position"


def test_what_contains_a_name_can_be_all_that_it_can_be(world, candidate):
    """Nothing that is measured speaks for the smaller one; its own part is contained in it."""
    e = world.basis
    rows = world.make(20 * e[:, 0], [e[:, 0], world.unit(0.6, 0.8), e[:, 1], e[:, 3]])
    small, wide, other = (
        candidate("f0", "j", 0),
        candidate("f1", "j", 1, 2),
        candidate("f2", "j", 3),
    )
    white = world.bench(rows, 5).whiten()
    found = {r.family: r for r in find_rivals(white, small, [], [small, wide, other], 0.9)}
    assert found["f1"].similarity == pytest.approx(1.0)
    assert {name: r.contains for name, r in found.items()} == {"f1": True, "f2": False}
    (back,) = find_rivals(white, wide, [], [small, wide], 0.9)
    assert back.similarity == pytest.approx(1.0)
    assert not back.contains
