"""From "A or B" to the motion that tells them apart, and how likely it does."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from identifiability import IdentifiabilityError, Robot, excite
from identifiability.cli import app
from identifiability.robot import complete_motion
from identifiability.simulation import Campaign, Noise, random_trajectory
from identifiability.workflows.diagnose import Rules, diagnose, find_next
from identifiability.workflows.diagnose.next_experiment import (
    aim_at,
    decision_chance,
    halve_steps,
    place_all,
)
from identifiability.workflows.excite import find_limits
from identifiability.workflows.excite.criteria import Ask, Discrimination, Reveal

ODDS = Rules().odds


def aim_of(values=(1.0,), *more, nested=False):
    """One model column, one effect, and one rival with two shapes."""
    shapes = (np.array([2]), np.array([3]))
    ask = Ask(0, False, np.array([1]), np.array(values), shapes, nested=nested)
    return Discrimination(np.array([1]), np.array([2, 3]), (ask, *more))


def test_what_only_the_true_effect_explains_is_its_least_over_the_rivals_shapes():
    rng = np.random.default_rng(0)
    A = rng.standard_normal((50, 4))
    A[:, 2] += 2 * A[:, 1]
    aim, G = aim_of((3.0,)), A.T @ A

    def left(columns):
        return A[:, 1] - A[:, columns] @ np.linalg.lstsq(A[:, columns], A[:, 1], rcond=None)[0]

    squares = [9 * np.sum(left([0, k]) ** 2) for k in (2, 3)]
    assert aim.figure(float(aim.cost(G[None])[0])) == pytest.approx(np.sqrt(min(squares)))
    whole = 9 * np.sum(left([0]) ** 2)
    assert aim.squares(G[None], aim.asks[0])[0][0] == pytest.approx(whole)
    similarity = np.sqrt(1 - min(squares) / whole)
    assert aim.similarity(G[None])[0] == pytest.approx(similarity)


def test_a_chance_rises_with_the_effect_and_is_the_mean_over_both_truths():
    G = np.eye(4)
    G[1, 2] = G[2, 1] = 0.5
    weak, strong = (decision_chance(aim_of((size,)), G, ODDS) for size in (0.5, 8.0))
    assert weak < 0.5 < 0.99 < strong
    back = Ask(0, True, np.array([2]), np.array([0.5]), (np.array([1]),))
    both = decision_chance(aim_of((8.0,), back), G, ODDS)
    alone = decision_chance(Discrimination(np.array([2]), np.array([1, 3]), (back,)), G, ODDS)
    assert both == pytest.approx((strong + alone) / 2)
    # The more alike they are, and the surer a name must be, the less is decided.
    apart = decision_chance(aim_of((4.0,)), G, ODDS)
    G[1, 2] = G[2, 1] = 0.95
    alike = decision_chance(aim_of((4.0,)), G, ODDS)
    assert decision_chance(aim_of((4.0,)), G, 2 * ODDS) < alike < apart - 0.2


def test_the_part_of_a_rival_is_decided_where_the_rival_would_show_more():
    """An offset, and a spring with an offset of its own, of which the motion shows more or less."""
    chances = []
    for seen in (0.1, 1.0):
        G = np.eye(4)
        G[1, 2] = G[2, 1] = 1.0
        G[3, 0] = G[0, 3] = np.sqrt(1 - seen**2)  # the model hides the rest
        aim = aim_at(G, [np.array([1])], [[np.array([2, 3])]], 0, np.array([10.0]))
        (ask,) = aim.asks
        assert ask.reverse
        assert ask.nested
        np.testing.assert_allclose(np.abs(ask.values), 10 / np.sqrt(2))
        chances.append(decision_chance(aim, G, ODDS))
    assert chances[0] < 0.1 < 0.9 < chances[1]


def test_hidden_effects_count_alike_however_large_and_none_counts_against():
    A = np.random.default_rng(1).standard_normal((40, 3))
    A[:, 2] = A[:, 0]  # the model says it
    aim = Reveal((np.array([1]), np.array([2])), (np.array([2.0]), np.array([3.0])))
    G = A.T @ A
    Q = A[:, [0]] / np.linalg.norm(A[:, 0])
    seen = 4 * np.sum((A[:, 1] - Q[:, 0] * (Q[:, 0] @ A[:, 1])) ** 2)
    np.testing.assert_allclose(aim.squares(G[None])[:, 0], [seen, 0.0], atol=1e-6)
    assert aim.figure(float(aim.cost(G[None])[0])) < np.sqrt(seen)
    assert aim.cost(1e4 * G[None])[0] < aim.cost(G[None])[0] < aim.cost(0 * G[None] + np.eye(3))[0]


def test_a_motion_may_begin_and_end_at_rest():
    found = excite("two-link", at_rest=True, iterations=3, evaluations=300, seed=2)
    path = found.trajectory
    q, v, a = path.motion(np.array([0.0, path.period]))
    np.testing.assert_allclose(v, 0.0, atol=1e-12)
    np.testing.assert_allclose(a, 0.0, atol=1e-10)
    np.testing.assert_allclose(q[0], q[1], atol=1e-12)
    _, q, v, a = found.motion
    assert np.all(q >= found.limits.low)
    assert np.all(q <= found.limits.high)
    assert np.abs(v).max() > 0.1
    with pytest.raises(IdentifiabilityError, match="at least 2 harmonics"):
        excite("two-link", at_rest=True, harmonics=1)


def test_shapes_of_an_effect_may_have_different_numbers_of_columns():
    known, rival = np.eye(5) + 0.1, [np.array([2]), np.array([3, 4])]
    found = aim_at(known, [np.array([1])], [rival], 0, np.ones(1))
    assert [own.tolist() for own in found.asks[0].others] == [[2], [3, 4]]
    assert found._model(known[None]).tolist() == [0]


def test_a_rival_may_lie_half_way_between_shapes_that_are_searched():
    np.testing.assert_allclose(halve_steps((1.0, 4.0, 16.0)), [1, 2, 4, 8, 16])
    wider = (1.0, 4.0, 16.0, 6.0, 24.0, 96.0)
    found = np.array(halve_steps(wider))
    assert (found[0], found[-1]) == pytest.approx((1.0, 96.0))
    assert np.all(np.diff(found) > 0)
    assert np.diff(np.log(found)).max() == pytest.approx(np.log(2), rel=0.2)


def test_a_rival_of_many_pieces_has_those_that_each_of_its_shapes_has():
    robot, t = Robot.load("six-dof-arm"), np.linspace(0, 1, 50)
    q = 0.4 + 0.3 * np.sin(2 * np.pi * t)[:, None] * np.ones(6)  # from 0.1 to 0.7 rad
    motion = complete_motion(robot, t, q, np.gradient(q, t, axis=0), 0 * q)
    structure = SimpleNamespace(present=())
    d = SimpleNamespace(
        robot=robot, samples=[SimpleNamespace(motion=motion)], structure=structure, fixed=False
    )
    placed, shapes = place_all(d, "position_friction", "joint_4", find_limits(robot, None))
    assert len(placed.parameters(robot)) == sum(len(p.kinds) for p in placed.parts)
    assert len(shapes) == len(placed.parts) > 1


def test_nothing_is_asked_for_where_nothing_is_undecided_or_hidden(diagnosis_of):
    d = replace(diagnosis_of("two-link", effects=("quadratic_friction",)), aliases=())
    with pytest.raises(IdentifiabilityError, match="Nothing that was named is undecided"):
        find_next(d)


def test_what_small_motion_hides_is_shown_by_the_motion_that_is_asked_for():
    robot, rng = Robot.load("two-link"), np.random.default_rng(3)
    drawn = [random_trajectory(robot, rng, harmonics=1) for _ in range(3)]
    motions = [replace(m, sin=0.2 * m.sin, cos=0.2 * m.cos) for m in drawn]
    noise, hidden = Noise(additive=0.012, correlation=0.9), ["joint_stiffness@shoulder=0.05"]
    options = {"effects": ["joint_stiffness"], "quick": True, "forward": False}

    def record(c, torque):
        return c.logs(torque, noise, np.random.default_rng(5))

    first = Campaign.of(robot, motions)
    torque = first.hidden(hidden)
    logs = record(first, torque)
    d = diagnose(robot, logs[:2], logs[2:], **options)
    assert d.effects == ()
    assert ("joint_stiffness", "shoulder") in {(a.family, a.place) for a in d.aliases}
    found = find_next(d, evaluations=300)
    assert found.hidden
    assert "joint_stiffness@shoulder" in found.names
    assert found.before < found.chance
    assert "which these logs cannot tell from the model" in found.statement
    both = Campaign.of(robot, [*motions, *[found.excitation.trajectory] * found.periods])
    again = both.hidden(hidden)
    again *= np.linalg.norm(torque) / np.linalg.norm(again[: len(torque)])
    logs = record(both, again)
    after = diagnose(robot, [*logs[:2], *logs[3:]], logs[2], **options)
    assert [(e.name, e.joints) for e in after.effects] == [("joint_stiffness", ("shoulder",))]


@pytest.mark.everything
def test_the_next_motion_is_written_with_its_chance(tmp_path):
    """Case 4 of the study of next experiments."""
    robot, rng = Robot.load("two-link"), np.random.default_rng([4, 17])
    rng.integers(7), rng.integers(2)
    share, count = rng.choice((0.02, 0.05)), int(rng.choice((1, 2, 3)))
    motions = [random_trajectory(robot, rng, harmonics=count) for _ in range(3)]
    noise = Noise(additive=0.012, correlation=0.9, encoder=2e-5)
    hidden = [f"quadratic_friction@shoulder={share}"]
    logs = Campaign.of(robot, motions).logs(hidden, noise, np.random.default_rng([4, 77]))
    paths = [str(tmp_path / f"run{k}.csv") for k in range(3)]
    for log, path in zip(logs, paths, strict=True):
        log.to_frame().assign(t=1.7e9 + log.t).to_csv(path, index=False)
    out = tmp_path / "motion.json"
    argv = ["diagnose", "two-link", *paths[:2], "--validate", paths[2], "--quick", "--seed", "4"]
    done = CliRunner().invoke(app, [*argv, "--next", str(out)])
    text = " ".join(done.output.split())
    assert done.exit_code == 0, text
    assert "which begins and ends at rest" in text
    assert text.count("the times count from 1970") == 1
    told = json.loads(out.read_text())["next"]
    assert 0 <= told["before"] < told["chance"] <= 1
