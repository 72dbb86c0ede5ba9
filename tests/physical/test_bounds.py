"""Bounds of masses and centres of mass: what the sidecar says, and that answers keep to it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Model, Noise, Robot, analyze, simulate
from identifiability.physical.feasibility import certify
from identifiability.physical.fitted_model import LeastSquares, PhysicalSet, physical_set
from identifiability.physical.project import project
from identifiability.posterior.exact import build_sampler
from identifiability.posterior.target import Prior, Target
from identifiability.regression.structure import Structure
from identifiability.simulation.motion import find_motion

ARM = """<mujoco><compiler autolimits="true"/><worldbody>
<body name="arm" pos="0 0 1"><joint name="a" axis="0 1 0" pos="0 0 .1"/>
<inertial mass="2" pos=".2 0 .1" diaginertia=".02 .03 .04"/>
<body name="tip" pos=".4 0 0" euler="0 0 30"><joint name="b" axis="0 1 0"/>
<joint name="c" axis="0 0 1"/>
<inertial mass="1" pos=".1 .02 0" diaginertia=".004 .005 .006"/></body></body>
</worldbody><actuator><motor joint="a"/><motor joint="b"/></actuator></mujoco>"""


@pytest.fixture
def bounded(tmp_path):
    """Return the arm with a sidecar."""

    def build(text):
        (tmp_path / "arm.xml").write_text(ARM)
        (tmp_path / "arm.toml").write_text(text if "locked" in text else 'locked = ["c"]\n' + text)
        robot = Robot.load(tmp_path / "arm.xml")
        return Structure.of(robot, Model.of("rigid_body", "viscous_friction"))

    return build


def placed(structure, masses, centres):
    """Return parameters with some masses and centres, in the frames of the bodies' joints."""
    phi = np.zeros(len(structure.columns))
    for at, m, c in zip(structure.inertial, masses, np.asarray(centres, float), strict=True):
        tensor = 0.1 * np.eye(3) + m * (c @ c * np.eye(3) - np.outer(c, c))
        phi[at] = [*tensor[np.triu_indices(3)], *(m * c), m]
    return phi


def test_the_centre_is_held_in_the_frame_of_the_body(bounded, rng):
    """The joint of the arm is 0.1 m above its body, and that of the tip is turned by a lock."""
    bound = "box = [[0.1, 0.3], [-0.1, 0.1], [0, 0.2]]"
    for body, turn, up in (("arm", 0.0, 0.1), ("tip", 0.7, 0.0)):
        structure = bounded(f"locked = {{c = 0.7}}\n[bounds.bodies.{body}]\n{bound}\n")
        region = physical_set(structure)
        found = []
        c = np.cos(turn)
        s = np.sin(turn)
        for _ in range(60):
            u = rng.uniform(-1.3, 1.3, 3)
            own = np.array([0.2, 0, 0.1]) + 0.1 * u
            centre = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ own - [0, 0, up]
            centres = [centre, np.zeros(3)] if body == "arm" else [np.zeros(3), centre]
            phi = placed(structure, rng.uniform(0.5, 2, 2), centres)
            inside = bool(np.all(np.abs(u) <= 1))
            assert region.contains(phi) == inside
            found.append(inside)
        assert 5 < sum(found) < 55


def test_masses_are_bounded_body_by_body_and_in_all_and_a_name_goes_before_a_pattern(bounded):
    text = '[bounds]\ntotal_mass = [1, 4]\n[bounds.bodies."*"]\nmass = [0.5, 3]\n'
    structure = bounded(text + "[bounds.bodies.tip]\nmass = [0.1, 2]\n")
    region = physical_set(structure)
    centres = np.zeros((2, 3))
    for masses, broken in (
        ((1, 1), 0),
        ((3.5, 0.2), 1),  # the arm
        ((1, 0.05), 1),  # the tip
        ((2.5, 1.8), 1),  # both together
        ((0.3, 0.4), 2),  # the arm, and both together
    ):
        phi = placed(structure, masses, centres)
        assert np.sum(region.rows @ phi < region.least) == broken
        assert region.contains(phi) == (not broken)


