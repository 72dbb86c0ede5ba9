"""The torque that MuJoCo finds for an MJCF: nothing here is shared with the library.

Dry friction is a constraint to MuJoCo, so it is added as ``frictionloss · sign(speed)``; loops are
closed and projected with the Jacobian of MuJoCo's own equality constraints.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

_BITS = mujoco.mjtDisableBit
_SINGLE = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
_AT_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
CLOSED = 1e-12

#: A home position farther than this from closing the loops is none [m or rad].
OPEN = 1e-3


@dataclass(frozen=True)
class States:
    """Motion of the actuated joints at N states and their torque, all (N, n), by joint name."""

    joints: tuple[str, ...]
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray


class MujocoRoad:
    """A compiled MJCF.

    Parameters
    ----------
    path : Path
    strict : bool
        Refuse a stated home position that does not close the loops.
    """

    def __init__(self, path):
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        # Accelerations are given as they are, not as a time step would make them.
        self.model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_INVDISCRETE)
        self.data = mujoco.MjData(self.model)
        self.strict = self.model.nkey > 0
        off = self.model.opt.disableflags
        self.rubs = not off & (int(_BITS.mjDSBL_FRICTIONLOSS) | int(_BITS.mjDSBL_CONSTRAINT))
        self.closes = not off & (int(_BITS.mjDSBL_EQUALITY) | int(_BITS.mjDSBL_CONSTRAINT))
        self.joints = self._actuated()
        adr = [self.model.jnt_dofadr[j] for j in self.joints]
        self.dofs = np.array(adr, int)
        self.passive = np.setdiff1d(np.arange(self.model.nv), self.dofs)

    def _actuated(self):
        """Return the joints with a motor, else all, by index, in the order of the tree."""
        m = self.model
        driven = set()
        for kind, target in zip(m.actuator_trntype, m.actuator_trnid[:, 0], strict=True):
            if int(kind) in _AT_JOINT:
                driven.add(int(target))
            elif int(kind) == int(mujoco.mjtTrn.mjTRN_TENDON) and m.tendon_num[target] == 1:
                driven.add(int(m.wrap_objid[m.tendon_adr[target]]))
        return [j for j in sorted(driven) or range(m.njnt) if int(m.jnt_type[j]) in _SINGLE]

    def states(self, rng, count, spread):
        """Return random states of the actuated joints, away from zero speed, and their torque."""
        m = self.model
        n = len(self.joints)
        slides = [int(m.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_SLIDE) for j in self.joints]
        reach = np.where(slides, 0.2 * spread, spread)
        at = [int(m.jnt_qposadr[j]) for j in self.joints]
        home = self._home()
        middle = home[at] if self.model.nkey and len(self.passive) else np.zeros(n)
        names = tuple(m.joint(j).name or f"joint {j}" for j in self.joints)
        return draw(names, rng, count, reach, lambda *row: self._torque(home, at, *row), middle)

    def _home(self):
        m = self.model
        if not self.closes or not m.neq or not m.nkey:
            return np.array(m.qpos0)
        named = [k for k in range(m.nkey) if m.key(k).name == "home"]
        return np.array(m.key_qpos[named[0] if named else 0])

    def _torque(self, home, at, q, dq, ddq):
        """Return the torque of the actuated joints at one state, (n,)."""
        m = self.model
        d = self.data
        start = np.array(home)
        gap = np.abs(self._equalities(start)[0]).max(initial=0.0)
        assert gap < OPEN or not self.strict, f"the home of the file is open by {gap:.2g}"
        steps = 40 if len(self.passive) else 1
        for k in range(1, steps + 1):
            start[at] = home[at] + (q - home[at]) * k / steps
            start = self._close(start)
        error, J = self._equalities(start)
        assert not len(error) or np.abs(error).max() < CLOSED, np.abs(error).max()
        # What floats freely beside the robot stands still, and moves nothing of it.
        moving = m.jnt_type[m.dof_jntid] != int(mujoco.mjtJoint.mjJNT_FREE)
        Z = _null_space(J, self.dofs) if len(J) else np.eye(m.nv)[:, moving]
        v = Z @ dq
        a = Z @ ddq
        if len(error):
            a[self.passive] -= _solve(J[:, self.passive], self._bias(start, v))
        d.qpos[:], d.qvel[:], d.qacc[:] = start, v, a
        flags = m.opt.disableflags
        m.opt.disableflags = flags | int(_BITS.mjDSBL_CONSTRAINT)
        mujoco.mj_inverse(m, d)
        force = np.array(d.qfrc_inverse)
        m.opt.disableflags = flags
        if self.rubs:
            force += m.dof_frictionloss * np.sign(v)
            force += self._tendon_friction(start, v)
        return Z.T @ force

    def _tendon_friction(self, q, v):
        """Return the dry friction of tendons: along the change of their lengths with q."""
        m = self.model
        force = np.zeros(self.model.nv)
        for k in np.flatnonzero(m.tendon_frictionloss):
            J = np.array([slope(lambda s, e=e, k=k: self._length(q, s * e, k))
                          for e in np.eye(m.nv)])  # fmt: skip
            force += m.tendon_frictionloss[k] * np.sign(J @ v) * J
        return force

    def _length(self, q, step, tendon):
        self._place(q, step)
        mujoco.mj_fwdPosition(self.model, self.data)
        return float(self.data.ten_length[tendon])

    def _place(self, q, step):
        self.data.qpos[:] = q
        mujoco.mj_integratePos(self.model, self.data.qpos, step, 1.0)

    def _equalities(self, q, step=None):
        """Return errors (m,) and Jacobian (m, nv) of the equality constraints."""
        m = self.model
        d = self.data
        if not self.closes or not m.neq:
            return np.empty(0), np.empty((0, m.nv))
        self._place(q, np.zeros(m.nv) if step is None else step)
        d.qvel[:] = 0
        mujoco.mj_fwdPosition(m, d)
        rows = d.efc_type[: d.nefc] == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        J = np.array(d.efc_J).reshape(-1, m.nv)[: d.nefc]
        return np.array(d.efc_pos[: d.nefc])[rows], J[rows]

    def _close(self, q):
        """Return the closed configuration that Newton steps of the passive joints reach."""
        q = np.array(q)
        best = np.inf
        for _ in range(30):
            error, J = self._equalities(q)
            size = float(np.abs(error).max(initial=0.0))
            if size < CLOSED and size >= 0.5 * best:
                return q
            best = size
            step = np.zeros(self.model.nv)
            step[self.passive] = -_solve(J[:, self.passive], error)
            mujoco.mj_integratePos(self.model, q, step, 1.0)
        return q

    def _bias(self, q, v):
        """Return ``J̇ v``."""
        return slope(lambda s: self._equalities(q, s * v)[1] @ v)


def draw(names, rng, count, reach, torque, middle=0.0):
    n = len(names)
    q = middle + reach * rng.uniform(-1, 1, (count, n))
    dq = rng.choice([-1, 1], (count, n)) * rng.uniform(0.3, 2, (count, n))
    ddq = 5 * rng.normal(size=(count, n))
    return States(names, q, dq, ddq, np.array(list(map(torque, q, dq, ddq))))


def slope(function, h=4e-3):
    """Return the derivative at zero by central differences of eighth order."""
    weights = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    return sum(
        w * (function(k * h) - function(-k * h)) / h for k, w in enumerate(weights, 1)
    )  # fmt: skip


def _solve(A, b):
    return np.linalg.lstsq(A, b, rcond=1e-9)[0]


def _null_space(J, free):
    """Return the motions (nv, n) that the equalities allow, one for each free coordinate."""
    _, s, Vt = np.linalg.svd(J)
    Z = Vt[int((s > 1e-9 * s[0]).sum()) :].T
    assert Z.shape[1] == len(free), f"{Z.shape[1]} free motions for {len(free)} motors"
    return Z @ np.linalg.inv(Z[free])
