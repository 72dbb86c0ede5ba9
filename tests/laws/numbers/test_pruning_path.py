"""The path down and the model of it to use: moves, refusals, pairs, two nats."""

import numpy as np
import pytest
from scipy.stats import f as f_distribution

from identifiability.estimation.estimate import estimate
from identifiability.estimation.evidence import Evidence, Score
from identifiability.workflows.prune.elimination import (
    MoveTest,
    Plan,
    Step,
    best_step,
    choose_step,
    explain,
    find_path,
    good_steps,
    walk,
)
from identifiability.workflows.prune.folds import whiten_regression
from identifiability.workflows.prune.moves import ZERO, Kind, Move, Partition

from .made import gather

COLUMNS = ("a.Fc+", "a.Fc-", "b.m", "c.m")
PAIR = Move(Kind.MERGE, tie=(("a.Fc+", "a.Fc-"),), why="Friction of the same size")


# Partitions


def test_moves_zero_and_tie_columns_and_later_moves_act_on_the_leaders():
    start = Partition.of("abcde")
    tied = start.apply(Move(Kind.TIE, tie=(("b", "d", "e"),)))
    np.testing.assert_array_equal(tied.group, [0, 1, 2, 1, 1])
    assert len(tied) == 3
    assert tied.members(1) == ("b", "d", "e")
    assert tied.ties() == {"*": ["b", "d", "e"]}
    gone = tied.apply(Move(Kind.DROP, ("d",)))  # one of equal columns: all of them
    np.testing.assert_array_equal(gone.group, [0, ZERO, 2, ZERO, ZERO])
    assert gone.zeroed() == ["b", "d", "e"]
    np.testing.assert_array_equal(gone.survivors(), [True, False, True, False, False])
    wider = tied.apply(Move(Kind.TIE, tie=(("a", "d"),)))  # whom it led before comes along
    np.testing.assert_array_equal(wider.group, [0, 0, 2, 0, 0])
    again = gone.apply(Move(Kind.TIE, tie=(("a", "b", "c"),)))  # what is zero stays so
    np.testing.assert_array_equal(again.group, [0, ZERO, 0, ZERO, ZERO])


def test_the_rows_of_a_move_are_what_it_denies():
    start = Partition.of("abc")
    np.testing.assert_array_equal(start.rows(Move(Kind.DROP, ("b",))), [[0, 1, 0]])
    tie = Move(Kind.TIE, tie=(("a", "b", "c"),))
    np.testing.assert_array_equal(start.rows(tie), [[1, -1, 0], [1, 0, -1]])
    assert len(start.apply(tie).rows(tie)) == 0
    both = Move(Kind.ZERO, ("a",), tie=(("b", "c"),))
    np.testing.assert_array_equal(start.rows(both), [[1, 0, 0], [0, 1, -1]])


# Which step is used


def step(density, size, *, kind=Kind.DROP, violations=0, columns=8):
    """Return a step with these densities of folds; `size` parameters are left."""
    group = np.where(np.arange(columns) < size, np.arange(columns), ZERO)
    nothing = np.exp(-np.asarray(density, float))[:, None]  # errors that differ as densities do
    return Step(
        partition=Partition(tuple(f"p{j}" for j in range(columns)), group),
        score=Score(np.asarray(density, float), nothing, np.ones(1), 0.25),
        violations=violations,
        values=np.zeros((2, columns)),
        move=Move(kind, ("x",)),
        evidence=MoveTest(
            cost=0.0, p_value=0.5, sigma_percent=1.0, gain=0.0, gain_se=0.0, either=""
        ),
    )


BEST = np.array([-1.0, -2.0, -3.0, -2.0, -4.0])


def falling(shift, wiggle=0.0):
    """Return densities that are lower by a shift ± wiggle a fold."""
    return BEST - shift / 5 + wiggle * np.array([1.0, -1.0, 0.0, 1.0, -1.0])


def test_the_best_density_is_looked_for_below_what_must_go():
    steps = [
        step(BEST + 1, 8), step(BEST, 7, kind=Kind.UNEXCITED), step(BEST - 1, 6, kind=Kind.FORCED),
        step(BEST - 0.5, 5), step(BEST - 2, 4),
    ]  # fmt: skip
    assert best_step(steps) == 3
    assert best_step(steps[:2]) == 1


def test_the_smallest_within_two_nats_is_chosen():
    """Differences that scatter by 2 a fold: 5 × 2 × √(1/5 + 1/4) is 6.7 nats of standard error."""
    steps = [
        step(falling(1.0), 8), step(BEST, 7), step(falling(1.9, 2.0), 6),
        step(falling(2.1, 2.0), 5), step(falling(6.5, 2.0), 4), step(falling(6.8, 2.0), 3),
    ]  # fmt: skip
    assert choose_step(steps) == 2


def test_of_models_near_the_best_those_with_fewest_forbidden_signs_come_first():
    steps = [
        step(falling(1.0), 8, violations=1), step(BEST, 7), step(falling(0.5), 6, violations=2),
        step(falling(1.5), 5, violations=1), step(falling(9.0), 4),
    ]  # fmt: skip
    assert list(good_steps(steps)) == [1, 3, 0, 2]


