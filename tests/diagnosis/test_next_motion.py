"""From "A or B" to the motion that tells them apart, and how likely it does."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from identifiability import IdentifiabilityError, Robot, excite
from identifiability.cli import app
from identifiability.simulation import Campaign, Noise, random_trajectory
from identifiability.workflows.diagnose import find_next
from identifiability.workflows.diagnose.decision_chance import aim_at, decision_chance
from identifiability.workflows.excite.criteria import Discrimination, Separation


def aim_of(values=(1.0,), reverse=None):
    """One model column, one effect, and one rival with two shapes."""
    second = (np.array([2]), np.array([3]))
    return Discrimination(
        np.array([1]), np.array([2, 3]), np.array(values), second, np.arange(1, 4), reverse
    )


def test_what_only_the_true_effect_explains_is_its_least_over_the_rivals_shapes():
    rng = np.random.default_rng(0)
    A = rng.standard_normal((50, 4))
    A[:, 2] += 2 * A[:, 1]
    aim, G = aim_of((3.0,)), A.T @ A

    def left(columns):
        return A[:, 1] - A[:, columns] @ np.linalg.lstsq(A[:, columns], A[:, 1], rcond=None)[0]

    squares = [9 * np.sum(left([0, k]) ** 2) for k in (2, 3)]
    assert aim.figure(float(aim.cost(G[None])[0])) == pytest.approx(np.sqrt(min(squares)))
    whole = aim.each[0].squares(G[None])[0][0]
    assert whole == pytest.approx(9 * np.sum(left([0]) ** 2))


def test_a_chance_rises_with_the_effect_and_is_the_mean_over_both_truths():
    G = np.eye(4)
    G[1, 2] = G[2, 1] = 0.5
    weak, strong = (decision_chance(aim_of((size,)), G, 0.9) for size in (0.5, 8.0))
    assert weak < 0.5 < 0.99 < strong
    back = Discrimination(np.array([2]), np.array([1]), np.array([0.5]), (np.array([1]),),
                          np.arange(1, 4))  # fmt: skip
    both = decision_chance(aim_of((8.0,), back), G, 0.9)
    assert both == pytest.approx((strong + decision_chance(back, G, 0.9)) / 2)
    # Names that are alike need a decisive likelihood ratio, others only the larger one.
    G[1, 2] = G[2, 1] = 0.95
    assert decision_chance(aim_of((4.0,)), G, 0.9) < decision_chance(aim_of((4.0,)), G, 0.99) - 0.2


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
    columns, known = np.arange(5), np.eye(5) + 0.1
    aim = Separation(np.array([1]), np.array([2, 3, 4]))
    found = aim_at(SimpleNamespace(criterion=aim), known, [[1], [1, 2]], 0, np.ones(1))
    assert [own.tolist() for own in found.shapes] == [[2], [3, 4]]
    assert set(columns) - set(found.effects.tolist()) == {0}


def test_nothing_is_asked_for_where_nothing_is_undecided():
    with pytest.raises(IdentifiabilityError, match="Nothing that was named is undecided"):
        find_next.__wrapped__(SimpleNamespace(effects=()))


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
        log.to_frame().to_csv(path, index=False)
    out = tmp_path / "motion.json"
    argv = ["diagnose", "two-link", *paths[:2], "--validate", paths[2], "--quick", "--seed", "4"]
    done = CliRunner().invoke(app, [*argv, "--next", str(out)])
    text = " ".join(done.output.split())
    assert done.exit_code == 0, text
    assert "which begins and ends at rest" in text
    told = json.loads(out.read_text())["next"]
    assert 0 <= told["before"] < told["chance"] <= 1
