"""Families: columns agree with the simulator's laws, places make sense, users add their own."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import IdentifiabilityError, Model, Preparation, Robot, prepare_log, simulate
from identifiability.effects import (
    FAMILIES,
    Family,
    Shaped,
    find_effect,
    find_families,
    forget,
    register,
)
from identifiability.regression.columns import list_candidates
from identifiability.regression.structure import Structure, random_motion
from identifiability.simulation import shipped_trajectory


def hidden_part(robot, text):
    """Torque that hiding an effect adds along a shipped motion, and the motion."""
    trajectory = shipped_trajectory(robot, "a")
    plain = simulate(robot, trajectory)
    added = simulate(robot, trajectory, hide=[text])
    return prepare_log(robot, plain, Preparation(keep_rest=True)).motion, added.tau - plain.tau


@pytest.mark.parametrize(
    "name",
    [
        "quadratic_friction",
        "joint_stiffness",
        "load_dependent_friction",
        "torque_offset",
        "gravity_tilt",
        "payload",
    ],
)
def test_what_the_simulator_hides_is_the_columns_times_some_levels(name):
    """Two roads: the simulator's law (or MuJoCo itself) against the columns."""
    robot = Robot.load("two-link")
    motion, torque = hidden_part(robot, f"{name}=0.05")
    W = Model((find_effect(name),)).regressor(robot, motion)
    flat = W.reshape(-1, W.shape[2])
    level = np.linalg.lstsq(flat, torque.ravel(), rcond=None)[0]
    left = torque.ravel() - flat @ level
    tolerance = 2e-3 if name == "gravity_tilt" else 1e-9  # the tilt is linearised
    assert np.linalg.norm(left) < tolerance * np.linalg.norm(torque)


def test_every_joint_of_every_robot_has_candidates_or_a_reason(robot):
    motion = random_motion(robot, np.random.default_rng(0), 50)
    session = [replace(motion, start=start) for start in (0.0, 60.0, 120.0)]
    present = Structure.of(robot, Model.of("rigid_body")).present
    for fixed in (False, True):
        candidates, refused = list_candidates(
            robot, tuple(FAMILIES.values()), present, session, fixed=fixed
        )
        seen = {c.family.name for c in candidates} | {r.family for r in refused}
        assert seen >= set(FAMILIES) - {"rigid_body"}
        assert {c.place for c in candidates} >= set(robot.joints)
        assert {a.name for a in robot.passive_axes} <= {c.place for c in candidates}
        assert all(r.reason for r in refused)
        taken = [k for c in candidates for k in c.columns]
        assert taken == list(range(len(taken)))


def test_an_unknown_family_is_named_with_its_near_match():
    with pytest.raises(
        IdentifiabilityError, match="'stribek_friction', did you mean 'stribeck_friction'"
    ):
        find_families(["stribek_friction"])


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
