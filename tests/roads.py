"""Torque of a robot file on roads that are not the library's, MuJoCo and Pinocchio, and on its own.

Neither of the two reads a sidecar. The tree's torque is theirs; closed chains are closed, and their
torque projected, by the library.
"""

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin

from identifiability import Model
from identifiability.effects.nominal import gravity_torque
from identifiability.robot import complete_motion
from identifiability.robot.mjcf import quiet
from identifiability.simulation.mujoco_robot import bare_urdf

#: What bodies alone make of torque.
RIGID = ("rigid_body",)
#: Everything that a file can state of torque.
EFFECTS = (
    "rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia", "torque_offset",
    "passive_joint_friction", "joint_stiffness",
)  # fmt: skip


def nominal_torque(robot, motion, effects=EFFECTS):
    """Return the torque (N, n) of the file's own values: the library's regressor times them."""
    model = Model.of(*effects)
    values = [robot.nominal.get(p.name, 0.0) for p in model.parameters(robot)]
    return model.regressor(robot, motion) @ np.array(values)


def waves(t, rates, sizes, phases):
    """Return position, velocity and acceleration (N, n) of sums of sines (k, n) at rates (k, n)."""
    angle = np.multiply.outer(t, rates) + phases
    return [(sizes * rates**k * np.sin(angle + k * np.pi / 2)).sum(1) for k in range(3)]


def still(robot, q):
    """Return a motion that stands at each of these positions."""
    return complete_motion(robot, np.arange(len(q)) * 0.01, q, 0 * q, 0 * q)


def weight(robot, log):
    """Return the torque (N, n) that holds a robot at the positions of a log."""
    return gravity_torque(robot, still(robot, log.q), robot.gravity)


def load_mujoco(path):
    """Return a file as MuJoCo compiles it; of a URDF without its meshes."""
    with quiet():
        if path.suffix == ".xml":
            return mujoco.MjModel.from_xml_path(str(path))
        return mujoco.MjModel.from_xml_string(bare_urdf(ET.parse(path).getroot(), balance="false"))


def places(model, robot):
    """Return where MuJoCo has the joints of a robot: joint, index of its position, of its speed."""
    out = []
    for joint in robot.tree.joints:
        name = joint.dofs[0] if joint.nv == 1 else joint.dofs[0].rpartition(".")[0]
        if name not in {cable.name for cable in robot.cables}:
            own = model.joint(name)
            out.append((joint, int(own.qposadr[0]), int(own.dofadr[0])))
    return out


def set_state(data, robot, motion, k, where):
    """Give MuJoCo positions, velocities and accelerations of a sample."""
    for name, at in robot.locked.items():
        data.qpos[int(data.model.joint(name).qposadr[0])] = at
    for joint, at, dof in where:
        q = motion.q[k, joint.iq : joint.iq + joint.nq]
        data.qpos[at : at + joint.nq] = q
        if joint.nv > 1:  # a quaternion begins with its real part there
            end = at + joint.nq
            data.qpos[end - 4 : end] = np.roll(q[-4:], 1)
        data.qvel[dof : dof + joint.nv] = motion.v[k, joint.iv : joint.iv + joint.nv]
        data.qacc[dof : dof + joint.nv] = motion.a[k, joint.iv : joint.iv + joint.nv]


def in_mujoco(path, robot, motion):
    """Return the torque of the tree (N, nv) by MuJoCo from the file alone, in the robot's order."""
    model = load_mujoco(path)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    out = np.zeros((len(motion), robot.nv))
    where = places(model, robot)
    with quiet():
        for k in range(len(motion)):
            set_state(data, robot, motion, k, where)
            mujoco.mj_inverse(model, data)
            force = data.qfrc_inverse + model.dof_frictionloss * np.sign(data.qvel)
            force += _dry_tendons(model, data)
            mujoco.mj_fwdActuation(model, data)  # without commands: what motors pull by always
            force -= data.qfrc_actuator
            for joint, _, dof in where:
                out[k, joint.iv : joint.iv + joint.nv] = force[dof : dof + joint.nv]
    return out


def _dry_tendons(model, data):
    """Return the dry friction of tendons along the joints, (nv,)."""
    force = np.zeros(model.nv)
    places = model if hasattr(model, "ten_J_rowadr") else data  # by the version of MuJoCo
    for t in np.flatnonzero(model.tendon_frictionloss):
        row = np.zeros(model.nv)
        start = int(places.ten_J_rowadr[t])
        count = int(places.ten_J_rownnz[t])
        row[places.ten_J_colind[start : start + count]] = data.ten_J[start : start + count]
        force += model.tendon_frictionloss[t] * np.sign(row @ data.qvel) * row
    return force


def in_pinocchio(path, robot, motion):
    """Return the same by Pinocchio's own reading; None where it has no word for what is there."""
    owners = {n.rpartition(".")[0]: n for n, value in robot.nominal.items() if value}
    springs = any(value for n, value in robot.nominal.items() if n.endswith(".K"))
    if robot.cables or springs or owners.keys() & {*robot.tendon_axes}:
        return None
    build = pin.buildModelFromMJCF if path.suffix == ".xml" else pin.buildModelFromUrdf
    model = build(str(path))
    assert model.nv == robot.nv
    for option in ET.parse(path).iter("option"):  # which Pinocchio's reader of MJCF passes over
        if option.get("gravity"):
            model.gravity.linear = np.array(option.get("gravity").split(), float)
    data = model.createData()
    out = np.zeros((len(motion), robot.nv))
    at = [robot.tree.single[name].iq for name in robot.dofs]
    neutral = pin.neutral(model)
    friction = np.where(np.isfinite(model.upperDryFrictionLimit), model.upperDryFrictionLimit, 0.0)
    for k in range(len(motion)):
        v = motion.v[k]
        q = pin.integrate(model, neutral, motion.q[k, at])
        out[k] = pin.rnea(model, data, q, v, motion.a[k])
        out[k] += model.damping * v + friction * np.sign(v)
    for motor in ET.parse(path).iter("general"):  # which it passes over, too
        constant = float(motor.get("biasprm").split()[0])
        out[:, robot.dof_index(motor.get("joint"))] -= float(motor.get("gear", "1")) * constant
    return out


def project(robot, motion, tree):
    """Return the torque of the actuated joints (N, n) from that of all."""
    tau = tree[:, robot.actuated]
    if motion.X is not None:
        tau = tau - np.einsum("nij,ni->nj", motion.X, tree[:, robot.dependent])
    return tau
