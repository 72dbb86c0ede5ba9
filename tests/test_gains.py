"""Gains of torque columns from logs with and without a known load, simulated by another engine."""

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter
from typer.testing import CliRunner

from identifiability import Robot, identify_gains, simulate
from identifiability.cli import app
from identifiability.foundation.errors import LogError
from identifiability.foundation.options import OptionError
from identifiability.simulation import Noise
from identifiability.simulation.motion import find_motion
from identifiability.workflows.gains import fit_joint

#: A turntable that carries an arm of two hinges; what is on the last one is put in.
ARM = """
<mujoco><worldbody><body name="base">
 <body name="table"><joint name="turn" axis="0 0 1" range="-3 3" damping="2" frictionloss="1"/>
  <inertial pos="0 0 0.1" mass="8" diaginertia="0.1 0.1 0.1"/>
 <body name="upper" pos="0 0 0.3"><joint name="lift" axis="0 1 0" range="-1.5 1.5" damping="3"
  frictionloss="2" armature="0.4"/><inertial pos="0.2 0 0" mass="5" diaginertia="0.02 0.1 0.1"/>
 <body name="fore" pos="0.5 0 0"><joint name="bend" axis="0 1 0" range="-2 2" damping="1"
  frictionloss="1" armature="0.1"/><inertial pos="0.15 0 0" mass="2" diaginertia="0.01 0.03 0.03"/>
 {}
 </body></body></body></body></worldbody>
<actuator><motor joint="turn"/><motor joint="lift"/><motor joint="bend"/></actuator></mujoco>
"""
LOAD = '<body name="load"><inertial pos="0.3 0.02 0" mass="3" diaginertia="0.01 0.02 0.02"/></body>'

#: N·m per unit of the log.
TRUE = {"turn": 12.0, "lift": -8.5, "bend": 0.004}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The robot and tables of a motion without and with the load, in units of the drives."""
    folder = tmp_path_factory.mktemp("arm")
    tables = []
    for k, load in enumerate(("", LOAD)):
        path = folder / f"arm{k}.xml"
        path.write_text(ARM.format(load))
        robot, rng = Robot.load(path), np.random.default_rng(k)
        motion = find_motion(robot, "random", 1500, rng)
        frame = simulate(robot, motion, noise=Noise(), rng=rng).to_frame()
        for joint, gain in TRUE.items():
            torque = frame.pop(f"{joint}.tau").to_numpy()
            torque = torque + 0.02 * torque.std() * rng.standard_normal(len(frame))
            frame[f"{joint}.current"] = torque / gain
        tables.append(frame)
    return Robot.load(folder / "arm0.xml"), *tables


WHAT = {"mass": 3.0, "centre": (0.3, 0.02, 0.0), "inertia": (0.01, 0.02, 0.02)}


def test_gains_come_out_with_their_intervals(made):
    found = identify_gains(*made, **WHAT)
    assert [g.joint for g in found.gains] == list(TRUE)
    for g in found.gains:
        true = TRUE[g.joint]
        assert g.value == pytest.approx(true, rel=0.05)
        assert g.interval[0] < true < g.interval[1]
        assert (g.interval[1] - g.interval[0]) / abs(true) < 0.15
        assert g.verdict == "identifiable"
    assert found.sidecar.startswith('[torque]\ngain = {"turn" = 1')
    assert "One unit of the torque columns is" in found.statement
    robot, empty, _ = made
    known = Robot.load(robot.path)
    assert known.torque.text == ""
    assert set(found.to_dict()["gains"][0]) >= {"joint", "gain", "low", "high", "verdict"}
    assert empty.filter(like=".tau").empty


def test_a_wrong_load_gives_gains_that_are_wrong_by_its_mass(made):
    """Where a load acts by its weight, twice the mass is half the torque of one unit."""
    right = identify_gains(*made, **WHAT)
    half = {**WHAT, "mass": 1.5, "inertia": (0.005, 0.01, 0.01)}
    for g, h in zip(right.gains, identify_gains(*made, **half).gains, strict=True):
        assert h.value == pytest.approx(0.5 * g.value, rel=1e-6)


def test_without_a_load_in_the_logs_nothing_is_told(made):
    robot, empty, _ = made
    first, second = empty.iloc[:750], empty.iloc[750:]
    found = identify_gains(robot, first, second, **WHAT)
    assert found.known == {}
    assert found.sidecar == ""
    for g in found.gains:
        assert g.verdict == "not identifiable"
        assert np.isinf(g.interval).all()
    assert "do not tell what one unit of any torque column is" in found.statement


def test_what_cannot_be_is_refused(made):
    robot, empty, loaded = made
    with pytest.raises(OptionError, match="'upper' is no last body"):
        identify_gains(robot, empty, loaded, mass=1.0, body="upper")
    with pytest.raises(OptionError, match="three numbers"):
        identify_gains(robot, empty, loaded, mass=1.0, centre=(1.0, 2.0))
    with pytest.raises(OptionError, match="mass"):
        identify_gains(robot, empty, loaded, mass=-1.0)
    with pytest.raises(LogError, match=r"is the log .* that is fitted"):
        identify_gains(robot, empty, empty, mass=1.0)


def test_the_command_prints_what_the_sidecar_needs(made, tmp_path):
    robot, *tables = made
    paths = [tmp_path / "empty.csv", tmp_path / "loaded.csv"]
    for table, path in zip(tables, paths, strict=True):
        table.to_csv(path, index=False)
    load = ["--mass", 3, "--centre", "0.3,0.02,0", "--inertia", "0.01,0.02,0.02"]
    words = ["gain", robot.path, paths[0], "--loaded", paths[1], *load]
    out = CliRunner().invoke(app, [*map(str, words), "--json", str(tmp_path / "g.json")])
    assert out.exit_code == 0, out.output
    assert '[torque]\ngain = {"turn" = ' in out.stdout
    assert out.stdout.rstrip().endswith("g.json")
    bad = CliRunner().invoke(app, [*map(str, words[:-1]), "much"])
    assert bad.exit_code == 2
    # With the gains in the sidecar the same currents are torques.
    robot.path.with_suffix(".toml").write_text(
        out.stdout[out.stdout.index("[torque]") :].split("\n\n")[0]
    )
    known = Robot.load(robot.path)
    assert known.torque.factor("lift") == pytest.approx(TRUE["lift"], rel=0.05)


@pytest.mark.everything
def test_intervals_hold_where_noise_remembers_ten_samples():
    """95 % of 120 gains, within two Monte-Carlo errors of that: slow noise hides in the fit."""
    rng, n, inside = np.random.default_rng(0), 300, []
    t, log = np.tile(np.arange(n) / 100.0, 2), np.repeat([0, 1], n)
    for _ in range(120):
        phase = rng.uniform(0, 2 * np.pi, 20)
        waves = [np.sin(2 * np.pi * (k + 1) / 7 * t + p + k * log) for k, p in enumerate(phase)]
        load = (1.0 + np.sin(2 * np.pi * 0.3 * t + phase[0])) * log
        noise = lfilter([1.0], [1.0, -0.9], rng.standard_normal((2, n + 200)))[:, 200:].ravel()
        x, sd, free, _ = fit_joint(load + noise, load, np.column_stack(waves), log)
        inside.append(abs(x - 1.0) < stats.t.ppf(0.975, free) * sd)
    assert np.mean(inside) > 0.95 - 2 * np.sqrt(0.95 * 0.05 / 120)
