"""Analyses to report on: the paper's robot, chains of any length, and logs that show little."""

from dataclasses import replace
from xml.sax.saxutils import quoteattr

import pytest
from numpy.random import default_rng

from identifiability import Noise, Robot, analyze, simulate
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.reduction import LadderEntry, ModelEntry
from identifiability.simulation import random_trajectory
from identifiability.workflows.analyze.belief import form_belief

EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def write_chain(path, joints):
    """Write an MJCF chain of hinges with alternating axes, one for each name."""
    text = ""
    for k, joint in enumerate(joints):
        axis = "0 0 1" if k % 2 else "0 1 0"
        text += (
            f'<body name="link{k + 1}" pos="0.1 0.02 0.1">'
            '<inertial pos="0.05 0.02 0.04" mass="1.5" diaginertia="0.01 0.012 0.008"/>'
            f"<joint name={quoteattr(joint)} axis={quoteattr(axis)} damping='0.5' "
            "frictionloss='0.3' armature='0.02'/>"
        )
    text += "</body>" * len(joints)
    motors = "".join(f"<motor joint={quoteattr(j)}/>" for j in joints)
    path.write_text(
        f'<mujoco><worldbody><body name="base">{text}</body></worldbody>'
        f"<actuator>{motors}</actuator></mujoco>",
        encoding="utf-8",
    )
    return path


@pytest.fixture
def one_model():
    return LadderEntry(models=[ModelEntry(name="only", effects=list(EFFECTS))])


@pytest.fixture(scope="session")
def paper_analysis(simulated_session):
    logs = [simulated_session("3-rps", t, seed) for t, seed in (("601", 0), ("595", 1))]
    return analyze("3-rps", logs[0], logs[1], replicates=200)


def believe(analysis, effort):
    """Add posteriors, shown whatever so few draws are worth."""
    chosen = analysis.chosen
    model = FittedModel.of(
        analysis.structure, chosen.submodel, analysis.information, chosen.estimate.estimator
    )
    belief = form_belief(model, default_rng(0), effort)
    return replace(analysis, belief=replace(belief, physical=trust(belief.physical)))


def trust(summary):
    if summary is None:
        return None
    return replace(summary, convergence=replace(summary.convergence, reasons=()))


@pytest.fixture(scope="session")
def believed_analysis(paper_analysis):
    return believe(paper_analysis, {"walkers": 4, "draws": 12, "warmup": 8})


@pytest.fixture(scope="session")
def chain_analysis(tmp_path_factory):
    """A function that analyses a log of a chain: (names, ladder)."""

    def build(joints, ladder):
        path = write_chain(tmp_path_factory.mktemp("chain") / "robot.xml", joints)
        robot = Robot.load(path)
        move = random_trajectory(robot, default_rng(0), samples=300)
        log = simulate(robot, move, noise=Noise(torque=0.02))
        return analyze(robot, log, ladder=ladder, replicates=100)

    return build
