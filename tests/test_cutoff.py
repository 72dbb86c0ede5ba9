"""The cut-off decides what noise is fitted: values that follow it are said."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Log, analyze, diagnose, prune
from identifiability.logs.prepare import Preparation
from identifiability.simulation import Noise
from identifiability.workflows import session
from identifiability.workflows.analyze import fit as check


@pytest.fixture(scope="module")
def positions(simulated_session):
    """A function (size of an encoder's step, seed) -> log of a two-link arm without derivatives."""

    def make(encoder, seed=0):
        log = simulated_session("two-link", "a", seed, Noise(additive=0.02, encoder=encoder))
        return replace(log, dq=None, ddq=None)

    return make


#: A cut-off that a coarse encoder (5 mrad) does not suit.
HIGH = Preparation(cutoff=8.0)


def about_cutoff(result):
    return [h for h in result.hints if "cut-off" in h]


@pytest.mark.parametrize("seed", range(3))
def test_a_good_cut_off_gives_no_hint(positions, seed):
    assert about_cutoff(analyze("two-link", positions(2e-5, seed), replicates=100)) == []


def test_coarse_encoders_move_values_and_the_hint_says_which_how_far_and_what_to_do(positions):
    how = {"preparation": HIGH, "replicates": 100}
    found = analyze("two-link", positions(5e-3), estimator="ls", **how)
    (hint,) = about_cutoff(found)
    assert hint.startswith("Identifiable values follow the cut-off of 8 Hz")
    assert ".Iyy by " in hint
    assert " σ" in hint
    assert "at 16 Hz" in hint
    assert "(--cutoff)" in hint
    assert hint in found.statement
    assert hint in found.to_dict()["hints"]
    # The remedy helps.
    again = analyze("two-link", positions(5e-3), preparation=Preparation(cutoff=4), replicates=100)
    assert about_cutoff(again) == []
    # What instruments mend does not follow the cut-off, and is not said to.
    assert about_cutoff(analyze("two-link", positions(5e-3), **how)) == []
    # And what is chosen does not need it: noise lowers it.
    chosen = analyze("two-link", positions(5e-3), replicates=100)
    assert about_cutoff(chosen) == []
    assert 5 < chosen.samples[0].cutoff < 7
    assert "noise has more than 1 % of the acceleration's power" in chosen.samples[0].notes[0]


def test_the_values_that_are_named_are_identifiable_and_do_move(positions):
    log, how = positions(5e-3), {"estimator": "ls", "replicates": 100}
    found = analyze("two-link", log, preparation=HIGH, **how)
    (hint,) = about_cutoff(found)
    double = analyze("two-link", log, preparation=Preparation(cutoff=16), **how)
    values = double.to_frame(found.chosen.name).set_index("name").value
    named = [v for v in found.chosen.verdicts if f"{v.name} by" in hint]
    assert named
    for v in named:
        assert v.verdict.value == "identifiable"
        assert not v.interval95[0] <= values[v.name] <= v.interval95[1]


def test_measured_derivatives_have_no_cut_off_to_vary(simulated_session):
    log = simulated_session("two-link", "a", 0, Noise(additive=0.02, encoder=5e-3))
    assert about_cutoff(analyze("two-link", log, replicates=20)) == []


@pytest.mark.everything
def test_pruning_says_it_too(positions):
    loud = Preparation(cutoff=16)
    hints = about_cutoff(prune("two-link", positions(5e-3), preparation=loud, replicates=20))
    assert hints[0].startswith("Noise of what is differentiated has ")


def test_a_long_log_is_fitted_again_in_windows_with_the_same_answer(positions, monkeypatch):
    log = positions(5e-3)
    several = [positions(5e-3, seed) for seed in range(4)]
    t = log.t[1] * np.arange(4 * len(log))
    q, tau = (np.concatenate([getattr(s, x) for s in several]) for x in ("q", "tau"))
    long = Log("long", log.joints, t, q, tau, None, None, "")
    sizes = []
    prepare = check.prepare_samples

    def count(robot, part, how):
        sizes.append(len(part))
        return prepare(robot, part, how)

    monkeypatch.setattr(check, "prepare_samples", count)
    monkeypatch.setattr(session, "ENOUGH", 1200)
    found = analyze("two-link", long, preparation=HIGH, replicates=100)
    assert ".Iyy by" in about_cutoff(found)[0]
    assert sizes == [300] * 12  # four windows, at the cut-off itself, half and double of it


def test_of_many_short_logs_some_are_fitted_again_whole():
    found = check._windows([750] * 30, session.ENOUGH)
    assert all((a, b) == (0, 750) for _, a, b in found)
    assert len({k for k, _, _ in found}) == len(found) == 15
    assert sum(b - a for _, a, b in found) <= session.ENOUGH
    long = check._windows([1_000_000, 500], session.ENOUGH)
    assert session.ENOUGH / 2 < sum(b - a for _, a, b in long) <= session.ENOUGH


def test_logs_have_one_cut_off_that_the_fitted_ones_decide(positions):
    slow = positions(2e-5)
    fast = replace(positions(2e-5, 1), t=slow.t / 3, name="fast")
    both = analyze("two-link", [slow, fast], replicates=0)
    # A fifth of the slower rate: ten times the band of the fast one would be 24 Hz.
    assert [s.band for s in both.samples] == pytest.approx([20, 20], rel=0.01)
    held = analyze("two-link", fast, slow, replicates=0)
    assert held.validation[0].band == held.samples[0].band == pytest.approx(24, rel=0.01)
    # The motion of each up to a fifth of its own rate, but where torque is kept at least.
    assert held.validation[0].cutoff == pytest.approx(24, rel=0.01)
    assert held.samples[0].cutoff == pytest.approx(60, rel=0.01)
    assert about_cutoff(both) == about_cutoff(held) == []


def test_a_cut_off_in_the_band_of_the_motion_is_said(positions):
    slow = positions(2e-5)
    found = analyze("two-link", slow, preparation=Preparation(cutoff=1.2), replicates=0)
    (hint,) = about_cutoff(found)
    assert hint.startswith("The cut-off of 1.2 Hz cuts into the motion of the logs, which reaches")
    assert "0.8 Hz: accelerations are missing" in hint
    assert "set it to 4 Hz or more (--cutoff)" in hint
    faster = replace(positions(2e-5, 1), t=slow.t / 8, name="faster")
    assert about_cutoff(analyze("two-link", slow, faster, replicates=0)) == []  # it is let through
    (hint,) = about_cutoff(analyze("two-link", positions(5e-3), faster, replicates=0))
    assert "cuts into the motion of faster, which reaches 6.4 Hz" in hint


def test_noise_that_pulls_values_down_is_said(positions):
    found = analyze("two-link", positions(5e-3), preparation=Preparation(cutoff=16), replicates=0)
    hint = about_cutoff(found)[0]
    assert hint.startswith("Noise of what is differentiated has ")
    quiet = analyze("two-link", positions(5e-3), replicates=0).samples[0].cutoff
    assert f"set it to {quiet:.2g} Hz (--cutoff)" in hint


def test_a_diagnosis_says_it_too(positions):
    low = Preparation(cutoff=1.2)
    found = diagnose("two-link", positions(2e-5), preparation=low, replicates=19, forward=False)
    assert len(about_cutoff(found)) == 1
    assert about_cutoff(found)[0].startswith("The cut-off of 1.2 Hz cuts into the motion")


def _judge(positions, cutoff, encoder, seed):
    """Return how many 95 % intervals hold, of how many, and identifiable values, and wrong ones."""
    how = Preparation(cutoff=cutoff)
    found = analyze("two-link", positions(encoder, seed), preparation=how, replicates=60)
    submodel, verdicts = found.chosen.submodel, found.chosen.verdicts
    truth = np.linalg.lstsq(submodel.M, found.structure.nominal_base - submodel.fixed, rcond=None)[
        0
    ]
    off = np.abs(np.array([v.value for v in verdicts]) - truth)
    sigma = np.array([v.sigma_robust for v in verdicts])
    known = np.array([v.verdict.value == "identifiable" for v in verdicts])
    wrong = (off > 0.5 * np.abs(truth)) & known
    said = bool(about_cutoff(found)) or not np.isfinite(sigma).all()
    return np.array([(off <= 1.96 * sigma).sum(), len(off), known.sum(), wrong.sum()]), said


@pytest.mark.everything
def test_what_is_said_without_a_hint_holds_whatever_encoder_and_cut_off(positions):
    """Of an encoder alone, at many steps."""
    seeds = range(12)
    rows = [
        (encoder, cutoff, *_judge(positions, cutoff, encoder, seed))
        for encoder in (2e-5, 5e-3)
        for cutoff in (None, 4.0, 30.0)
        for seed in seeds
    ]
    silent = np.sum([counts for *_, counts, said in rows if not said], axis=0)
    spread = np.sqrt(0.9 * 0.1 / len(seeds) / 4)  # values of one log hold or fail together
    assert silent[0] / silent[1] >= 0.9 - 2 * spread
    every = np.sum([counts for *_, counts, _ in rows], axis=0)
    assert every[2] > 12 * len(seeds)
    assert every[3] <= 0.02 * every[2]
    good = [said for encoder, cutoff, _, said in rows if (encoder, cutoff) == (2e-5, None)]
    assert np.mean(good) <= 0.1
