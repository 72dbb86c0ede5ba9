"""Springs, curves over position and known torque in exported files: the torque that was fitted."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Model, Robot, simulate
from identifiability.effects import FAMILIES
from identifiability.effects.vocabulary import values_in_file
from identifiability.robot import complete_motion
from identifiability.robot.closure import known_torque
from identifiability.simulation import PrescribedMotion
from identifiability.simulation.forces import left_out
from identifiability.workflows.export import write_parameters

#: A spring that pulls back, one that pushes on, a counterweight, a cable; and at a passive joint.
PLANTED = {
    "two-link": {
        "shoulder.k": 3.0, "shoulder.kq0": 2.4, "elbow.k": -1.5, "elbow.kq0": 0.4,
        "elbow.ks": 2.0, "elbow.kc": -1.0, "shoulder.B3": 4.0, "shoulder.B4": -2.0,
        "shoulder.off": -0.96,
    },
    "five-bar": {
        "left_elbow.k": 2.0, "left_elbow.kq0": -3.0, "right_elbow.F0": 1.5, "right_elbow.ks": 0.7,
        "right_shoulder.k": 0.8, "right_shoulder.kq0": 1.1, "right_shoulder.K": 0.5,
        "right_shoulder.F0": 0.3,
    },
}  # fmt: skip
IN_FILE = {"two-link": ("shoulder",), "five-bar": ("left_elbow", "right_shoulder")}
KNOWN = '[[known_torque]]\nalong = "{}"\ntable = [[-9, 1], [0, 0.2], [9, -2]]\n'


def states(robot, count=30):  # as many as a log needs
    rng = np.random.default_rng(0)
    q = rng.uniform(*robot.limits.T, (count, len(robot.joints)))
    v, a = rng.normal(size=(2, *q.shape))
    return complete_motion(robot, np.arange(1.0 * count), q, v, a)


def torque_of(robot, values):
    """All effects along random states, and what is known beforehand."""
    motion = states(robot)
    effects = [f.effect for f in FAMILIES.values() if f.name not in ("coulomb_friction", "payload")]
    every = Model(tuple(effects))
    phi = np.array([values.get(p.name, 0.0) for p in every.parameters(robot)])
    return every.regressor(robot, motion) @ phi + known_torque(robot, motion)


@pytest.fixture
def given(load_text):
    """A function (name) -> robot with a known torque in its sidecar."""

    def load(name):
        shipped = Robot.load(name)
        known = KNOWN.format(shipped.passive[0] if shipped.passive else "elbow")
        return load_text(shipped.path.read_text(), sidecar=shipped.sidecar.read_text() + known)

    return load


@pytest.mark.parametrize("name", PLANTED)
def test_file_and_sidecar_are_what_was_fitted(name, given, tmp_path):
    robot = given(name)
    values = {**robot.nominal, **PLANTED[name]}
    written = write_parameters(robot, values, tmp_path / "fitted.xml")
    copy = Robot.load(written.robot)
    expected = torque_of(robot, values)
    assert_allclose(torque_of(copy, copy.nominal), expected, rtol=1e-9, atol=1e-11)
    assert np.abs(expected - torque_of(robot, robot.nominal)).max() > 0.5
    for joint in IN_FILE[name]:
        k = PLANTED[name][f"{joint}.k"]
        stated = PLANTED[name].get(f"{joint}.K", 0.0)
        assert copy.nominal[f"{joint}.K"] == pytest.approx(k + stated)
        assert not {f"{joint}.k", f"{joint}.off"} & {n for n, x in copy.nominal.items() if x}
    # The simulator, which shares nothing with the effects, has them but for the curve.
    motion = states(copy)
    move = PrescribedMotion(motion.t, motion.actuated_q, motion.actuated_v, motion.actuated_a)
    bare = {n: 0.0 for n in copy.nominal if ".B" in n}
    simulated = simulate(replace(copy, nominal=copy.nominal | bare), move).tau
    assert_allclose(simulated, torque_of(copy, copy.nominal | bare), rtol=1e-7, atol=1e-9)
    assert set(left_out(copy)) == {n for n in PLANTED[name] if ".B" in n}
    # Among what is beside the file are the spring that pushes on, and what goes with a sine.
    held = values_in_file(robot, values)
    assert {n for n in PLANTED[name] if held[n] == 0} == set(written.beside)
    assert [torque for _, torque in copy.known_torque[0].table] == [1.0, 0.2, -2.0]
