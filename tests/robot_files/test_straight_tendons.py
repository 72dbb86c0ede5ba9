"""Laws of forces between two bodies: springs, dampers and legs are what MuJoCo makes of them."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Robot, simulate
from identifiability.effects.registry import default_effects
from identifiability.robot import complete_motion
from identifiability.robot.mjcf import quiet
from identifiability.simulation import PrescribedMotion

from ..corpus.mujoco_road import slope
from ..roads import nominal_torque
from .made_robots import arm


def stewart(legs="", motor=""):
    """A free platform on six legs of which nothing is modelled but their force and length."""
    top = ""
    sites = ""
    tendons = ""
    motors = ""
    for k in range(6):
        low = 2 * np.pi * (k // 2) / 3 + (-0.3, 0.3)[k % 2]
        high = 2 * np.pi * ((k + 1) // 2) / 3
        x = 0.6 * np.cos(low)
        y = 0.6 * np.sin(low)
        sites += f'<site name="a{k}" pos="{x} {y} 0.02"/>'
        x = 0.3 * np.cos(high - 1.2)
        y = 0.3 * np.sin(high - 1.2)
        top += f'<site name="b{k}" pos="{x} {y} {0.01 * k}"/>'
        tendons += f"""<spatial name="leg{k}" range="0.5 0.8" {legs}><site site="a{k}"/>
          <site site="b{k}"/></spatial>"""
        motors += f'<motor tendon="leg{k}" {motor}/>'
    return f"""<mujoco><compiler angle="radian"/><worldbody>
      <body name="platform" pos="0 0 0.5"><freejoint name="float"/>{top}
      <inertial mass="3" pos="0.02 0.01 0.05" fullinertia="0.05 0.06 0.09 0.002 0.001 -0.003"/>
      </body>{sites}</worldbody><tendon>{tendons}</tendon><actuator>{motors}</actuator>
      <keyframe><key name="home" qpos="0 0 0.5 1 0 0 0"/></keyframe></mujoco>"""


def poses(text):
    """Random motions of a platform: lengths of its legs with derivatives, and the legs' forces.

    Lengths are MuJoCo's, derivatives are differences of eighth order of them.
    """
    with quiet():
        m = mujoco.MjModel.from_xml_string(text)
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    m.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    d = mujoco.MjData(m)
    rng = np.random.default_rng(0)
    out = []
    for _ in range(20):
        start = m.qpos0.copy()
        v = rng.normal(size=6)
        a = rng.normal(size=6)
        mujoco.mj_integratePos(m, start, rng.uniform(-0.12, 0.12, 6), 1.0)

        def lengths(step, start=start):
            d.qpos[:] = start
            mujoco.mj_integratePos(m, d.qpos, step, 1.0)
            mujoco.mj_fwdPosition(m, d)
            return np.array(d.ten_length)

        J = np.array([slope(lambda s, e=e: lengths(s * e)) for e in np.eye(6)]).T
        # Along q(s) = start ⊕ s v the acceleration is zero, and the length bends by J̇ v.
        bent = slope(lambda s, v=v: slope(lambda r: lengths((s + r) * v)))
        d.qpos[:], d.qvel[:], d.qacc[:] = start, v, a
        mujoco.mj_inverse(m, d)
        force = d.qfrc_inverse + J.T @ (m.tendon_frictionloss * np.sign(J @ v))
        out.append([lengths(np.zeros(6)), J @ v, J @ a + bent, np.linalg.solve(J.T, force)])
    return np.array(out).transpose(1, 0, 2)


@pytest.mark.parametrize(
    "legs, motor",
    [
        ("", 'gear="3"'),
        ('stiffness="40" springlength="0.6" damping="5" frictionloss="2" armature="0.4"', ""),
        ("", 'armature="0.2" gear="2" damping="3"'),
    ],
)
def test_a_platform_on_legs_that_are_tendons_is_what_mujoco_makes_of_it(legs, motor, load_text):
    text = stewart(legs, motor)
    robot = load_text(text)
    assert robot.joints == tuple(f"leg{k}" for k in range(6))
    assert robot.torque_units == ("N",) * 6
    assert robot.limits.tolist() == [[0.5, 0.8]] * 6
    q, v, a, expected = poses(text)
    motion = complete_motion(robot, np.arange(20.0), q, v, a)
    assert len(motion) == 20
    size = np.abs(expected).max()
    assert_allclose(nominal_torque(robot, motion), expected, rtol=0, atol=1e-9 * size)
    log = simulate(robot, PrescribedMotion(0.01 * np.arange(20), q, v, a))
    assert_allclose(log.tau, expected, rtol=0, atol=1e-9 * size)


CABLE = """<tendon><spatial name="cable" {}><site site="start"/><site site="middle"/>
  <site site="end"/></spatial></tendon>"""
SITES = {
    "base": 'pos="0.1 0.2 0.3" euler="0.1 0.2 0.3"',
    "inside": '<site name="end" pos="0.3 0.02 0.1"/>',
    "beside": '<site name="start" pos="0 -0.2 0.6"/><site name="middle" pos="0.2 -0.2 0.6"/>',
}
STATED = 'stiffness="50" springlength="0.3" damping="4" frictionloss="2" armature="0.5"'


def stretched(stated=STATED, **given):
    return arm(after=CABLE.format(stated), **{**SITES, **given})


def test_a_cable_of_the_file_is_named_and_stays_in_what_is_written(load_text, tmp_path):
    robot = load_text(stretched())
    assert robot.joints == ("shoulder", "elbow")
    assert robot.passive == ("cable",)
    stated = {k: v for k, v in robot.nominal.items() if k.startswith("cable.")}
    assert stated | {"cable.K": 50.0, "cable.Fv": 4.0, "cable.Fc": 2.0, "cable.Ia": 0.5} == stated
    assert robot.rest["cable"] == 0.3
    assert {"joint_stiffness", "passive_joint_friction"} <= {*default_effects(robot, ())}
    other = load_text(stretched('stiffness="5"'))
    assert "passive_joint_friction" not in default_effects(other, ())
    values = {"cable.K": 30.0, "cable.Fv": 1.0, "cable.Fc": 0.5, "cable.Ia": 0.25}
    again = Robot.load(robot.with_values(values).save(tmp_path / "written.xml"))
    assert {name: again.nominal[name] for name in values} == values
    assert again.rest["cable"] == 0.3
