"""Families: columns agree with the simulator's laws, places make sense, users add their own."""

import numpy as np

from identifiability import Model, Robot
from identifiability.effects import Family, Shaped, find_families, forget, register
from identifiability.regression.columns import list_candidates
from identifiability.regression.structure import random_motion


class Cogging(Shaped):
    """A cosine whose pitch the data sheet states."""

    name, equation = "cogging", "τ = Cg cos(2π q/λ)"
    units = (("Cg", "N·m", "N"),)
    usual = (0.35, 0.02)

    def curves(self, at):
        return [np.cos(2 * np.pi * at.travel / self.shape(at.robot, at.axis))]


def test_a_shape_that_is_known_is_stated_and_not_searched():
    register(Family(Cogging(), "cogging"))
    try:
        robot = Robot.load("two-link")
        motion = random_motion(robot, np.random.default_rng(0), 20)
        away = motion.actuated_q[:, 1] - robot.home[1]
        for text, pitch in (("cogging@elbow", 0.35), ("cogging@elbow:0.4", 0.4)):
            model = Model.of(text)
            expected = np.cos(2 * np.pi * away / pitch)
            np.testing.assert_allclose(model.regressor(robot, motion)[:, 1, 0], expected)
        families = find_families(["cogging"])
        found, _ = list_candidates(robot, families, (), [motion], fixed=False)
        assert [c.place for c in found] == list(robot.joints)
        assert np.isnan([c.shape for c in found]).all()
    finally:
        forget("cogging")
