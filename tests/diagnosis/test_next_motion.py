"""From "A or B" to the motion that tells them apart, and how likely it does."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Model, Noise, Preparation, Robot, diagnose
from identifiability.estimation.rules import RULES
from identifiability.logs.prepare.excerpt import prepare_excerpt
from identifiability.regression.structure import Structure
from identifiability.simulation import Campaign, random_trajectory
from identifiability.workflows.diagnose.result import Rival
from identifiability.workflows.excite import find_next
from identifiability.workflows.excite.criteria import Ask, Discrimination
from identifiability.workflows.excite.next_motion import LIKELY, PERIODS, Bench, decision_chance

BASE = ("rigid_body", "viscous_friction", "coulomb_friction")
NOISE = Noise(additive=0.012, correlation=0.9)


def campaign(size=1.0, count=3, **how):
    robot = Robot.load("two-link")
    rng = default_rng(3)
    drawn = [random_trajectory(robot, rng, **how) for _ in range(count)]
    return robot, [replace(m, sin=size * m.sin, cos=size * m.cos) for m in drawn]


def diagnosis(text, kind, value, rivals):
    """What a diagnosis says that found one effect, along logs in which it is hidden."""
    robot, motions = campaign()
    logs = Campaign.of(robot, motions).logs([], NOISE, default_rng(0))
    name, _, place = text.partition(":")[0].partition("@")
    shape = float(text.partition(":")[2] or "nan")
    rivals = tuple(Rival(*f.split("@")) for f in rivals)
    found = SimpleNamespace(place=place, shape=shape, parameters=(f"{place}.{kind}",),
                            values=np.array([value]), rms=1.0, rivals=rivals)  # fmt: skip
    return SimpleNamespace(
        robot=robot, structure=Structure.of(robot, Model.of(*BASE)), model=Model.of(*BASE, text),
        samples=[prepare_excerpt(robot, log, None) for log in logs], preparation=Preparation(),
        effects=(SimpleNamespace(name=name, placements=(found,)),), aliases=(),
    )  # fmt: skip


def ask(d, **options):
    return find_next.__wrapped__(d, evaluations=300, **options)  # no diagnosis is made


def test_non_centrality_is_what_neither_model_nor_any_shape_of_the_rival_explains():
    A = default_rng(0).standard_normal((50, 4))
    A[:, 2] += 2 * A[:, 1]
    own = np.array([1])
    shapes = (np.array([2]), np.array([3]))
    asks = (Ask(own, np.array([3.0]), shapes), Ask(own, np.array([2.0]), (np.empty(0, int),)))
    aim = Discrimination(1, asks)
    G = A.T @ A

    def left(columns):
        return A[:, 1] - A[:, columns] @ np.linalg.lstsq(A[:, columns], A[:, 1], rcond=None)[0]

    expected = [min(9 * np.sum(left([0, k]) ** 2) for k in (2, 3)), 4 * np.sum(left([0]) ** 2)]
    assert_allclose(aim.squares(G[None])[:, 0], expected)
    one = Discrimination(1, asks[:1])
    assert one.figure(float(one.cost(G[None])[0])) == pytest.approx(np.sqrt(expected[0]))
    # What is told apart already weighs little beside what is not.
    both = Discrimination(1, (*asks[:1], replace(asks[0], values=np.array([3000.0]))))
    assert both.cost(G[None])[0] == pytest.approx(one.cost(G[None])[0] - np.log(2) / 2, abs=1e-4)


@pytest.mark.parametrize("square", [2.0, 9.0, 40.0])
def test_a_chance_is_how_often_the_likelihood_ratio_exceeds_the_odds(square):
    rng = default_rng(1)
    W = rng.standard_normal((20, 2))
    y = rng.standard_normal((20_000, 20))
    true = W[:, 0] - W[:, 1] * (W[:, 1] @ W[:, 0]) / (W[:, 1] @ W[:, 1])
    true *= np.sqrt(square / (true @ true))
    y += true  # the rival, whose part of it is taken away already, says nothing
    ratio = 0.5 * (np.sum(y**2, 1) - np.sum((y - true) ** 2, 1))
    chance = float(decision_chance(np.array([square]))[0])
    assert np.mean(ratio > RULES.rival) == pytest.approx(chance, abs=0.015)
    assert chance < decision_chance(np.array([square + 1.0]))[0]


def test_what_a_motion_would_say_is_what_its_logs_say_whatever_its_rate():
    d = diagnosis("quadratic_friction@elbow", "Fq", 0.02, ("stribeck_friction@elbow",))
    _, motions = campaign()
    bench = Bench.of(d)
    last = bench.aim.model + 1  # what is fast, such as shapes of a rival, hangs on the filter
    said = np.diag(bench.known.G)[:last]
    for rate in (1, 4):
        paths = [replace(m, samples=rate * m.samples) for m in motions]
        would = sum(np.diag(bench.along(d, path)) for path in paths)
        assert_allclose(would[:last], said, rtol=0.25)  # filters take ends of short logs


def test_the_fewest_periods_that_are_likely_to_decide_are_asked_for():
    """Larger effects take shorter logs, and none is longer than 32 periods."""
    rivals = ("stribeck_friction@elbow",)
    found = [
        ask(diagnosis("quadratic_friction@elbow", "Fq", value, rivals))
        for value in (0.01, 0.2, 0.5)
    ]
    chances, periods = zip(*((f.chance, f.periods) for f in found), strict=True)
    assert chances[0] < 0.1 < LIKELY < min(chances[1:])
    assert periods[0] == PERIODS > periods[1] > periods[2] == 1
    assert all(f.before < f.chance for f in found)


def test_of_what_its_rival_contains_the_rival_is_taken_as_true():
    found = ask(diagnosis("torque_offset@elbow", "off", 0.1, ("position_torque@elbow",)))
    assert not found.same
    assert found.chance > found.before


def again(robot, motions, found, hidden):
    """The logs that were made, and those of the motion that was asked for."""
    torque = Campaign.of(robot, motions).hidden(hidden)
    both = Campaign.of(robot, [*motions, *[found.excitation.trajectory] * found.periods])
    more = both.hidden(hidden)
    more *= np.linalg.norm(torque) / np.linalg.norm(more[: len(torque)])
    return both.logs(more, NOISE, default_rng(5))


def named(d):
    return [(e.name, e.joints, e.alternatives) for e in d.effects]


QUICK = {"quick": True, "forward": False}


def test_what_is_a_or_b_has_its_true_name_after_the_motion_that_is_asked_for(succeeds, tmp_path):
    """The file of the motion says what it tells apart, with which chance."""
    robot = Robot.load("two-link")
    rng = default_rng([4, 17])
    motions = [random_trajectory(robot, rng, harmonics=1) for _ in range(3)]
    hidden = ["stribeck_friction@elbow=0.025"]
    logs = Campaign.of(robot, motions).logs(hidden, NOISE, default_rng(5))
    paths = [tmp_path / f"run{k}.csv" for k in range(3)]
    for log, path in zip(logs, paths, strict=True):
        log.to_frame().to_csv(path, index=False)
    d = diagnose(robot, logs[:2], logs[2:], **QUICK)
    ((_, _, others),) = named(d)
    assert others
    found = find_next(d)
    assert found.chance > LIKELY
    assert "better than the logs" in replace(found, before=1.0).statement
    after = again(robot, motions, found, hidden)
    after = diagnose(robot, [*after[:2], *after[3:]], after[2], **QUICK)
    assert named(after) == [("stribeck_friction", ("elbow",), ())]
    out = tmp_path / "motion.json"
    argv = ["diagnose", "two-link", *paths[:2], "--validate", paths[2], "--quick"]
    some = ["--effects", "payload", "--fixed", "0.1", "--next", tmp_path / "no.json"]
    done, none = (
        " ".join(succeeds(*argv, *more).output.split()) for more in (["--next", out], some)
    )
    assert "which begins and ends at rest" in done
    told = json.loads(out.read_text())["next"]
    assert set(told["separates"]) == set(found.names)
    assert 0 <= told["before"] < told["chance"] <= 1
    for words in ("What is missing? Nothing", "no.json was not written", "--fixed 0.1 --json"):
        assert words in none
