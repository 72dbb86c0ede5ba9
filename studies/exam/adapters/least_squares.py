"""Plain least squares on Pinocchio's regressor, with viscous and Coulomb friction and offsets."""

import numpy as np
import pinocchio as pin
from reading import enter, load_chain, prepare, read_case, write_prediction
from scipy.linalg import qr


def regressor(model, q, v, a):
    data, joints = model.createData(), range(model.nv)
    rigid = [pin.computeJointTorqueRegressor(model, data, *row).copy() for row in zip(q, v, a)]
    blocks = [np.stack([np.diag(x) for x in y]) for y in (v, np.sign(v), a, np.ones_like(v))]
    return np.concatenate([np.stack(rigid), *blocks], axis=2).reshape(len(q) * len(joints), -1)


def main(case, out):
    path, said, (fitted, unseen) = read_case(case)
    model, joints, names = load_chain(pin, path, said)
    rows = [prepare(log, joints) for log in fitted]
    W = np.concatenate([regressor(model, *row[1:4]) for row in rows])
    tau = np.concatenate([row[4].ravel() for row in rows])
    R, order = qr(W, mode="r", pivoting=True)
    rank = int((np.abs(np.diag(R)) > 1e-8 * abs(R[0, 0])).sum())
    kept = order[:rank]
    group = np.linalg.solve(R[:rank, :rank], R[:rank, rank : W.shape[1]])
    value, rss, *_ = np.linalg.lstsq(W[:, kept], tau, rcond=None)
    sigma = np.sqrt(np.diag(np.linalg.inv(W[:, kept].T @ W[:, kept])) * rss / (len(tau) - rank))
    terms = [
        {names[kept[k]]: 1.0}
        | {names[order[rank + i]]: float(c) for i, c in enumerate(group[k]) if abs(c) > 1e-6}
        for k in range(rank)
    ]
    files = []
    for k, log in enumerate(unseen):
        t, *motion, _ = prepare(log, joints)
        predicted = (regressor(model, *motion)[:, kept] @ value).reshape(len(t), -1)
        files.append(write_prediction(out, k, t, predicted, joints))
    return {"predictions": files, "values": list(zip(terms, value, sigma))}


if __name__ == "__main__":
    enter(main, f"least squares, Pinocchio {pin.__version__}")
