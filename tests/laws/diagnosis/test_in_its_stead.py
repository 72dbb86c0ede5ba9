"""Names against single columns without one: unit columns, and two joints whose motion is known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.foundation.numbers import log_tail
from identifiability.workflows.diagnose.gates import Naming, Step
from identifiability.workflows.diagnose.in_its_stead import Contest, keep_unbeaten
from identifiability.workflows.diagnose.search import _keep

N = 600
#: That nothing is left for sure.
LEFT = SimpleNamespace(unlike=lambda least: False)


def nats(square, columns=1):
    return -float(log_tail(np.array(square), columns))


@pytest.fixture
def contest(world, candidate):
    """One joint: a torque of levels of e0, e1 …, one name, and others, of parts of these."""

    def made(levels, name, others, similar=0.9):
        y = world.basis[:, : len(levels)] @ np.array(levels, float)
        c = candidate("name", "j", 0)
        own = np.column_stack([world.unit(*part) for part in name])
        anything = np.column_stack([world.unit(*part) for part in others])
        return Contest(y, world.model, {c: own}, ((0, anything),), similar), c

    return made


@pytest.mark.parametrize("level", [5.0, 10.0])
def test_it_loses_what_the_tail_of_its_squares_lacks(contest, level):
    """Of a cosine of .8 the name says .64 of the squares, and nothing beside the cause."""
    m, c = contest([level], [(0.8, 0.6)], [(1.0,), (0.0, 1.0)])
    assert m.lost(c) == pytest.approx(nats(level**2) - nats(0.64 * level**2))
    # Of two columns the name pays for the second one.
    m, c = contest([level], [(0.8, 0.6), (0.0, 0.0, 1.0)], [(1.0,)])
    assert m.lost(c) == pytest.approx(nats(level**2) - nats(0.64 * level**2, 2))


def test_what_is_similar_is_no_rival(contest):
    found = [contest([20.0], [(0.8, 0.6)], [(1.0,)], similar) for similar in (0.75, 0.85)]
    lost = [m.lost(c) for m, c in found]
    assert lost[0] == pytest.approx(-nats(256.0))
    assert lost[1] > 50


@pytest.mark.parametrize(("beside", "rivals"), [(2.0, (1, 2)), (2.8, (2,)), (3.5, ())])
def test_what_the_name_is_needed_beside_is_another_cause(contest, beside, rivals):
    """Beside e0 a name of .6 e0 + .8 e1 says the square of the level along e1: 4 nats are 6.4.

    Where it has another column, e2 with nothing along it, they are 8.
    """
    own = (0.6 * 12 + 0.8 * beside) ** 2
    for columns, name in enumerate(([(0.6, 0.8)], [(0.6, 0.8), (0.0, 0.0, 1.0)]), 1):
        m, c = contest([12.0, beside], name, [(1.0,)])
        said = nats(144.0) if columns in rivals else 0.0
        assert m.lost(c) == pytest.approx(said - nats(own, columns))


def test_what_other_names_say_is_theirs(contest, world, candidate):
    m, c = contest([20.0], [(0.8, 0.6)], [(1.0,)])
    right = candidate("right", "j", 1)
    both = Contest(m.y, m.X, {**m.names, right: world.unit(1.0)[:, None]}, m.others, m.similar)
    assert both.lost(c) < 1e-6
    assert both.lost(right) < -50
    # A name that says nothing beside the model loses nothing.
    none = Contest(m.y, m.X, {c: world.model}, m.others, m.similar)
    assert none.lost(c) == -np.inf


@pytest.fixture
def material(rows_of, white_noise):
    """Two joints that move by themselves, with friction; torque and columns are [(joint, f)]."""

    def made(torque, columns, spread=1.0, model=(), root=None, short=False):
        rng, t = np.random.default_rng(0), 0.01 * np.arange(N)
        waves = ((3.1, 0), (7.3, 1), (4.4, 2)), ((2.7, 2), (5.9, 0), (9.1, 1))
        q = np.column_stack([sum(np.sin(w * t + p) for w, p in one) for one in waves])
        dq = np.gradient(q, t, axis=0)
        motion = {"q": q, "dq": dq, "ddq": np.gradient(dq, t, axis=0)}

        def lay_out(several):
            out = np.zeros((N, 2, len(several)))
            for k, parts in enumerate(several):
                for j, f in parts:
                    out[:, j, k] = f(q, dq)
            return out

        X = lay_out([[(0, lambda q, dq: dq[:, 0])], [(1, lambda q, dq: dq[:, 1])], *model])
        tau = spread * rng.standard_normal((N, 2)) + lay_out([torque])[:, :, 0]
        rows = replace(rows_of(tau, X, lay_out(columns), **motion), root=root)
        return SimpleNamespace(
            train=rows, noise=white_noise(1.0, 1.0),
            held=SimpleNamespace(fitted_residual=lambda chosen: tau),
            setting=SimpleNamespace(
                structure=SimpleNamespace(present=frozenset()), fixed=True,
                rules=SimpleNamespace(confusable=0.9),
            ),
            remains=lambda chosen: SimpleNamespace(beside=lambda c: None if short else LEFT),
        )  # fmt: skip

    return made


def speed(size, of=1):
    return lambda q, dq: size * dq[:, of] / dq[:, of].std()


def like_speed(q, dq):
    """At a cosine of .8 to the speed of the second joint: a load of which it is a part."""
    return 0.8 * dq[:, 1] / dq[:, 1].std() + 0.6 * q[:, 1] ** 3 / (q[:, 1] ** 3).std()


def named(*chosen):
    steps = tuple(
        Step(evidence={}, critical=8.0, best=c.group, p_value=0.005, accepted=True) for c in chosen
    )
    return Naming(tuple(chosen), {c.group: 0.005 for c in chosen}, steps)


def test_a_name_gives_way_to_the_speed_that_is_missing(material, candidate):
    wrong, right = candidate("leak", "j", 0), candidate("drag", "j", 0)
    m = material([(0, speed(0.5))], [[(0, like_speed)]])
    kept = keep_unbeaten(m, named(wrong))
    assert kept.chosen == ()
    assert kept.steps[0].reason == "what has no name explains decisively more in its stead"
    assert _keep(m, named(wrong)).chosen == ()
    assert keep_unbeaten(material([(0, speed(0.5))], [[(0, speed(1))]]), named(right)).chosen
    # Of a motion that is too short nobody can say that it leaves anything.
    short = material([(0, speed(0.5))], [[(0, like_speed)]], short=True)
    assert keep_unbeaten(short, named(wrong)).chosen == (wrong,)
    # What every joint has stays, and what resembles the cause where little shows of either.
    basic, other = candidate("leak", "j", 0, basic=True), candidate("name", "j", 1)
    two = material([(0, speed(0.5)), (1, like_speed)], [[(0, like_speed)], [(1, like_speed)]])
    assert keep_unbeaten(two, named(basic, other)).chosen == (basic, other)
    little = material([(0, speed(0.15))], [[(0, like_speed)]])
    assert 0 < Contest.of(little, (wrong,)).lost(wrong) < 4
    assert keep_unbeaten(little, named(wrong)).chosen == (wrong,)


def test_the_name_that_loses_most_goes_and_one_that_is_right_stays(material, candidate):
    wrong, right = candidate("leak", "j", 0), candidate("drag", "k", 1)
    torque = [(0, speed(0.5)), (1, speed(0.5, 0))]
    m = material(torque, [[(0, like_speed)], [(1, speed(1.0, 0))]])
    assert keep_unbeaten(m, named(wrong, right)).chosen == (right,)


def test_a_name_in_the_wrong_joint_gives_way_to_the_cause_in_the_right_one(material, candidate):
    """What a model that couples the joints leaves of a cause shows in the other one as well."""

    def both(q, dq):
        return q[:, 0] * q[:, 1]

    def like_both(q, dq):
        return both(q, dq) + 0.5 * q[:, 0] ** 2 * q[:, 1]

    wrong, cause = candidate("leak", "j", 0), speed(1.0, 0)
    found = [
        material([(1, cause)], [[(0, name)]], model=[[(0, both), (1, cause)]])
        for name in (like_both, both)
    ]
    lost = [Contest.of(m, (wrong,)).lost(wrong) for m in found]
    assert lost[0] > 20
    # What the model has there, too, leaves as much as the cause does: they are one.
    assert lost[1] < 0.1


def test_noise_that_is_larger_than_was_known_decides_less(material, candidate):
    """Three times as large, of three times the torque, it leaves the same to decide."""
    wrong = candidate("leak", "j", 0)
    lost = [
        Contest.of(material([(0, speed(0.2 * s))], [[(0, like_speed)]], s), (wrong,)).lost(wrong)
        for s in (1, 3)
    ]
    assert lost[1] == pytest.approx(lost[0])


def test_values_that_are_known_hide_no_name(material, candidate):
    """What the name is, is a column of the model whose value is known to a millionth."""
    wrong = candidate("leak", "j", 0)
    free, known = (
        material([(0, speed(0.5))], [[(0, like_speed)]], model=[[(0, like_speed)]], root=root)
        for root in (None, np.diag([0.0, 0.0, 1e6])[2:])
    )
    assert Contest.of(free, (wrong,)).lost(wrong) == -np.inf
    assert Contest.of(known, (wrong,)).lost(wrong) > 4