@pytest.mark.parametrize(
    "text, said",
    [
        (
            "[bounds.bodies.amr]\nmass = [0, 1]",
            r"names 'amr', which the robot does not have.* did you",
        ),
        ('[bounds.bodies."leg*"]\nmass = [0, 1]', r"names 'leg\*', which the robot does not have"),
        ("[bounds.bodies.arm]\nmass = [2, 1]", "the lower limit must be below the upper one"),
        ("[bounds.bodies.arm]\nmass = [-1, 1]", "greater than or equal to 0"),
        ("[bounds]\ntotal_mass = [5, 6]\n[bounds.bodies.'*']\nmass = [1, 2]", "is 2 … 4 kg; widen"),
    ],
)
def test_bounds_that_cannot_be_are_refused(bounded, text, said, rejected):
    with rejected(said):
        bounded(text)


BOUNDS = (
    "[bounds]\ntotal_mass = [2.0, 2.8]\n[bounds.bodies.arm]\nmass = [1.5, 1.9]\n"
    "[bounds.bodies.tip]\nbox = [[-0.05, 0.05], [-0.05, 0.05], [-0.05, 0.05]]\n"
)


@pytest.fixture
def problem(bounded, rng):
    """Return a bounded set and data that every bound contradicts."""
    structure = bounded(BOUNDS)
    truth = placed(structure, (2.2, 1.0), ([0.2, 0, 0], [0.1, 0.02, 0]))
    truth[-2:] = 1.0
    R = rng.normal(size=(40, len(truth)))
    return physical_set(structure), LeastSquares(R, R @ truth, 1.0, 60.0), truth


def test_the_nearest_real_robot_keeps_to_its_bounds(problem):
    region, data, _ = problem
    found = project(data, region)
    assert found.accurate
    assert region.contains(found.phi)
    slack = region.rows @ found.phi - region.least
    assert np.sum(slack[region.bounded] < 1e-4) > 2  # of the arm, of both, of the tip's centre
    assert {f"[bounds] of {name}" for name in ("arm", "tip", "arm + tip")} <= {*found.active}
    other = project(LeastSquares(data.R, data.R @ found.phi, 1.0, 60.0), region)
    assert_allclose(other.phi, found.phi, atol=1e-4)
    assert project(data, PhysicalSet(region.bodies, region.nonnegative)).rss < found.rss


def test_a_certificate_says_by_what_bounds_refuse(problem):
    region, _, truth = problem
    G = np.eye(len(truth))
    answer = certify(G, truth, region)
    assert not answer.feasible
    assert answer.value < answer.level
    inside = project(LeastSquares(G, truth, 1.0, 60.0), region, margin=1e-3).phi
    assert certify(G, inside, region).feasible
    assert answer.combination @ inside >= answer.level - 1e-7
    assert "within the bounds" in answer.sentence(region.columns)


def test_where_no_robot_within_its_bounds_predicts_the_first_that_is_said_is_that(
    tmp_path, rng, two_link
):
    motion = find_motion(two_link, "random", 800, rng)
    log = simulate("two-link", motion, noise=Noise(torque=0.1), rng=rng)
    heavy = tmp_path / "heavy.toml"
    for mass, refused in (("[0, 60]", False), ("[12, 60]", True)):
        heavy.write_text(f"[bounds.bodies.link2]\nmass = {mass}\n")
        found = analyze(Robot.load("two-link", sidecar=heavy), log, "none", replicates=0)
        trust = found.answers()[2]
        assert trust.tone == "amber"
        assert ("[bounds] of link2" in trust.short) == refused


@pytest.mark.everything
def test_a_posterior_draws_within_the_bounds_alone(problem, rng):
    region, data, truth = problem
    prior = Prior(truth, np.full(len(truth), 0.3))
    target = Target(data, prior, region, variance=0.5)
    sampler = build_sampler(target)
    start = project(data, region, margin=1e-3).phi
    eta = np.repeat(target.to_eta(start)[None], 8, axis=0)
    masses = []
    for _ in range(200):
        eta = sampler.step(eta, rng)
        phi = target.origin + eta @ target.basis.T
        assert region.contains(phi, 1e-7).all()
        masses.append(phi[:, region.bodies[0, 9]])
    assert 1.5 <= np.min(masses) < np.max(masses) <= 1.9 + 1e-9
    assert np.ptp(masses) > 0.05
