"""Torque constants that are off make a load heavier; the masses of the file tell by how much."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng

from identifiability import analyze, payload
from identifiability.foundation.rounding import REACH
from identifiability.workflows.torque_scale import compare_gravity

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
    assert found.mass.value == pytest.approx(gain * planted.mass, rel=0.05)
    by_file = found["mass by the file"]
    low, high = by_file.interval
    assert low < planted.mass < high < low + 0.12 * planted.mass
    content = found.to_dict()
    masses = [content[name]["value"] for name in ("mass", "mass_by_file")]
    assert masses == found.to_frame()["value"][:2].tolist() == [found.mass.value, by_file.estimate]
    assert "torque constants are right, " in found.details


def test_the_prior_of_torque_constants_is_in_the_interval_where_the_file_is_no_witness(
    fit, make_logs, planted
):
    kept = fit(ARM)
    log = make_logs(ARM, planted, seed=3)[1]
    rng = default_rng(0)
    heavy = (".m", ".mx", ".my", ".mz")
    placeholders = {
        name: value * (rng.uniform(0.1, 4.0) if name.endswith(heavy) else 1.0)
        for name, value in kept.robot.nominal.items()
    }
    other = replace(kept.robot, nominal=placeholders)
    vague = replace(kept, structure=replace(kept.structure, robot=other))
    sure, unsure = (payload(ARM, one, log) for one in (kept, vague))
    assert not sure.scale.contradicts
    assert sure.scale.sd < 0.02
    assert 0.05 < unsure.scale.sd < 0.11
    assert unsure.by_file[0].half > 0.1 * planted.mass
    assert "torque constants" in unsure.details


def test_the_factor_is_as_sure_as_files_whose_bodies_err_by_5_percent_allow():
    held = []
    for rng in default_rng(0).spawn(150):
        bodies = rng.standard_normal((10, 6))
        fitted = bodies @ (1.0 + 0.05 * rng.standard_normal(6))
        found = compare_gravity(fitted, 1e-4 * np.eye(10), bodies.sum(1), bodies @ bodies.T)
        held.append(abs(np.log(found.factor)) < REACH * found.sd)
    assert np.mean(held) > 0.91
