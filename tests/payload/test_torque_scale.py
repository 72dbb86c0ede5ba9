"""Torque constants that are off make a load heavier; the masses of the file tell by how much."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import analyze, payload

ARM = "six-dof-arm"


def scaled(logs, gain):
    return [replace(log, tau=gain * log.tau) for log in logs]


@pytest.mark.parametrize("gain", [0.885, 1.12])
def test_both_readings_are_shown_where_the_file_contradicts_torque_constants(
    make_logs, planted, gain
):
    empty, loaded = (
        scaled(make_logs(ARM, load, seed=seed), gain) for seed, load in ((1, None), (2, planted))
    )
    found = payload(ARM, analyze(ARM, empty[0], replicates=0), loaded[1])
    assert found.scale.contradicts
    assert found.scale.ratio == pytest.approx(gain, rel=0.02)
    assert found.as_measured[0].value == pytest.approx(gain * planted.mass, rel=0.05)
    assert found.mass.low < planted.mass < found.mass.high
    assert found.mass.half < 0.06 * planted.mass
    reading = found.as_measured[0]
    assert not reading.low < planted.mass < reading.high
    text = found.statement
    assert f"{reading.value:.3g} kg" in text
    assert f"{found.mass.value:.3g} kg" in text


def test_the_prior_of_torque_constants_is_in_the_interval_where_the_file_is_no_witness(
    fit, make_logs, planted
):
    kept = fit(ARM)
    log = make_logs(ARM, planted, seed=3)[1]
    rng = np.random.default_rng(0)
    nominal = kept.robot.nominal
    placeholders = {
        name: (
            value * rng.uniform(0.1, 4.0) if name.endswith((".m", ".mx", ".my", ".mz")) else value
        )
        for name, value in nominal.items()
    }
    other = replace(kept.robot, nominal=placeholders)
    vague = replace(kept, structure=replace(kept.structure, robot=other))
    sure, unsure = (payload(ARM, one, log) for one in (kept, vague))
    assert not sure.scale.contradicts
    assert sure.scale.sd < 0.02
    assert 0.05 < unsure.scale.sd < 0.11
    assert unsure.mass.half > 0.1 * planted.mass
    assert "torque constants" in unsure.statement
