"""Generated code computes what the model predicts; CasADi is large, so make check-all runs this."""

import ctypes
import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from identifiability import Robot, analyze, simulate
from identifiability.effects import AlongAxes, Family, forget, register
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.regression.regression import Model
from identifiability.regression.structure import random_motion
from identifiability.simulation import Noise, PrescribedMotion, shipped_trajectory
from identifiability.workflows.export import export
from identifiability.workflows.export.code import write_code

TREES = ("six-dof-arm", "two-link")

#: Time of a call of the six-axis arm [µs].
FAST = 5.0

MAIN = """
#include <stdio.h>
#include <time.h>
int main(void) {
    double q[6] = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6}, v[6] = {1, 1, 1, 1, 1, 1}, a[6] = {1}, tau[6];
    double sum = 0.0;
    clock_t start = clock();
    for (int k = 0; k < 200000; k++) {
        q[0] += 1e-6;
        inverse_dynamics(q, v, a, tau);
        sum += tau[0];
    }
    printf("%g %g", 5.0 * (double)(clock() - start) / CLOCKS_PER_SEC, sum);
    return 0;
}
"""
STRICT = ("cc", "-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-O2")


def planted(name, coded):
    """A robot with a value of every parameter that code can hold, and torque along a motion."""
    robot, rng = Robot.load(name), np.random.default_rng(0)
    model = Model.of(*(e for e in coded if e != "passive_joint_friction"))
    names = [p.name for p in model.parameters(robot)]
    values = {n: robot.nominal.get(n, 0.0) + rng.uniform(0.01, 0.1) for n in names}
    motion = random_motion(robot, rng, 100)
    tau = model.regressor(robot, motion) @ np.array([values[n] for n in names])
    return robot, values, model.shapes(robot), motion, tau


