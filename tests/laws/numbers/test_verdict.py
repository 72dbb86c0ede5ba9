"""Every verdict, its threshold and its words, from numbers alone."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Thresholds
from identifiability.estimation.fit import ScoreScatter
from identifiability.estimation.verdict import Flag, judge, narrow, to_row
from identifiability.report.answers.common import sentence

from .made import fit_known, fit_of


def verdicts(value, robust, *, white=None, noise=1.0, known=None, alias="", **rest):
    """Return the verdicts on parameters with these values and robust standard deviations."""
    value = np.atleast_1d(value).astype(float)
    robust = np.atleast_1d(robust).astype(float)
    k = len(value)
    estimate = fit_of(value, robust if white is None else np.atleast_1d(white), known)
    found = fit_known(estimate, ScoreScatter(robust, np.full(k, np.inf)), noise=noise)
    told = [f"label {j}" for j in range(k)], ["kg"] * k, 12.0, (alias,) * k, np.zeros(k, bool)
    return judge(found, *told, rest.get("nominal"), rest.get("thresholds") or Thresholds())


def verdict(value, robust, **options):
    (found,) = verdicts(value, robust, **options)
    return found


@pytest.mark.parametrize("value", [1.0, -1.0])
@pytest.mark.parametrize("robust, kind", [(0.2, "identifiable"), (0.201, "sign only")])
def test_identifiable_means_known_to_twenty_percent(value, robust, kind):
    found = verdict(value, robust, noise=1e3)
    assert found.verdict == kind
    assert ("Known to ±20 % (limit 20 %) and its sign is certain." in found.reason) == (
        kind == "identifiable"
    )
    if kind == "sign only":
        assert "certain, but it is known only to ±20.1 %" in found.reason


def test_the_verdict_rests_on_the_robust_deviation_not_on_the_white_one():
    assert verdict(1.0, 0.3, white=0.01, noise=1e3).verdict == "sign only"
    assert verdict(1.0, 0.1, white=0.3, noise=1e3).verdict == "identifiable"


@pytest.mark.parametrize("z, certain", [(1.95, False), (1.97, True)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_sign_is_certain_at_five_percent_of_a_two_sided_test(z, certain, sign):
    """Φ(-1.96) is .025: half of the level on each side."""
    found = verdict(sign * z, 1.0, noise=1e3)
    assert (found.verdict == "sign only") == certain
    assert ("even the sign may be chance" in found.reason) == (not certain)


@pytest.mark.parametrize("robust, flags", [(0.0459, ("negligible",)), (0.0460, ())])
@pytest.mark.parametrize("value", [0.01, -0.01])
def test_negligible_is_said_of_the_whole_interval(value, robust, flags):
    """.01 + 1.96 × .0459 = .09996 of the residual; the value by itself is far below the tenth."""
    found = verdict(value, robust)
    assert found.verdict == "not identifiable"
    assert found.flags == flags
    assert not flags or (
        "torque of any joint by more than 10 % of its residual: about zero for this motion, safe "
        "to leave out" in found.reason
    )


def test_negligible_is_said_of_torque_not_of_the_number():
    assert verdict(1.0, 0.9, noise=0.02).flags == ("negligible",)
    assert verdict(1e-3, 0.9e-3, noise=1e3).flags == ()


def test_what_is_certain_is_never_called_negligible():
    found = verdict(0.01, 0.004)  # 2.5 σ, known to 40 %, 2 % of the residual
    assert found.verdict == "sign only"
    assert "certain" in found.reason


def test_what_is_not_determined_is_not_identifiable_and_says_what_it_hides_behind():
    first, second = verdicts(
        [5.0, 1.0], [0.0, 0.01], known=[False, True], alias="Only with another.", noise=1e-9
    )
    assert first.verdict == "not identifiable"
    assert first.flags == ("structural",)
    assert first.reason == "Only with another."
    assert second.verdict == "identifiable"


def test_a_value_without_spread_is_certain_and_zero_is_not():
    assert verdict(1.0, 0.0, noise=1e3).verdict == "identifiable"
    assert verdict(0.0, 0.0).flags == ("negligible",)


def test_the_ninety_five_percent_interval_is_so_many_robust_deviations():
    found = verdict(3.0, 0.5, white=0.1)
    assert_allclose(found.interval95, [3 - 0.98, 3 + 0.98], rtol=1e-4)
    assert found.data_interval95 == found.interval95
    row = found.to_row()
    assert row["interval95"] == list(found.interval95)
    narrowed = narrow(found, Flag.BY_PRIOR, "", (4.0, 5.0)).to_row()
    assert to_row(narrowed).interval == found.interval95
    assert narrowed["interval95"] == [4.0, 5.0]
    friction = replace(verdict(0.5, 0.5), nonnegative=True)
    assert_allclose(
        [friction.interval95, to_row(friction.to_row()).interval], [[0, 1.48]] * 2, rtol=1e-3
    )
    assert replace(friction, value=-3.0).interval95[0] < -3  # the model is contradicted
    shown = sentence("values", "most", high=friction.interval95[1], unit="N")
    assert shown == "≤ 1.5 N"
    assert row["sigma_robust_percent"] == pytest.approx(100 * 0.5 / 3)
    assert row["sigma_percent"] == pytest.approx(100 * 0.1 / 3)


def test_the_share_of_torque_is_the_columns_size_times_the_value():
    assert verdict(-2.0, 0.1).share == pytest.approx(2 * 3 / 12)


def test_the_papers_rule_is_ten_times_the_smallest_white_deviation():
    white = np.array([0.001, 0.0099, 0.0101, 1e-5])
    known = [True, True, True, False]
    found = verdicts(np.ones(4), [0.001, 0.3, 0.01, 1e-5], white=white, known=known, noise=1e3)
    assert [v.paper_rule for v in found] == [True, True, False, False]
    assert "10× rule" not in found[0].reason
    assert "The 10× rule, which knows no autocorrelation, passes it." in found[1].reason
    assert "The 10× rule, which knows no autocorrelation, rejects it." in found[2].reason
