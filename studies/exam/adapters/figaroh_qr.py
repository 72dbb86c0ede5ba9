"""FIGAROH's workflow `BaseIdentification.solve` by its public functions, with its defaults.

Positions pass a median filter of 5 rows and a Butterworth low-pass of order 4 at 2 Hz. Regressor
and torque are decimated by 10, and base parameters follow from a double QR.
"""

import importlib.metadata

import numpy as np
import pinocchio as pin
from figaroh.identification import parameter
from figaroh.tools import regressor as tools
from figaroh.tools.qrdecomposition import QRDecomposer
from reading import enter, load_chain, read_case, split, write_prediction
from scipy.signal import butter, decimate, filtfilt, medfilt

TOOL = f"FIGAROH {importlib.metadata.version('figaroh')}"


class Robot:
    """The interface of a robot that the functions need."""

    def __init__(self, model):
        n, self.model, self.data = model.nv, model, model.createData()
        flags = dict.fromkeys(("has_friction", "has_actuator_inertia", "has_joint_offset"), True)
        zeros = {name: [0.0] * n for name in ("fv", "fs", "Ia", "off")}
        self.settings = {"is_joint_torques": True, "act_idxv": list(range(n)), **flags, **zeros}
        self.names = parameter.get_standard_parameters(model, self.settings)
        self.names |= parameter.add_standard_additional_parameters(model, self.settings)

    def rows(self, log, joints):
        t, q, _ = split(log, joints)
        low = butter(4, 2 * 2 * float(np.median(np.diff(t))))
        q = np.stack([filtfilt(*low, medfilt(x, 5)) for x in q.T], 1)
        dq = np.gradient(q, t, axis=0)
        ddq = np.gradient(dq, t, axis=0)
        return tools.build_regressor_basic(self, q, dq, ddq, self.settings)


def thin(x, n):
    return decimate(x.reshape(n, -1, *x.shape[1:]), 10, axis=1, zero_phase=True)


def main(case, out):
    path, said, (fitted, unseen) = read_case(case)
    model, joints, ours = load_chain(pin, path, said)
    robot, n = Robot(model), model.nv
    W = np.concatenate([thin(robot.rows(log, joints), n) for log in fitted], 1)
    tau = np.concatenate([thin(split(log, joints)[2].T.ravel(), n) for log in fitted], 1).ravel()
    W = W.reshape(len(tau), -1)
    idle, names = tools.get_index_eliminate(W, robot.names, tol_e=1e-3)
    qr = QRDecomposer(tolerance=1e-6)
    base, _, _, value = qr.double_decomposition(tau, tools.build_regressor_reduced(W, idle), names)
    ours = dict(zip(robot.names, ours, strict=True))
    terms = [{ours[p]: float(c) for p, c in zip(names, row) if abs(c) > 1e-6} for row in qr.M]
    variance = np.sum((tau - base @ value) ** 2) / (len(tau) - len(value))
    sigma = np.sqrt(variance * np.diag(np.linalg.inv(base.T @ base)))
    files = []
    full = np.linalg.lstsq(qr.M, value, rcond=None)[0]  # standard values of the base parameters
    for k, log in enumerate(unseen):
        predicted = tools.build_regressor_reduced(robot.rows(log, joints), idle) @ full
        files.append(write_prediction(out, k, log["t"], predicted.reshape(n, -1).T, joints))
    return {"predictions": files, "values": list(zip(terms, value, sigma))}


if __name__ == "__main__":
    enter(main, TOOL)