def load_python(path):
    spec = importlib.util.spec_from_file_location("generated", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.everything
@pytest.mark.parametrize("name", TREES)
def test_generated_python_is_the_prediction(name, tmp_path, coded):
    robot, values, shapes, m, tau = planted(name, coded)
    code = load_python(write_code(robot, values, shapes, tmp_path / "code.py", "python"))
    assert robot.joints == code.JOINTS
    found = code.inverse_dynamics(m.actuated_q, m.actuated_v, m.actuated_a)
    np.testing.assert_allclose(found, tau, rtol=0, atol=1e-10)
    still = code.inverse_dynamics(m.actuated_q, 0 * m.actuated_v, 0 * m.actuated_a)
    assert np.isfinite(still).all()


@pytest.mark.everything
@pytest.mark.parametrize("name", TREES)
def test_generated_c_compiles_without_a_warning_and_is_the_prediction(name, tmp_path, coded):
    robot, values, shapes, m, tau = planted(name, coded)
    path = write_code(robot, values, shapes, tmp_path / "code.c", "c")
    library = tmp_path / "code.so"
    subprocess.run([*STRICT, "-shared", "-fPIC", path, "-o", library, "-lm"], check=True)
    call = ctypes.CDLL(str(library)).inverse_dynamics
    found = np.zeros_like(tau)
    for k in range(len(tau)):
        rows = (m.actuated_q[k], m.actuated_v[k], m.actuated_a[k], found[k])
        call(*(row.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for row in rows))
    np.testing.assert_allclose(found, tau, rtol=0, atol=1e-10)


@pytest.mark.everything
def test_generated_c_is_fast(tmp_path, coded):
    robot, values, shapes, *_ = planted("six-dof-arm", coded)
    path = write_code(robot, values, shapes, tmp_path / "code.c", "c")
    path.write_text(path.read_text() + MAIN)
    subprocess.run([*STRICT, path, "-o", tmp_path / "timed", "-lm"], check=True)
    out = subprocess.run([tmp_path / "timed"], check=True, capture_output=True, text=True)
    assert float(out.stdout.split()[0]) < FAST


class Cogging(AlongAxes):
    name, equation = "cogging", "τ = Cg cos³(2π q/0.35)"
    units = (("Cg", "N·m", "N"),)

    def curves(self, at):
        return [np.cos(2 * np.pi * at.travel / 0.35) ** 3]


class Loose(Cogging):
    name, equation = "loose", "τ = Cg median(q)"

    def curves(self, at):
        return [np.median(at.travel) * at.ones]


@pytest.mark.everything
def test_an_effect_of_ones_own_has_code_where_it_is_a_function_of_motion(tmp_path):
    robot = Robot.load("two-link")
    for family in (own := [Family(e(), e.name) for e in (Cogging, Loose)]):
        register(family)
    try:
        m = random_motion(robot, np.random.default_rng(1), 20)
        path = write_code(robot, {"elbow.Cg": 0.7}, {}, tmp_path / "code.py", "python")
        found = load_python(path).inverse_dynamics(m.actuated_q, 0 * m.actuated_v, m.actuated_a)
        expected = 0.7 * np.cos(2 * np.pi * (m.actuated_q[:, 1] - robot.home[1]) / 0.35) ** 3
        np.testing.assert_allclose(found[:, 1], expected, atol=1e-12)
        forget("cogging")
        with pytest.raises(IdentifiabilityError, match=r"for loose \(elbow\.Cg\)"):
            write_code(robot, {"elbow.Cg": 0.7}, {}, tmp_path / "code.py", "python")
    finally:
        for family in own:
            forget(family.name)


@pytest.mark.everything
def test_a_result_becomes_code_that_predicts_as_its_real_robot(tmp_path):
    robot = Robot.load("two-link")
    motion = PrescribedMotion.of(shipped_trajectory(robot, "a"), 300)
    log = simulate(robot, motion, noise=Noise(torque=0.02), rng=np.random.default_rng(0))
    result = analyze(robot, log, replicates=0)
    path = result.to_json(tmp_path / "result.json")
    code = load_python(export(robot, path, tmp_path / "code.py").robot)
    phi = json.loads(path.read_text())["physical"]["parameters"]
    m = random_motion(robot, np.random.default_rng(1), 50)
    model = Model.of(*result.effects)
    tau = model.regressor(robot, m) @ np.array([phi[p.name] for p in model.parameters(robot)])
    found = code.inverse_dynamics(m.actuated_q, m.actuated_v, m.actuated_a)
    np.testing.assert_allclose(found, tau, rtol=0, atol=1e-10)


@pytest.mark.everything
def test_names_of_a_robot_file_are_no_code(tmp_path):
    text = Robot.load("two-link").path.read_text()
    bad = "*/ int x; /* \\\"\"\" + open('x', 'w').write('x') + \"\"\""
    told = bad.replace('"', "&quot;")
    text = text.replace('"two-link"', f'"{told}"').replace('"shoulder"', f'"{told}"')
    path = tmp_path / "robot.xml"
    path.write_text(text)
    robot = Robot.load(path)
    assert bad in robot.joints
    code = load_python(write_code(robot, dict(robot.nominal), {}, tmp_path / "code.py", "python"))
    assert robot.joints == code.JOINTS
    assert not Path("x").exists()
    c = write_code(robot, dict(robot.nominal), {}, tmp_path / "code.c", "c")
    subprocess.run([*STRICT, "-c", c, "-o", tmp_path / "code.o"], check=True)
    assert "int x" not in c.read_text().partition("#include")[2]


def test_without_casadi_the_line_that_installs_it_is_said(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "casadi", None)
    robot = Robot.load("two-link")
    with pytest.raises(
        IdentifiabilityError, match=r"pip install 'robot-identifiability\[codegen\]'"
    ):
        write_code(robot, dict(robot.nominal), {}, tmp_path / "code.c", "c")
    assert not (tmp_path / "code.c").exists()