# The walk


def problem(phi, samples=640, seed=0, noise=1.0, mix=None):
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(samples, 1, len(phi)))
    if mix is not None:
        W = W @ np.array(mix, float)
    return W, W @ np.array(phi, float) + noise * rng.normal(size=(samples, 1))


def walked(phi, plan=None, columns=COLUMNS, forbidden=(), **options):
    information = gather(*problem(phi, **options), size=10, columns=columns)
    full = estimate(information, "ols")
    whitened = whiten_regression(information, full, np.isin(columns, forbidden))
    return walk(whitened.fit(), plan or Plan())


def lives(path):
    return [{s.partition.columns[g] for g in s.partition.leaders} for s in path.steps]


def test_the_least_costly_goes_first_and_nothing_is_left_in_the_end():
    path = walked([0.05, 3.0, 0.5, 1.5])
    assert [s.move.zero for s in path.steps[1:]] == [
        ("a.Fc+",), ("b.m",), ("c.m",), ("a.Fc-",),
    ]  # fmt: skip
    assert [len(s.partition) for s in path.steps] == [4, 3, 2, 1, 0]


@pytest.mark.parametrize("phi", [[0.05, 3.0, 0.5, 1.5], [1.0, 1.0, 0.5, 1.5], [0.0, 0.0, 1, 2]])
def test_a_joints_two_coulomb_levels_are_never_torn_apart(phi):
    for plan in (Plan(pairs=(PAIR,)), Plan(suggested=(PAIR,), pairs=(PAIR,))):
        path = walked(phi, plan)
        for s in path.steps:
            positive, negative = s.partition.group[:2]
            assert (positive == ZERO) == (negative == ZERO)
        assert len(path.steps[-1].partition) == 0


def test_levels_of_the_same_size_are_merged_and_levels_that_differ_are_not():
    plan = Plan(suggested=(PAIR,), pairs=(PAIR,))
    merged = walked([1.0, 1.0, 0.5, 1.5], plan)
    assert merged.steps[1].move is PAIR
    assert merged.refused == ()
    differ = walked([1.0, 3.0, 0.5, 1.5], plan)
    assert [r.move for r in differ.refused] == [PAIR]
    assert (
        "The data contradict it: the predictive log density of unseen stretches would"
        in differ.refused[0].reason
    )


def tried(move, phi, seed, **options):
    """Return what is said of a suggestion, whether it is made, and whether it forbids a sign."""
    path = walked(phi, Plan(suggested=(move,)), seed=seed, samples=320, **options)
    made = next((s for s in path.steps if s.move is move), None)
    if made is not None:
        return made.evidence, "made", made.violations > path.steps[0].violations
    return path.refused[0].evidence, path.refused[0].reason, None


def test_a_suggestion_is_refused_only_if_density_falls_surely_and_the_difference_is_sure():
    move, seen = Move(Kind.TIE, tie=(("b.m", "c.m"),)), set()
    for seed in range(60):
        e, said, _ = tried(move, [1.0, 1.0, 1.0, 1.25], seed)
        contradicted = e.gain < -e.gain_se and e.p_value < 0.01
        assert said.startswith("The data contradict it") == contradicted
        seen.add((e.gain < -e.gain_se, e.p_value < 0.01))
    # Significance by itself leaves the move to be made.
    assert {(True, True), (False, True)} <= seen


def test_a_suggestion_that_gives_another_parameter_a_forbidden_sign_is_refused_if_it_is_sure():
    """b and c act alike (.8); without b, which is -.3, c has .2 - .8 × .3 = -.04."""
    move, seen = Move(Kind.ZERO, ("b.m",)), set()
    mix = np.eye(4)
    mix[2, 3], mix[3, 3] = 0.8, 0.6
    for seed in range(60):
        e, said, breaks = tried(move, [1.0, 1.0, -0.3, 0.2], seed, mix=mix, forbidden=("c.m",))
        if said == "made":
            assert not (e.p_value < 0.01 and (breaks or e.gain < -e.gain_se))
            seen.add("made although it forbids" if breaks else "made")
        elif "sign that physics forbids" in said:
            assert e.p_value < 0.01
            assert e.gain >= -e.gain_se
            seen.add("refused for the sign")
    assert seen >= {"made", "refused for the sign"}


def test_suggestions_are_tried_merges_first_then_zeros_then_ties():
    zero = Move(Kind.ZERO, ("b.m",))
    tie = Move(Kind.TIE, tie=(("a.Fc+", "c.m"),))
    path = walked([1.0, 1.0, 0.0, 1.0], Plan(suggested=(tie, zero, PAIR), pairs=(PAIR,)))
    assert [s.move for s in path.steps[1:4]] == [PAIR, zero, tie]


def test_what_the_user_forces_goes_first_and_what_is_kept_never():
    forced = Move(Kind.FORCED, ("a.Fc-",))
    path = walked([1.0, 3.0, 0.0, 1.5], Plan(forced=(forced,), kept=frozenset(["b.m"])))
    assert path.steps[1].move is forced
    assert all("b.m" in names for names in lives(path))
    assert lives(path)[-1] == {"b.m"}


