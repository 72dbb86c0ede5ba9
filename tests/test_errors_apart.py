"""One number hides small joints and single logs: their errors are told apart."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Noise, analyze


@pytest.fixture(scope="module")
def logs(simulated_session):
    """Two logs of a two-link arm; in the second the elbow's torque is noise of its own size."""
    first, second, third = (
        simulated_session("two-link", "a", seed, Noise(torque=0.01)) for seed in (0, 1, 2)
    )
    tau = np.array(second.tau)
    tau[:, 1] += tau[:, 1].std() * np.random.default_rng(0).standard_normal(len(tau))
    return replace(first, name="good"), replace(second, tau=tau, name="bad"), third


@pytest.fixture(scope="module")
def result(logs):
    return analyze("two-link", logs[:2], replace(logs[2], name="unseen"), replicates=20)


def test_errors_are_those_of_definition(result):
    frame = result.error_frame().set_index("name")
    for j, joint in enumerate(result.robot.joints):
        for column, p in (("error", result.fitted), ("error_validation", result.held_out)):
            off = np.sqrt(np.mean(p.residual[:, j, 0] ** 2))
            assert frame.loc[joint, column] == pytest.approx(off / p.tau[:, j].std(), rel=1e-5)
    for at, log in enumerate(("good", "bad")):
        part = result.fitted.log == at
        off = np.abs(result.fitted.residual[part][:, :, 0]).sum()
        tau = result.fitted.tau[part]
        assert frame.loc[log, "error"] == pytest.approx(
            off / np.abs(tau - tau.mean()).sum(), rel=1e-5
        )
        assert np.isnan(frame.loc[log, "error_validation"])
    assert np.isnan(frame.loc["unseen", "error"])
    assert frame.loc["unseen", "error_validation"] > 0


def test_the_joint_and_the_log_that_are_off_stand_out(result):
    frame = result.error_frame().set_index("name").error
    shoulder, elbow = result.robot.joints
    assert frame[elbow] > 10 * frame[shoulder]
    assert frame["bad"] > 3 * frame["good"]


def test_without_held_out_logs_each_log_has_its_turn(logs):
    frame = analyze("two-link", logs[:2], "none", replicates=10).error_frame()
    assert list(frame.name[frame.of == "log"]) == ["good", "bad"]
    assert frame.error_validation.notna().all()
