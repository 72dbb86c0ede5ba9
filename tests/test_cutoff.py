"""The cut-off decides what noise is fitted: one that does not suit a log is said."""

from dataclasses import replace
from functools import partial

import pytest

from identifiability import Noise, Preparation, analyze, diagnose, prune
from identifiability.foundation.findings import of_key

judge = partial(analyze, "two-link", replicates=0)


@pytest.fixture(scope="module")
def positions(simulated_session):
    """A function (size of an encoder's step, seed) -> log of a two-link arm without derivatives."""

    def make(encoder, seed=0):
        log = simulated_session("two-link", "a", seed, Noise(additive=0.02, encoder=encoder))
        return replace(log, dq=None, ddq=None)

    return make


def about_cutoff(result):
    return [h for h in result.hints if "cut-off" in h]


@pytest.mark.parametrize("seed", range(3))
def test_a_good_cut_off_gives_no_hint(positions, seed):
    assert about_cutoff(judge(positions(2e-5, seed), replicates=100)) == []


def test_logs_have_one_cut_off_that_the_fitted_ones_decide(positions):
    slow = positions(2e-5)
    fast = replace(positions(2e-5, 1), t=slow.t / 3, name="fast")
    both = judge([slow, fast], "none")
    # A fifth of the slower rate: ten times the band of the fast one would be 24 Hz.
    assert [s.band for s in both.samples] == pytest.approx([20, 20], rel=0.01)
    held = judge(fast, slow)
    assert held.validation[0].band == held.samples[0].band == pytest.approx(24, rel=0.01)
    # The motion of each up to a fifth of its own rate, but where torque is kept at least.
    assert held.validation[0].cutoff == pytest.approx(24, rel=0.01)
    assert held.samples[0].cutoff == pytest.approx(60, rel=0.01)
    assert about_cutoff(both) == about_cutoff(held) == []


@pytest.mark.parametrize("encoder, cutoff", [(2e-5, 1.2), (5e-3, 16.0)])
def test_a_cut_off_that_was_set_is_compared_with_the_best_one(positions, encoder, cutoff):
    """A low one takes part of the motion; a high one lets noise of a coarse encoder through."""
    log = positions(encoder)
    found = judge(log, preparation=Preparation(cutoff=cutoff))
    (said,) = of_key(found.hints, "cutoff_set")
    assert said.numbers["error"] < said.numbers["given"]
    chosen = judge(log)
    better = f"{chosen.samples[0].cutoff:.3g} Hz"
    assert f"Set it to {better} (--set cutoff={better.removesuffix(' Hz')})" in said
    # The advice takes its own: nothing better is known then.
    how = Preparation(cutoff=said.numbers["better"])
    assert about_cutoff(judge(log, preparation=how)) == []


def test_names_found_in_a_band_that_was_set_too_wide_are_doubted(positions):
    log = positions(5e-3)
    wide = diagnose("two-link", log, preparation=Preparation(cutoff=30.0))
    (said,) = of_key(wide.hints, "cutoff_wide")
    assert "Do not rely on the named effects" in said
    assert not of_key(diagnose("two-link", log).hints, "cutoff_wide")


#: Every so-manieth sample of a log of 100 Hz: of 4 Hz, which no cut-off of the others suits.
SLOW = slice(None, None, 25)


def about_band(result):
    """Return what a result says of a log's own band."""
    (said,) = of_key(result.hints, "own_band")
    return said


@pytest.fixture(scope="module")
def slow(positions):
    """A log that is sampled at 4 Hz."""
    log = positions(2e-5, 1)
    return replace(log.each(lambda x: x[SLOW], t=log.t[SLOW]), name="slow", sha256="slow")


@pytest.mark.parametrize("cutoff", [None, 12.0])
@pytest.mark.parametrize("verb", [analyze, prune, diagnose])
def test_a_slower_held_out_log_is_judged_in_its_own_band(verb, cutoff, positions, slow):
    how = None if cutoff is None else Preparation(cutoff=cutoff)
    options = {} if verb is diagnose else {"replicates": 0}
    found = verb("two-link", positions(2e-5), slow, preparation=how, **options)
    said = about_band(found)
    assert said.startswith("slow is judged in its own band, up to 0.8 Hz: with 4 samples a second")
    assert said.endswith(f"cut-off of the fitted logs, {said.numbers['cutoff']:.3g} Hz.")
    assert said.numbers["cutoff"] == (cutoff or pytest.approx(8, rel=0.01))


def test_the_log_held_out_moves_no_fitted_value(positions, slow):
    alone = judge(positions(2e-5), "none")
    judged = judge(positions(2e-5), slow)
    assert [s.cutoff for s in judged.samples] == [s.cutoff for s in alone.samples]
    pairs = zip(judged.models, alone.models, strict=True)
    assert all((a.estimate.value == b.estimate.value).all() for a, b in pairs)
    assert judged.validation[0].band == pytest.approx(0.8)


def test_a_result_predicts_a_slower_log_in_its_own_band(positions, slow):
    predicted = analyze("two-link", positions(2e-5)).predict(slow)
    assert "up to 0.8 Hz" in about_band(predicted)


def test_a_fitted_log_that_cannot_have_the_cut_off_is_refused(positions, slow, rejected):
    with rejected(r"cut-off 12 Hz does not lie between .* \(2 Hz\)"):
        judge([positions(2e-5), slow], "none", preparation=Preparation(cutoff=12))
