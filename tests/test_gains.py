"""Gains of torque columns from logs with and without a known load, simulated by another engine."""

import pytest
from numpy.random import default_rng

from identifiability import Robot, analyze, payload, simulate
from identifiability.simulation.motion import find_motion

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
    """The robot, and tables of a motion without and with the load, in units of drives."""
    folder = tmp_path_factory.mktemp("arm")
    tables = []
    for k, load in enumerate(("", LOAD)):
        path = folder / f"arm{k}.xml"
        path.write_text(ARM.format(load))
        robot = Robot.load(path)
        rng = default_rng(k)
        motion = find_motion(robot, "random", 1500, rng)
        frame = simulate(robot, motion, rng=rng).to_frame()
        for joint, gain in TRUE.items():
            torque = frame.pop(f"{joint}.tau").to_numpy()
            torque = torque + 0.02 * torque.std() * rng.standard_normal(len(frame))
            frame[f"{joint}.current"] = torque / gain
        tables.append(frame)
    return Robot.load(folder / "arm0.xml"), *tables


WHAT = {"mass": 3.0, "centre": (0.3, 0.02, 0.0), "inertia": (0.01, 0.02, 0.02)}


@pytest.mark.parametrize("inertia", [WHAT["inertia"], None])
def test_a_known_load_tells_the_gain_of_each_joint(inertia, made):
    found = payload(*made, **{**WHAT, "inertia": inertia})
    for g in found.gains:
        true = TRUE[g.name]
        assert g.value == pytest.approx(true, rel=0.05)
        assert g.low < g.value < g.high
        assert abs(g.value - true) < 0.75 * (g.high - g.low)  # three standard deviations
        assert g.high - g.low < 0.15 * abs(true)
        assert g.told
    assert found.sidecar.startswith("[torque]\ngain = {turn = 1")
    assert "By 3 kg one unit of the torque columns is " in found.details
    assert "gain of lift means that the column counts torque against" in found.details
    assert found.to_frame()["name"].tolist() == list(TRUE)
    assert set(found.to_dict()["gains"][0]) >= {"name", "unit", "value", "low", "high", "told"}


def test_a_wrong_load_gives_gains_that_are_wrong_by_its_mass(made):
    """Where a load acts by its weight, twice the mass is half the torque of one unit."""
    half = {**WHAT, "mass": 1.5, "inertia": (0.005, 0.01, 0.01)}
    right, wrong = (payload(*made, **load).gains for load in (WHAT, half))
    for g, h in zip(right, wrong, strict=True):
        assert h.value == pytest.approx(0.5 * g.value, rel=0.01)


def test_without_a_load_in_the_logs_nothing_is_told(made):
    robot, empty, _ = made
    found = payload(robot, empty.iloc[:750], empty.iloc[750:], **WHAT)
    assert not any(g.told for g in found.gains)
    assert "do not tell the gain of any torque column" in found.details


def test_what_cannot_be_is_refused(made, rejected):
    robot, empty, loaded = made
    with rejected("give the centre, too"):
        payload(robot, empty, loaded, mass=3.0)
    with rejected("give the centre in metres"):
        payload(robot, empty, loaded, mass=3.0, centre=(0.0, 0.0, 100.0))
    with rejected("needs its mass"):
        payload(robot, empty, loaded, centre=(0.0, 0.0, 0.1))


@pytest.mark.parametrize(
    "model, load, wrong",
    [("delta", {}, "excite"), ("differential-wrist", {"centre": (0, 0, 0.1)}, "move these joints")],
)
def test_a_delta_needs_no_centre_and_coupled_motors_no_other_motion(model, load, wrong):
    robot = Robot.load(model)
    log = simulate(robot, find_motion(robot, "random", 900, default_rng(0))).to_frame()
    assert wrong not in payload(robot, log[:450], log[450:], mass=2.0, **load).details


def test_the_command_prints_what_the_sidecar_needs(made, succeeds, tmp_path):
    robot, *tables = made
    paths = [tmp_path / "empty.csv", tmp_path / "loaded.csv"]
    for table, path in zip(tables, paths, strict=True):
        table.to_csv(path, index=False)
    load = ["--mass", 3, "--centre", "0.3,0.02,0", "--inertia", "0.01,0.02,0.02"]
    out = succeeds("payload", robot.path, *paths, *load, "--json", tmp_path / "g.json")
    assert "[torque]\ngain = {turn = " in out.stdout
    # With the gains in the sidecar the same currents are torques.
    gains = out.stdout.partition("[torque]")[2].splitlines()[1]
    sidecar = tmp_path / "arm.toml"
    sidecar.write_text(f"[torque]\n{gains}")
    known = Robot.load(robot.path, sidecar=sidecar)
    assert known.torque.factor("lift") == pytest.approx(TRUE["lift"], rel=0.05)


def test_gains_that_are_off_are_seen_by_what_the_arm_weighs(made):
    """With every gain 10 % too small arm and load come out too light, and it is said."""
    robot, empty, loaded = made
    true = {j: 0.9 * g for j, g in TRUE.items()}
    text = ", ".join(f'"{j}" = {g}' for j, g in true.items())
    sidecar = robot.path.with_name("light.toml")
    sidecar.write_text(f"[torque]\ngain = {{{text}}}\n")
    light = Robot.load(robot.path, sidecar=sidecar)
    found = payload(light, analyze(light, empty, replicates=0), loaded, empty)
    assert found.mass.value == pytest.approx(0.9 * 3.0, rel=0.03)
    assert "The ± of the mass includes torque constants that are off" in found.details
    common = payload(light, analyze(light, empty, replicates=0), loaded, empty, mass=3.0)
    assert "of the result the load weighs 2." in common.answer
    sure = [g for g in common.gains if g.told]
    assert sure
    for g in sure:
        assert g.value == pytest.approx(TRUE[g.name], rel=0.05)
