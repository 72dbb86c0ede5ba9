"""What a name leaves: planted torque, one joint, white noise of unit variance."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from identifiability.effects.path_memory import follow_with_play
from identifiability.foundation.shares import tail_of_sum
from identifiability.workflows.diagnose.complete import keep_complete, keep_one_way
from identifiability.workflows.diagnose.evidence import Bench
from identifiability.workflows.diagnose.gates import Naming, Step
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.leftover import (
    Leftover,
    Remains,
    general_columns,
)

N = 600


@pytest.fixture
def build(rows_of, white_noise):
    """Material of a torque that is made from motion, with named columns beside a plain model."""

    def made(torque, columns, seed=0, rows=N):
        rng = np.random.default_rng(seed)
        t = 0.01 * np.arange(rows)
        q = sum(np.sin(w * t + p) for w, p in ((3.1, 0), (7.3, 1), (4.4, 2)))[:, None]
        dq, ddq = (np.gradient(q, t, axis=0), np.gradient(np.gradient(q, t, axis=0), t, axis=0))
        tau = torque(q, dq, ddq) + rng.standard_normal((rows, 1))
        D = np.stack([c(q, dq, ddq) for c in columns], axis=2)
        made = rows_of(tau, dq[:, :, None], D, q=q, dq=dq, ddq=ddq)
        noise = white_noise(1.0)
        bench = Bench(rows=made, noise=noise, simulated=np.zeros((rows, 1, 0)))
        structure = SimpleNamespace(present=frozenset())
        held = HeldOut(train=made, choosing=None)
        return SimpleNamespace(
            train=made, white=bench.plain, setting=SimpleNamespace(structure=structure),
            bench=bench, held=held,
            remains=lambda chosen: Remains(held, bench, tuple(chosen)),
        )  # fmt: skip

    return made


def named(*chosen):
    steps = tuple(
        Step(evidence={}, critical=8.0, best=c.group, p_value=0.005, accepted=True) for c in chosen
    )
    return Naming(tuple(chosen), {c.group: 0.005 for c in chosen}, steps)


def cubic(q, dq, ddq):
    return q**3 / 4


def dry(q, dq, ddq):
    return np.sign(dq)


def like_dry(q, dq, ddq):
    return np.sign(dq) + 1.5 * np.sign(q)


def test_the_right_name_leaves_nothing_and_one_that_resembles_it_leaves_more(build, candidate):
    right, similar = candidate("dry", "j", 0), candidate("like", "j", 1)
    m = build(dry, [dry, like_dry])
    good, bad = (m.remains((c,)).beside(c) for c in (right, similar))
    # The squared length of what the model does not have of it, within three standard deviations.
    X, own = m.train.X[:, 0, 0], m.train.D.take([0])[:, 0, 0]
    square = own @ own - (own @ X) ** 2 / (X @ X)
    assert good.explained == pytest.approx(square, abs=6 * np.sqrt(square))
    assert good.p_value > 0.05
    assert abs(good.left) < 60
    assert bad.p_value < 1e-6
    assert bad.left > bad.explained
    assert keep_complete(m, named(right)).chosen == (right,)
    kept = keep_complete(m, named(similar))
    assert kept.chosen == ()
    assert (kept.steps[0].accepted, kept.steps[0].reason) == (
        False, "more is left in its joint than it explains",
    )  # fmt: skip


def test_beside_the_right_name_another_true_one_stays(build, candidate):
    first, second = candidate("dry", "j", 0), candidate("cubic", "j", 1)
    m = build(lambda *x: dry(*x) + cubic(*x), [dry, cubic])
    assert keep_complete(m, named(first, second)).chosen == (first, second)
    # Alone each has what the other one explains left beside it; the smaller one goes.
    alone = build(lambda *x: dry(*x) + 3 * cubic(*x), [dry, cubic])
    assert keep_complete(alone, named(first)).chosen == ()
    assert keep_complete(alone, named(second)).chosen == (second,)


def test_what_the_model_has_of_a_name_is_not_explained_by_it(build, candidate):
    """A second column that is the model's own adds nothing but a degree of freedom."""
    m = build(lambda q, dq, ddq: dry(q, dq, ddq) + 1e3 * dq, [dry, lambda q, dq, ddq: 3.0 * dq])
    found = [
        m.remains((c,)).beside(c).explained
        for c in (candidate("one", "j", 0), candidate("both", "j", 0, 1))
    ]
    assert found[1] == pytest.approx(found[0], rel=1e-9)


def test_what_every_joint_has_goes_for_nothing_that_is_left(build, candidate):
    basic = candidate("dry", "j", 0, basic=True)
    m = build(lambda *x: dry(*x) + 3 * cubic(*x), [dry])
    assert keep_complete(m, named(basic)).chosen == (basic,)


