"""What must be true of any diagnosis: an arm on known motion, effects and noise that are known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from identifiability.effects.effect import measure_spans
from identifiability.workflows.diagnose import Rules
from identifiability.workflows.diagnose.conclude import (
    conclude,
    find_rivals,
    lack_of_fit,
    null_odds,
)
from identifiability.workflows.diagnose.gap import Gap
from identifiability.workflows.diagnose.hypothesis import OVER_SPEED, Hypothesis
from identifiability.workflows.diagnose.verdict import (
    REFUTED,
    WORSE,
    Fitted,
    Judged,
    Verdict,
    moderate,
    of_few,
    refute_worse,
)
from identifiability.workflows.diagnose.words import contradiction

SCALED = ("torque_offset", "joint_stiffness", "stribeck_friction", "torque_scale")
SPRING = {"joint_stiffness@elbow": 0.05}
STRIBECK = {"stribeck_friction@shoulder:0.5": 0.05}
RIPPLE = {"position_ripple@elbow:0.6": 0.03}
OVER = ("stribeck_friction", "rising_friction", "sigmoid_friction", "quadratic_friction")


@pytest.mark.parametrize("seed", range(8))
def test_nothing_is_named_where_nothing_is_hidden(arm, seed):
    assert arm.names(*arm.settled(arm.samples(seed=seed))) == []


@pytest.mark.parametrize(
    ("hidden", "names"),
    [
        (SPRING, [("joint_stiffness", "elbow")]),
        (STRIBECK, [("stribeck_friction", "shoulder")]),
        (RIPPLE, [("position_ripple", "elbow")]),
        ({**SPRING, **STRIBECK}, [("joint_stiffness", "elbow"), ("stribeck_friction", "shoulder")]),
        (dict.fromkeys(("torque_offset@shoulder", "torque_offset@elbow"), 0.1),
         [("torque_offset", "elbow"), ("torque_offset", "shoulder")]),
    ],
)  # fmt: skip
def test_what_is_hidden_is_named_where_it_is_and_nothing_else(arm, hidden, names):
    search, verdict = arm.settled(arm.samples(hidden))
    assert arm.names(search, verdict) == names
    for k, judged in verdict.judged.items():
        assert judged.odds >= search.problem.setting.rules.odds
        assert judged.unseen > 0
        # Of what is true scores scatter as noise lets them: 32 blocks, three of their errors.
        assert 1.0 <= judged.scatter < 1.0 + 3 * np.sqrt(2 / 32)
        assert search.problem.candidates[k].group in names


def test_a_shape_that_lies_between_is_found(arm):
    for shape in (0.45, 0.52, 0.6):
        search, verdict = arm.settled(arm.samples({f"position_ripple@elbow:{shape}": 0.05}))
        (k,) = verdict.hypothesis.parts
        assert search.problem.candidates[k].shape == pytest.approx(shape, rel=0.02)


def test_a_forbidden_sign_is_no_name(arm):
    """A spring that pushes away from its rest, a friction that drives: no such effect."""
    for text in SPRING, STRIBECK:
        against = {name: -level for name, level in text.items()}
        search, verdict = arm.settled(arm.samples(against), [next(iter(text)).partition("@")[0]])
        assert arm.names(search, verdict) == []


def test_one_curve_of_friction_over_speed_has_one_name(arm):
    for text in ("stribeck_friction@shoulder:0.5", "sigmoid_friction@shoulder:0.8"):
        search, verdict = arm.settled(arm.samples({text: 0.05}), OVER)
        assert len(verdict.hypothesis.parts) == 1
        group = search.catalogue.of[verdict.hypothesis.parts[0]]
        assert group in {(OVER_SPEED, "shoulder"), ("quadratic_friction", "shoulder")}


@pytest.mark.parametrize("hidden", [{}, {**SPRING, **STRIBECK}])
def test_units_order_and_cuts_of_logs_change_no_answer(arm, hidden):
    given = arm.samples(hidden)

    def told(samples, factor=1.0):
        search, verdict = arm.settled(samples)
        p, parts = search.problem, verdict.hypothesis.parts
        value = {p.candidates[k].group: p.solve([*(o for o in parts if o != k), k], verdict.view)
                 [0][-1] / factor for k in parts}  # fmt: skip
        odds = {p.candidates[k].group: verdict.judged[k].odds for k in parts}
        return value, odds, p.rows.joints

    value, odds, _ = told(given)
    assert len(value) == len(hidden)
    for samples, factor in (
        ([replace(s, tau=1e3 * s.tau) for s in given], 1e3),  # N·mm
        ([given[1], given[0], given[2]], 1.0),
    ):
        found, other, _ = told(samples, factor)
        assert found == pytest.approx(value, rel=1e-3)
        assert other == pytest.approx(odds, rel=1e-3, abs=0.1)
    # In two logs it is the same motion but for one transition: values move within their errors.
    found, other, _ = told([*arm.cut(given[0], 387), *given[1:]])
    assert found == pytest.approx(value, rel=0.02)
    assert other == pytest.approx(odds, rel=0.05)


def test_a_faster_clock_finds_the_same(arm):
    """Of twice the samples with independent noise each the names are the same."""
    twice = type(arm)(step=0.005)
    assert arm.names(*arm.settled(arm.samples(SPRING))) == twice.names(
        *twice.settled(twice.samples(SPRING))
    )


def test_no_name_stands_that_makes_stated_torque_of_unseen_motion_surely_worse(arm):
    """Whatever its likelihood: where noise remembers much it does not see levels."""
    rng, against = np.random.default_rng(0), {name: -x for name, x in SPRING.items()}
    search, right = arm.settled(arm.samples(SPRING))
    (k,) = right.hypothesis.parts
    assert refute_worse(search, right, rng) == right
    other, _ = arm.settled(arm.samples([SPRING, SPRING, against]))
    likely = replace(right.judged[k], unseen=5.0)
    view = other.problem.settled((k,))
    found = refute_worse(other, Verdict(right.hypothesis, view, {k: likely}, {}), rng)
    assert found.hypothesis.parts == ()
    assert found.refuted == {k: likely}
    assert found.refuted[k].why == WORSE


def test_unseen_motion_refutes_a_name_that_does_harm_there(arm):
    """The fitted logs have it, the unseen one has the opposite: nothing stands in the model."""
    samples = arm.samples([SPRING, SPRING, {name: -x for name, x in SPRING.items()}])
    search, verdict = arm.settled(samples)
    assert verdict.hypothesis.parts == ()
    gone = {search.problem.candidates[k].group: j for k, j in verdict.refuted.items()}
    assert ("joint_stiffness", "elbow") in gone
    assert gone["joint_stiffness", "elbow"].refuted
    # Beside it another name, that unseen motion shows, stands.
    samples = arm.samples([{**SPRING, **STRIBECK}] * 2 + [STRIBECK])
    assert arm.names(*arm.settled(samples)) == [("stribeck_friction", "shoulder")]


def test_no_name_makes_the_unseen_motion_of_its_joints_worse(arm):
    """Whatever each log has: what is in the model at the end has a smaller error there."""
    rng = np.random.default_rng(7)
    texts = [*SPRING, *STRIBECK, *RIPPLE]
    for seed in range(2):
        each = [{t: rng.normal() * 0.05 for t in texts} for _ in range(3)]
        search, verdict = arm.settled(arm.samples(each, seed=seed))
        p, h = search.problem, verdict.hypothesis
        for k, judged in verdict.judged.items():
            two = (p.residual(p.shown, parts, verdict.view)
                   for parts in (h.without({k}).parts, h.parts))  # fmt: skip
            gap = Gap(p.shown, np.stack(list(two), axis=2)).at(p.acts(k))
            before, after = gap.error_over_joints()
            assert after < before
            assert judged.unseen > 0


def test_a_part_stands_where_it_is_sure_and_shown():
    rules = Rules()
    sure = Judged(odds=rules.odds, scatter=1.0, unseen=0.1)
    # What unseen motion by itself has is no wrong name, but a value that does not hold.
    other, wrong = (replace(sure, unseen=-0.1, alone=a) for a in (0.1, -0.1))
    assert other.refuted
    assert other.why == "unseen motion has it with another value"
    assert wrong.why == "unseen motion is likelier without it"
    assert sure.stands(rules.odds)
    for spoilt in ({"odds": rules.odds - 0.1}, {"unseen": -0.1}):
        assert not replace(sure, **spoilt).stands(rules.odds)
    assert rules.odds == pytest.approx(np.log(19.0))
    # Motion in which its joints have no torque cannot refute it.
    assert replace(sure, asked=False, unseen=-1.0).stands(rules.odds)


def test_scores_that_change_from_stretch_to_stretch_are_divided_by_it(arm):
    """Of a spring that comes and goes every second its evidence is less, and never more."""
    samples = arm.samples(SPRING)
    lever = arm.samples({"joint_stiffness@elbow": 0.4}, noise=0.0)
    none = arm.samples(noise=0.0)
    wild = []
    for s, w, o in zip(samples, lever, none, strict=True):
        sign = np.where(np.floor(s.motion.t) % 2 > 0, 1.0, -1.0)[:, None]
        wild.append(replace(s, tau=s.tau + sign * (w.tau - o.tau)))
    found = []
    for given in (samples, wild):
        search = arm.search(given, ["joint_stiffness"])
        k = next(n for n, c in enumerate(search.problem.candidates) if c.place == "elbow")
        view = search.problem.settled([k])
        scatter, _ = Fitted(search.problem, [k], view).scatter(k)
        found.append(scatter)
    assert found[0] < 1.8
    assert found[1] > 3.0


def test_predictive_odds_are_the_ratio_of_dense_densities(arm):
    """Of unseen torque given the fitted one, with a part over without."""
    small = type(arm)(seconds=0.8)
    search = small.search(small.samples(SPRING), ["joint_stiffness"])
    p = search.problem
    k = next(n for n, c in enumerate(p.candidates) if c.place == "elbow")
    view = p.view([])
    at = p.columns([k])

    # Squares of unseen errors may be larger than those of noise: that divides what they say.
    errors = [e / np.sqrt(t) for e, t in zip(p.errors(p.unseen, [k], view), view.tempered,
                                             strict=True)]  # fmt: skip
    scale = {id(p.fitted): 1.0, id(p.unseen): max(1.0, np.mean(np.concatenate(errors) ** 2))}

    def contrasts(*where):
        blocks = [w.whitened(j, int(view.steps[j]), at) / np.sqrt(view.tempered[j] * scale[id(w)])
                  for w in where for j in range(2)]  # fmt: skip
        y, X, D = np.split(np.concatenate(blocks), [1, -1], axis=1)
        U, s, _ = np.linalg.svd(X, full_matrices=True)
        K = U[:, int(np.sum(s > 1e-9 * s[0])) :]
        y, D = K.T @ y[:, 0], K.T @ D * p.sizes[at]
        one, none = (stats.multivariate_normal(np.zeros(len(y)), V)
                     for V in (np.eye(len(y)) + D @ D.T, np.eye(len(y))))  # fmt: skip
        return float(one.logpdf(y) - none.logpdf(y))

    expected = contrasts(p.fitted, p.unseen) - contrasts(p.fitted)
    fitted = Fitted(p, [k], view)
    assert fitted.foretold() == pytest.approx(expected, abs=1e-4)
    assert fitted.foretold(k) == pytest.approx(expected, abs=1e-4)
    assert fitted.foretold(k, alone=True) == pytest.approx(contrasts(p.unseen), abs=1e-4)
    assert Fitted(p, [], view).foretold() == 0.0


def test_weights_of_all_names_for_one_place_sum_to_one(arm):
    effects = (*OVER, "joint_stiffness", "free_spring", "torque_offset", "position_ripple")
    for hidden in (STRIBECK, {"stribeck_friction@shoulder:0.5": 0.006}):
        search = arm.search(arm.samples(hidden), effects)
        h, view = search.run(Hypothesis())
        for k in h.parts:
            weight, rivals = find_rivals(search, h, view, k, 1.0)
            total = weight + sum(r.weight for r in rivals)
            assert 0.0 <= weight <= 1.0
            assert total == pytest.approx(1.0, abs=1e-6) or total < 1.0
            # What is undecided and what has the name are together as sure as a name must be.
            sure = weight + sum(r.weight for r in rivals if r.undecided)
            assert sure >= 0.9


def test_what_is_alike_in_the_motion_shares_the_name(arm):
    """A spring about another rest is a spring and an offset: the rest is what tells them."""
    search, verdict = arm.settled(arm.samples(SPRING), ("joint_stiffness", "free_spring"))
    (k,) = verdict.hypothesis.parts
    weight, rivals = find_rivals(search, verdict.hypothesis, verdict.view, k, 1.0)
    (other,) = [r for r in rivals if r.place == "elbow"]
    assert other.contains
    assert other.similarity == pytest.approx(1.0, abs=1e-6)
    assert weight > other.weight


@pytest.mark.parametrize("place", ["shoulder", "elbow"])
def test_names_that_are_one_in_the_motion_are_each_as_likely(arm, place):
    """One joint's torque too large is the other's too small, with other masses."""
    same = type(arm)(model=(*arm.structure.model.texts, "actuator_inertia"))
    for level in (0.3, 1.0):
        hidden = {f"torque_scale@{place}": level}
        search, verdict = same.settled(same.samples(hidden, noise=0.1), SCALED)
        (k,) = verdict.hypothesis.parts
        weight, rivals = find_rivals(search, verdict.hypothesis, verdict.view, k, 1.0)
        other = max(rivals, key=lambda r: r.weight)
        assert {search.problem.candidates[k].place, other.place} == {"shoulder", "elbow"}
        assert other.family == "torque_scale"
        assert other.undecided
        assert max(weight, other.weight) < 0.75


def test_a_name_that_was_not_sure_beside_a_part_is_its_rival(arm):
    """Where both were there and neither was sure, the one that went may be the right one."""
    right, sure = [], []
    for place in ("shoulder", "elbow"):
        for level, seed in ((0.1, 0), (0.1, 1), (-0.1, 1)):
            hidden = {f"torque_scale@{place}": level}
            samples = arm.samples(hidden, noise=0.1, seed=seed)
            search, verdict = arm.settled(samples, SCALED)
            (k,) = verdict.hypothesis.parts
            weight, rivals = find_rivals(search, verdict.hypothesis, verdict.view, k, 1.0)
            (other,) = [r for r in rivals if r.family == "torque_scale"]
            assert other.weight > 0.01
            evidence = search.steps[0].evidence
            one, two = (evidence["torque_scale", x] for x in ("shoulder", "elbow"))
            assert weight < 0.9 or abs(one - two) > 1.0
            right.append(search.problem.candidates[k].place == place)
            sure.append(weight)
    # What is stated with some weight is right as often, three errors apart.
    assert abs(sum(right) - sum(sure)) < 3 * np.sqrt(sum(w * (1 - w) for w in sure))


def test_what_a_name_says_beside_a_part_is_nothing_against_it(arm):
    """Of two effects that do different things each is certain, whichever is there alone."""
    search, verdict = arm.settled(arm.samples({**SPRING, "torque_offset@elbow": 0.05}))
    assert len(verdict.hypothesis.parts) == 2
    for k in verdict.hypothesis.parts:
        view = search.problem.settled((k,))
        weight, _ = find_rivals(search, Hypothesis((k,), (0.0,)), view, k, 1.0)
        assert weight > 0.95


def test_a_conclusion_says_what_stands_and_what_is_refuted(arm):
    samples = arm.samples([{**SPRING, **STRIBECK}] * 2 + [STRIBECK])
    search, verdict = arm.settled(samples)
    rng = np.random.default_rng(0)
    null = null_odds(search, 99, rng)
    assert np.quantile(null, 0.95) < search.problem.setting.rules.odds
    d = conclude(search, verdict, null, rng)
    assert [(e.name, e.joints) for e in d.effects] == [("stribeck_friction", ("shoulder",))]
    assert [(e.name, e.joints) for e in d.refuted] == [("joint_stiffness", ("elbow",))]
    assert d.held_after < d.held_before
    assert d.effects[0].p_value == 0.01
    assert d.effects[0].weight > 0.95
    assert {text.partition(":")[0] for text in d.model.texts} - set(d.base) == {
        "stribeck_friction@shoulder"
    }
    for j, left in enumerate(d.remainder.joints):
        assert left is None or 0 <= left.share <= 1, j


def test_parts_of_a_conclusion_are_weighed_beside_shapes_that_came_later(arm):
    """A view that was made before the search tried further shapes says what a later one does."""
    search = arm.search(arm.samples(RIPPLE))
    p = search.problem
    k = next(n for n, c in enumerate(p.candidates) if c.group == ("position_ripple", "elbow"))
    h = Hypothesis((k,), (0.0,))
    before = p.settled(h.parts)
    value = before.evidence.log_bayes(p.columns(h.parts))
    own = p.candidates[k]
    more = [replace(own, shape=x, effect=own.family.at(x, own.place)) for x in (0.55, 0.61)]
    new = p.extend(more)
    assert before.evidence.log_bayes(p.columns(h.parts)) == pytest.approx(value)
    after = replace(before, sizes=before.typical)
    for rest in ([], [k]):
        np.testing.assert_array_equal(search.gains(rest, before), search.gains(rest, after))
    assert np.isfinite(search.gains([], before)[list(new)]).all()
    lack_of_fit(search, h, before, 1)


def test_parts_that_are_alike_share_what_they_know_of_their_scatter():
    """Moderated scatter has less error than that of each part, and knows how little it knows."""
    rng = np.random.default_rng(0)
    blocks = np.full(7, 5.0)
    alike = rng.chisquare(blocks, (300, 7)) / blocks
    found = [moderate(s, blocks) for s in alike]
    error = np.mean([(s - 1.0) ** 2 for s, _ in found])
    assert error < 0.5 * np.mean((alike - 1.0) ** 2)
    assert all((b <= blocks.sum() + 1e-9).all() and (b >= blocks).all() for _, b in found)
    assert np.median([b[0] for _, b in found]) > 15
    # Parts that differ by more than few blocks explain keep what is their own.
    unlike = np.array([0.5, 1.0, 2.0, 10.0])
    own, known = moderate(unlike, np.full(4, 200.0))
    np.testing.assert_allclose(own, unlike, rtol=0.05)
    np.testing.assert_allclose(known, 200.0, rtol=0.05)
    np.testing.assert_array_equal(moderate(unlike[:1], blocks[:1]), (unlike[:1], blocks[:1]))


@pytest.mark.parametrize("blocks", [4.0, 10.0, 60.0])
def test_evidence_of_a_few_blocks_is_as_rare_as_students_score(blocks):
    """And of many blocks it is what it is."""
    for score in (1.0, 3.0, 6.0):
        rare = stats.t.sf(score, blocks)
        normal = stats.norm.isf(rare)
        assert np.sqrt(2 * of_few(0.5 * score**2, blocks)) == pytest.approx(normal, rel=0.03)
        assert of_few(0.5 * score**2, 1e7) == pytest.approx(0.5 * score**2, rel=1e-3)


@pytest.mark.parametrize(
    ("why", "odds", "after", "said"),
    [
        (REFUTED, -0.4, 0.055, "is not confirmed"),
        (REFUTED, -5.0, 0.055, "is refuted"),
        (WORSE, 10.0, 0.045, "is left out"),
        (WORSE, 10.0, 0.065, "is refuted"),
        (WORSE, -1.0, 0.055, "is refuted"),
    ],
)
def test_a_name_is_called_refuted_only_where_unseen_motion_speaks_against_it(
    why, odds, after, said
):
    shown = SimpleNamespace(odds=odds, before=0.06, after=after)
    assert contradiction(SimpleNamespace(why=why, shown=shown), Rules().odds) == said


SMOOTH = ("sigmoid_friction", "rising_friction")


@pytest.mark.parametrize("family", SMOOTH)
def test_neither_grid_nor_level_prefers_one_of_two_names_for_a_curve(arm, family):
    """One has the level of Coulomb friction in it, and no shape of its grid need be the true one.

    Their share of the torque is the same; what is beyond the model's Coulomb friction is compared.
    """
    speed = measure_spans(arm.robot, arm.motions[:2])["elbow"].rms_speed
    for share in (0.1, 0.14, 0.2, 0.28):
        hidden = {f"{family}@elbow:{share * speed}": 0.3}
        search, verdict = arm.settled(arm.samples(hidden, noise=0.03, seed=1), SMOOTH)
        assert arm.names(search, verdict) == [(family, "elbow")]
        p, tried = search.problem, search.gains((), verdict.view)
        own = [k for k, c in enumerate(p.candidates) if c.place == "elbow"]
        best = {name: max((k for k in own if p.candidates[k].family.name == name),
                          key=lambda k: tried[k]) for name in SMOOTH}  # fmt: skip
        finer = search.extend([
            replace(c, shape=s, effect=c.family.at(s, c.place))
            for c in (p.candidates[k] for k in best.values())
            for s in (c.shape * np.geomspace(0.8, 1.25, 41)).tolist()
        ])  # fmt: skip
        view = replace(verdict.view, sizes=p.widened(verdict.hypothesis.parts, verdict.view))
        gains, level = search.gains((), view), max(tried[k] for k in best.values())
        for name, k in best.items():
            most = max(gains[o] for o in finer if p.candidates[o].family.name == name)
            assert most < tried[k] + 0.5 or most < level - 2 * p.setting.rules.odds
