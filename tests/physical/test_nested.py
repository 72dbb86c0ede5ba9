"""The nearest real robot of a larger model is never farther from the data than a smaller one's."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Noise, Robot, analyze, simulate
from identifiability.physical.cad_prior import relative_to
from identifiability.physical.feasibility import find_nearest, scale_bodies
from identifiability.physical.fitted_model import FittedModel
from identifiability.simulation.motion import find_motion
from studies.drawn_robots import draw_arm


def analyze_spoilt(name, folder):
    """Analyze a log that no model explains: scaled torque and a spring, at each joint another."""
    rng = np.random.default_rng([84, *map(ord, name)])
    robot = draw_arm(rng, folder, name) if name.isupper() else Robot.load(name)
    motion = find_motion(robot, "random", 400, rng)
    log = simulate(robot, motion, noise=Noise(torque=0.02), rng=rng)
    size = log.tau.std(axis=0)
    scale = rng.uniform(0.6, 1.4, size.size)
    log = replace(log, tau=scale * log.tau + 0.3 * size * np.sin(5.0 * log.q))
    return analyze(robot, log, "none", replicates=0)


def away_from(found, phi):
    """Return the log-det divergence of bodies from those to which the prior draws."""
    structure = found.structure
    away = 0.0
    nominal = scale_bodies(structure, found.information)
    for columns in structure.inertial:
        matrix = (relative_to(nominal[columns], "body") @ phi[columns]).reshape(4, 4)
        away += np.trace(matrix) - np.linalg.slogdet(matrix)[1] - 4
    return away


@pytest.mark.parametrize("weight", [0.0, 0.01, 1.0, 100.0])
@pytest.mark.parametrize("name", ["two-link", "3-rps", "RRPRR"])
def test_a_larger_model_is_as_near_to_the_data_as_its_sub_model(name, weight, spoilt):
    found = spoilt(name)
    models = []
    for model in found.models:
        part = model.submodel.reduce(found.information)
        models.append(
            FittedModel(found.structure, model.submodel, found.information, part, model.estimate)
        )
    full, *smaller = models
    data = full.data.beside(*full.left_out)

    def cost(model):
        phi = find_nearest(model, weight).nearest.phi
        squares = float(data.rss(phi)) / data.unit**2
        return squares + (weight * away_from(found, phi) if weight else 0.0)

    assert smaller
    for model in smaller:
        assert cost(full) <= cost(model) + 1e-3


@pytest.fixture(scope="module")
def spoilt(tmp_path_factory):
    """A function that returns the analysis of a spoilt log, made once."""
    folder = tmp_path_factory.mktemp("nested")
    made = {}

    def find(name):
        if name not in made:
            made[name] = analyze_spoilt(name, folder)
        return made[name]

    return find