def test_the_evidence_of_a_move_is_counted_as_defined():
    W, tau = problem([1.0, 2.0, 0.3, 1.5])
    path = walked([1.0, 2.0, 0.3, 1.5])
    first = path.steps[1]
    assert first.move.zero == ("b.m",)

    def least(A, b):
        x, rss, *_ = np.linalg.lstsq(A, b, rcond=None)
        return x, rss[0]

    A, b = W[:, 0], tau[:, 0]
    rest = [0, 1, 3]
    cost = (least(A[:, rest], b)[1] - least(A, b)[1]) / least(A, b)[1]
    assert first.evidence.cost == pytest.approx(cost, rel=1e-5)
    blocks = 64 * np.arange(10)[:, None]
    at = np.arange(640)  # blocks of ten samples: one to each side is within the noise's memory
    train = (at < blocks - 10) | (at >= blocks + 74)
    x = np.array([least(A[t], b[t])[0][2] for t in train])
    ratio = np.mean(64 / train.sum(1))
    sd = np.sqrt(((x - x.mean()) ** 2).sum() / (10 * ratio))
    z2 = (least(A, b)[0][2] / sd) ** 2
    assert first.evidence.sigma_percent == pytest.approx(100 / np.sqrt(z2), rel=0.2)
    # Hotelling's T² of one number: F with 1 and F - 1 degrees of freedom.
    z2 = (100 / first.evidence.sigma_percent) ** 2
    assert first.evidence.p_value == pytest.approx(f_distribution.sf(z2, 1, 9), rel=1e-3)
    gain = Evidence.of(first.score, path.steps[0].score).density
    assert first.evidence.gain == pytest.approx(gain.value)
    assert first.evidence.gain_se == pytest.approx(gain.se)


@pytest.mark.parametrize(("share", "either"), [(0.97, "c.m"), (0.9, "")])
def test_either_is_said_of_two_parameters_that_are_one_to_these_logs(share, either):
    mix = np.eye(4)
    mix[2, 3], mix[3, 3] = share, np.sqrt(1 - share**2)
    path = walked([5.0, 5.0, 0.01, 1.0], mix=mix)
    dropped = next(s for s in path.steps[1:] if s.move.zero == ("b.m",))
    assert dropped.evidence.either == either


# From information


def test_wishes_are_kept_and_idle_columns_go_first():
    W, tau = problem([1.0, 3.0, 0.0, 1.5])
    W = np.concatenate([W, 2 * W[:, :, :1], 0 * W[:, :, :1]], axis=2)
    names = (*COLUMNS, "d.m", "e.m")
    search = find_path(
        gather(W, tau, size=10, columns=names), np.zeros(6, bool),
        suggested=[Move(Kind.ZERO, ("b.m", "nowhere.m")), Move(Kind.TIE, tie=(("c.m", "d.m"),))],
        forbid=["b.m"], force=["c.m"],
    )  # fmt: skip
    first = search.path.steps[1].move
    assert first.kind is Kind.UNEXCITED
    assert set(first.zero) == {"d.m", "e.m"}
    assert first.why == ("The motion never makes e.m act; either a.Fc+ or d.m can stand for both")
    assert search.path.steps[2].move.zero == ("c.m",)
    assert search.path.steps[2].move.kind is Kind.FORCED
    assert all("b.m" in names for names in lives(search.path))
    assert search.plan.suggested == ()  # forbidden, unknown or alone: nothing is left of them
    assert search.path.steps[0].values.shape[1] == 6


# Words


def test_a_moves_reason_is_said_by_its_evidence():
    def reason(kind, p, gain, spread, either=""):
        move = Move(kind, ("x",), why="Drawn so")
        found = step(BEST, 3)
        evidence = MoveTest(
            cost=0.0, p_value=p, sigma_percent=1.0, gain=gain, gain_se=spread, either=either
        )
        return explain(Step(found.partition, found.score, 0, found.values, move, evidence))

    assert reason(Kind.DROP, 0.051, -2.0, 1.0) == (
        "Not significant (p = 0.051); the predictive log density of unseen stretches falls by "
        "2 ± 1 nats."
    )
    assert reason(Kind.DROP, 0.049, 2.0, 1.0, "y") == (
        "The least costly of what is left (p = 0.049); the predictive log density of unseen "
        "stretches rises by 2 ± 1 nats. These logs hardly tell it from y: either of the two can "
        "stand for both."
    )
    assert "Drawn so; the data do not contradict it (p" in reason(Kind.TIE, 0.06, -2.0, 1.0)
    assert "significant but does not help on unseen" in reason(Kind.TIE, 0.04, -1.0, 1.0)
    assert "speak against it, but not clearly enough" in reason(Kind.TIE, 0.04, -2.0, 1.0)
    assert reason(Kind.FORCED, 0.5, 2.0, 1.0).startswith("Drawn so; the predictive log density")