def test_what_builds_up_over_a_way_after_each_turn_is_asked_for(build):
    """A spring that slips hangs on the way alone; nothing of the motion now says what it does."""
    rows = build(dry, [dry]).train
    q, F = rows.q[:, 0], general_columns(rows, rows.tau, 0)
    F = np.column_stack([F, rows.D.take([0])[:, 0]])
    for share in (0.02, 0.08):
        slips = q - follow_with_play(q, share * np.ptp(q), np.sign(q[1] - q[0]))
        left = slips - F @ np.linalg.lstsq(F, slips)[0]
        assert left.std() < 1e-9 * slips.std()


def test_joints_of_a_closed_chain_that_drag_one_another_do_not_leak(candidate):
    def leak(place, **flags):
        flags = {"origin": lambda effect, robot: 0, **flags}
        return candidate("leak", place, 0, **flags)

    def kept(*chosen, passive=("hinge",)):
        structure = SimpleNamespace(robot=SimpleNamespace(passive=passive), present=())
        m = SimpleNamespace(setting=SimpleNamespace(structure=structure))
        return keep_one_way(m, named(*chosen)).chosen

    both, other = (leak("i"), leak("j")), candidate("dry", "j", 1)
    assert kept(*both, other) == (other,)
    assert kept(*both, passive=()) == both
    assert kept(both[0], other) == (both[0], other)
    for flags in ({"against": "load"}, {"unnamed": True}):
        alike = (leak("i", **flags), leak("j", **flags))
        assert kept(*alike) == alike


def test_few_rows_say_nothing(build, candidate):
    similar = candidate("like", "j", 0)
    m = build(lambda *x: 3 * dry(*x), [like_dry], rows=60)
    assert m.remains((similar,)).beside(similar) is None
    assert keep_complete(m, named(similar)).chosen == (similar,)
    assert not m.remains(()).anything


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
def test_what_is_left_is_a_share_of_what_the_model_leaves(build, size):
    """Beside noise of unit variance; the standard error of ten draws is below .012."""
    drawn = [build(lambda *x: size * cubic(*x), [dry], seed) for seed in range(10)]
    X, curve = drawn[0].train.X[:, 0, 0], size * cubic(drawn[0].train.q, None, None)[:, 0]
    square = (curve @ curve - (curve @ X) ** 2 / (X @ X)) / N
    left = [m.remains(()).joints[0] for m in drawn]
    assert np.mean([x.share for x in left]) == pytest.approx(square / (1 + square), abs=0.04)
    assert np.mean([x.squares for x in left]) == pytest.approx(N * square, rel=0.15)


def test_noise_alone_leaves_something_as_often_as_its_level_says(build):
    """Five per cent of 200: between 2 and 19 within 1e-3; what is there is found."""
    found = sum(build(lambda q, *_: 0 * q, [dry], seed).remains(()).anything for seed in range(200))
    assert 2 <= found <= 19
    assert build(cubic, [dry]).remains(()).anything


@pytest.mark.parametrize(
    ("explained", "left", "p", "outweighs"),
    [(100.0, 101.0, 0.009, True), (100.0, 99.0, 0.009, False), (100.0, 200.0, 0.011, False),
     (-1.0, 30.0, 1e-5, True)],
)  # fmt: skip
def test_more_must_be_left_than_is_explained_and_surely(explained, left, p, outweighs):
    assert Leftover(explained, left, p).outweighs == outweighs
    assert replace(Leftover(explained, left, p), p_value=0.5).outweighs is False


@pytest.mark.parametrize("weights", [np.ones(40), np.append(np.ones(30), 6.0)])
def test_the_tail_of_a_sum_of_squares_goes_on_beyond_its_draws(weights):
    rng = np.random.default_rng(0)
    many, few = (rng.chisquare(1, (n, len(weights))) @ weights for n in (100_000, 398))
    for p in (0.05, 0.02):  # of 398 draws 20 ± 4 and 8 ± 3 are larger
        value = float(np.quantile(many, 1 - p))
        assert tail_of_sum(value, few) == pytest.approx(p, rel=0.8)
    assert 0 < tail_of_sum(2 * float(many.max()), few) < 1e-6


def test_a_name_stays_where_noise_of_a_memory_nobody_knows_leaves_as_much(build, candidate):
    """Slow functions find something in noise that is slower than it is taken to be."""
    right, rng = candidate("dry", "j", 0), np.random.default_rng(5)
    slow = signal.lfilter([1.0], [1.0, -0.7], rng.standard_normal((N, 400)), axis=0)
    m = build(lambda *x: 0.5 * dry(*x) + slow[:, :1], [dry])
    known = Remains(m.held, m.bench, (right,)).beside(right)
    m.bench = replace(m.bench, simulated=slow[:, None, 1:])
    unknown = Remains(m.held, m.bench, (right,)).beside(right)
    assert (known.left, known.explained) == (unknown.left, unknown.explained)
    assert known.p_value < 1e-3
    assert unknown.p_value > 0.02
