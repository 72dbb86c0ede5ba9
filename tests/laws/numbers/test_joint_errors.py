"""Errors over each joint's own scale: what they see, how well they are known, the raw torque."""

import numpy as np
import pytest

from .test_errors import prediction


def test_no_joint_counts_more_than_another_whatever_its_unit():
    """Two joints with the same relative errors, one in N and large, one in N·m and tiny."""
    rng = np.random.default_rng(7)
    shape, error = rng.normal(size=1000), rng.normal(size=(1000, 2))
    shape, error = shape / shape.std(), error / np.sqrt((error**2).mean(0))
    tau = np.stack([900 + 300 * shape, 0.01 * shape], 1)
    off = np.stack([error * [0.1, 0.1], error * [0.1, 0.7]], 1) * np.array([300, 0.01])[:, None]
    found = prediction(tau, tau[:, :, None] - off, (1000,))
    np.testing.assert_allclose(found.joint_error(), [[0.1, 0.1], [0.1, 0.7]], rtol=1e-9)
    np.testing.assert_allclose(found.error_over_joints(), [0.1, 0.5], rtol=1e-9)
    assert found.relative_error()[1] < 1.01 * found.relative_error()[0]  # ε_RA does not see it


def test_a_joint_whose_torque_never_varies_has_no_say():
    rng = np.random.default_rng(8)
    tau = np.stack([rng.normal(size=200), np.full(200, 3.0)], 1)
    off = rng.normal(size=(200, 2, 2)) * [[0.1, 0.2], [50.0, 90.0]]
    found = prediction(tau, tau[:, :, None] - off, (200,))
    np.testing.assert_allclose(found.error_over_joints(), found.joint_error()[0])
    assert np.isnan(found.joint_error()[1]).all()
    still = prediction(np.ones((50, 2)), np.zeros((50, 2, 1)), (50,))
    assert np.isnan(still.error_over_joints()).all()


def test_a_constant_torque_has_the_error_one_over_joints():
    tau = np.random.default_rng(9).normal(size=(300, 3)) * [1.0, 10.0, 100.0] + 5
    predicted = np.broadcast_to(tau.mean(0)[:, None], (300, 3, 1))
    assert prediction(tau, predicted, (300,)).error_over_joints() == pytest.approx([1.0])
