"""What the fitted motion leaves in doubt: given at the level of both motions, and only then."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.workflows.diagnose.doubted import EVEN, name_doubted
from identifiability.workflows.diagnose.findings import NamedEffect
from identifiability.workflows.diagnose.held_out import Gain, HeldOut
from identifiability.workflows.diagnose.material import Rules
from identifiability.workflows.diagnose.shown import Both, Shown

TRIALS = 400


def doubt(world, candidate, rng, levels=(), unseen=None, **rules):
    """Eight options along e_k in unit noise, on fitted motion and on as much that verifies."""
    columns, options = list(world.basis.T[:8]), [candidate("a", f"j{k}", k) for k in range(8)]

    def torque(some):
        hidden = world.basis[:, : len(some)] @ np.array(some, float)
        return hidden + rng.standard_normal(world.rows)

    rows = world.make(torque(levels), columns)
    verifying = world.make(torque(levels if unseen is None else unseen), columns)
    held = replace(world.held(rows), verifying=verifying)
    bench = world.bench(rows, 99, seed=int(rng.integers(1 << 31)))
    return name_doubted(bench, options, held, Rules(**rules)), held, bench.noise


def both_of(naming, held, noise, level=0.05):
    """What `conclude` asks of the one name."""
    evidence = held.predictive(naming.chosen, noise).of_effect([1]).evidence
    return Both(max(naming.p_values[c.group] for c in naming.chosen), evidence, level)


def test_of_pure_noise_both_motions_name_no_more_than_the_level(world, candidate):
    """Of four hundred logs the 1 % bound of the binomial with chance .05 is 31."""
    rng = np.random.default_rng(11)
    asked = given = 0
    for _ in range(TRIALS):
        naming, held, noise = doubt(world, candidate, rng, gain=0.0)
        if naming.chosen:
            asked += 1
            given += not both_of(naming, held, noise).unlikely
    assert asked > TRIALS / 4  # it is the second motion that keeps the level
    assert given <= 31


def test_what_is_weak_in_both_motions_is_given_more_often_than_by_the_first_alone(world, candidate):
    """Three standard errors in each: by the fitted motion alone at p ≤ .05, or by both."""
    rng = np.random.default_rng(12)
    alone = together = right = 0
    for _ in range(100):
        naming, held, noise = doubt(world, candidate, rng, (3.0,), gain=0.0)
        alone += bool(naming.steps[0].p_value <= 0.05)
        if naming.chosen and not both_of(naming, held, noise).unlikely:
            together += 1
            right += naming.chosen[0].place == "j0"
    assert together > alone + 5
    assert right > 0.9 * together


def test_a_name_goes_on_with_the_p_value_of_two_ways(world, candidate):
    """Up to a p-value of one half; it keeps its own at the level, if what chooses is sure."""
    rng = np.random.default_rng(13)
    seen = []
    for level in (0.0, 1.0, 2.0, 2.5, 3.0, 3.5, 5.0):
        naming, _, _ = doubt(world, candidate, rng, (level,), gain=0.0)
        p = naming.steps[0].p_value
        assert bool(naming.chosen) <= (p <= EVEN)
        if naming.chosen:
            seen.append(p)
            assert naming.p_values[naming.chosen[0].group] == (p if p <= 0.05 else 2 * p)
    assert max(seen) > 0.05
    sure, _, _ = doubt(world, candidate, rng, (12.0,), gain=0.0)
    assert sure.p_values["a", "j0"] == 0.01
    # A gain that the rules call too small is none that is sure.
    little, _, _ = doubt(world, candidate, rng, (12.0,), gain=0.9)
    assert little.p_values["a", "j0"] == 1.0


def test_what_chooses_cannot_make_up_for_a_weak_p_value(world, candidate):
    """It surely predicts better with the name, which the fitted motion gives at p ≈ .2."""
    columns, options = list(world.basis.T[:8]), [candidate("a", f"j{k}", k) for k in range(8)]
    across = np.random.default_rng(16).standard_normal(world.rows)
    across -= world.basis @ (world.basis.T @ across)
    for level, kept in ((2.2, False), (6.0, True)):  # of eight, p = .2 and none
        rows = world.make(across + level * columns[0], columns)
        choosing = replace(rows, tau=100.0 * columns[0][:, None])
        held = replace(world.held(rows), choosing=choosing, verifying=rows)
        naming = name_doubted(world.bench(rows, 99), options, held, Rules())
        p = naming.steps[0].p_value
        assert bool(p <= 0.05) == kept
        assert naming.p_values["a", "j0"] == (p if kept else 2 * p)
        gain = held.gain([], naming.chosen)
        assert gain.share > max(gain.error, Rules().gain)


@pytest.mark.parametrize(
    ("gain", "p"), [((0.03, 0.02), 0.01), ((0.01, 0.02), 0.1), ((0.0, 0.02), 1.0)]
)
def test_what_chooses_is_sure_or_better_or_silent(world, candidate, monkeypatch, gain, p):
    """Then p is that of the fitted motion, of two ways at the level, or says nothing."""
    monkeypatch.setattr(HeldOut, "gain", lambda *_, **__: Gain(*gain))
    naming, _, _ = doubt(world, candidate, np.random.default_rng(13), (12.0,))
    assert naming.p_values["a", "j0"] == p


def test_nothing_goes_on_without_motion_that_verifies(world, candidate):
    """Where what chooses is worse, as by noise so slow that errors hide it, it decides alone."""
    rng = np.random.default_rng(14)
    columns, c = [world.basis[:, 0]], [candidate("a", "j", 0)]
    rows = world.make(9 * columns[0] + rng.standard_normal(world.rows), columns)
    held, bench = replace(world.held(rows), verifying=rows), world.bench(rows, 99)
    assert name_doubted(bench, c, held, Rules()).chosen
    assert not name_doubted(bench, c, replace(held, verifying=None), Rules()).chosen
    other = replace(rows, tau=rows.tau - 40 * rows.D.take([0])[:, :, 0])
    assert name_doubted(bench, c, replace(held, choosing=other), Rules()).p_values["a", "j"] == 1.0


def test_at_several_places_nothing_is_in_doubt(world, candidate):
    """Six levels of one family: all of them stand out, and each would have its chance."""
    rng = np.random.default_rng(15)
    naming, _, _ = doubt(world, candidate, rng, (9.0,) * 6)
    assert naming.steps[0].best == ("a", "all joints")
    assert naming.chosen == ()


@pytest.mark.parametrize(
    ("p", "evidence", "sure", "refuted"),
    [(1.0, 2.9, False, True), (1.0, 3.1, False, False), (0.2, 1.3, False, True),
     (0.2, 1.5, False, False), (0.2, 1.3, True, True), (0.04, -0.3, True, False)],
)  # fmt: skip
def test_what_is_in_doubt_needs_both_motions_however_far_the_error_falls(
    p, evidence, sure, refuted
):
    """An interval of the error has a level of its own, and would be a second chance."""
    interval = (-0.3, -0.1 if sure else 0.1)
    effect = NamedEffect(name="a", title="A", placements=(), before=0.2, after=0.1,
                         interval=interval, joints_before=0.2, joints_after=0.1,
                         joints_interval=interval, shown=Shown(0.2, 0.19, interval, -0.1),
                         both=Both(p, evidence, 0.05))  # fmt: skip
    assert effect.confirmed == sure
    assert effect.refuted == refuted
    assert effect.doubted == (p > 0.05)
    if effect.doubted:
        assert effect.p_value == pytest.approx(p * np.exp(-evidence))


@pytest.mark.parametrize(
    ("news", "strength", "alike"),
    [((0.5, 1.4), 5.0, True), ((1.3, 2.5), 5.0, True), ((1.5, 2.5), 5.0, False),
     ((1.5, 2.5), 3.0, True), ((0.1, 0.5), 5.0, False), ((0.1, 0.7), 5.0, True),
     ((2.1, 9.0), 0.0, False), ((np.nan, np.nan), np.inf, True)],
)  # fmt: skip
def test_what_is_in_doubt_is_as_large_on_both_motions(news, strength, alike):
    """To 95 % of the size that is fitted, 1 ± 1.96 over its strength, and of that shown."""
    shown = Shown(0.2, 0.1, (-0.3, -0.1), -0.1, strength, news)
    assert shown.alike == alike
    for p, refuted in ((1.0, not alike), (0.04, False)):
        effect = NamedEffect(name="a", title="A", placements=(), before=0.2, after=0.1,
                             interval=(-0.3, -0.1), joints_before=0.2, joints_after=0.1,
                             joints_interval=(-0.3, -0.1), shown=shown,
                             both=Both(p, 9.0, 0.05))  # fmt: skip
        assert effect.refuted == refuted


@pytest.mark.parametrize("noise", [True, False])
def test_what_is_in_doubt_needs_unseen_motion_that_leaves_no_more_than_noise(noise):
    """Values that few rows were fitted to may be off by more, and so are ratios of it."""
    for p, refuted in ((1.0, not noise), (0.04, False)):
        effect = NamedEffect(name="a", title="A", placements=(), before=0.2, after=0.1,
                             interval=(-0.3, -0.1), joints_before=0.2, joints_after=0.1,
                             joints_interval=(-0.3, -0.1), both=Both(p, 9.0, 0.05, noise),
                             shown=Shown(0.2, 0.1, (-0.3, -0.1), -0.1))  # fmt: skip
        assert effect.refuted == refuted
