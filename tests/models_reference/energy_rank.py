"""Count the rigid-body base parameters of a robot from its energy.

The total energy of a robot is linear in the ten inertial parameters of every body,
``H(q, dq) = h(q, dq) · φ``, and what H cannot tell apart, no torque can: the number of base
parameters is the rank of the rows ``h(q, dq) − h(q0, 0)`` over states that satisfy the closures
[Gautier-Khalil 1990].
This is a reference for tests: it uses MuJoCo's poses and velocities, and no inverse dynamics.

Each body has, in its own frame and about its own origin,
``φ = (m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz)``.
"""

import mujoco
import numpy as np

SPEED = 3.0  # [rad/s | m/s], so that kinetic energy is of the size of potential energy
CLOSED = 1e-14  # [m]
TOLERANCE = 1e-10  # of the largest singular value, columns scaled to norm 1


def energy_rank(path, samples=1500, seed=0):
    """Rank of the energy regressor of a robot file, and how clear-cut it is.

    Parameters
    ----------
    path : MJCF or URDF whose joints are all hinges or slides, closed by ``<connect site1= site2=>``
    samples : number of random states
    seed : of the random states

    Returns
    -------
    rank : the number of rigid-body base parameters, gravity included
    gap : the last singular value counted over the first one not counted, columns scaled to norm 1
    """
    rows = energy_rows(path, samples, np.random.default_rng(seed))
    norms = np.linalg.norm(rows, axis=0)
    kept = norms > TOLERANCE * norms.max()  # columns that vanish are dropped
    values = np.append(np.linalg.svd(rows[:, kept] / norms[kept], compute_uv=False), 0.0)
    rank = int(np.sum(values > TOLERANCE * values[0]))
    return rank, float(values[rank - 1] / max(values[rank], np.finfo(float).tiny))


def energy_rows(path, samples, rng):
    """Rows ``h(q, dq) − h(home, 0)`` at random states, (samples, 10 · bodies) [J per unit]."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    home = model.key_qpos[0].copy() if model.nkey else np.zeros(model.nq)
    reference = energy_row(model, data, home, np.zeros(model.nv))
    rows = []
    for _ in range(10 * samples):
        q = close_loops(model, data, random_position(model, home, rng))
        if q is not None:
            rows.append(energy_row(model, data, q, random_velocity(model, data, rng)) - reference)
        if len(rows) == samples:
            return np.array(rows)
    raise ValueError(f"{path}: only {len(rows)} of {10 * samples} random states could be closed.")


def energy_row(model, data, q, dq):
    """Kinetic plus potential energy per unit of each inertial parameter : (10 · bodies,)."""
    data.qpos[:], data.qvel[:] = q, dq
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    row, twist = [], np.zeros(6)
    for body in range(1, model.nbody):
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, twist, 1)
        w, v = twist[:3], twist[3:]  # of the body's origin, in the body's frame
        gravity = data.xmat[body].reshape(3, 3).T @ model.opt.gravity
        row += [
            [0.5 * v @ v - model.opt.gravity @ data.xpos[body]],  # m
            np.cross(v, w) - gravity,  # mx my mz
            [0.5 * w[0] ** 2, w[0] * w[1], w[0] * w[2]],  # Ixx Ixy Ixz
            [0.5 * w[1] ** 2, w[1] * w[2], 0.5 * w[2] ** 2],  # Iyy Iyz Izz
        ]
    return np.concatenate(row)


def random_position(model, home, rng):
    """Draw a position inside the joint ranges, or near home where the file gives none : (nq,)."""
    # Joints without a range are drawn near home [rad | m].
    near, limited = home + np.array([[-0.5], [0.5]]), model.jnt_limited.astype(bool)
    return rng.uniform(*np.where(limited, model.jnt_range.T, near))


def random_velocity(model, data, rng):
    """Draw a velocity that keeps the loops closed at the position held in `data` : (nv,)."""
    dq = SPEED * rng.standard_normal(model.nv)
    _, jacobian = closures(model, data)
    return dq - np.linalg.pinv(jacobian, rcond=1e-9) @ (jacobian @ dq)


def close_loops(model, data, q):
    """Find the nearby position with closed loops by Gauss-Newton steps; None if there is none."""
    q = q.copy()
    for _ in range(30):
        data.qpos[:] = q
        mujoco.mj_fwdPosition(model, data)
        residual, jacobian = closures(model, data)
        if np.abs(residual).max(initial=0.0) < CLOSED:
            return q
        q -= np.linalg.pinv(jacobian, rcond=1e-9) @ residual
    return None


def closures(model, data):
    """Distances of connected sites and their Jacobian : (3 · loops,) [m], (3 · loops, nv)."""
    residuals, jacobians = [np.zeros(0)], [np.zeros((0, model.nv))]
    for site1, site2 in zip(model.eq_obj1id, model.eq_obj2id, strict=True):
        first, second = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, first, None, site1)
        mujoco.mj_jacSite(model, data, second, None, site2)
        residuals.append(data.site_xpos[site1] - data.site_xpos[site2])
        jacobians.append(first - second)
    return np.concatenate(residuals), np.concatenate(jacobians)
