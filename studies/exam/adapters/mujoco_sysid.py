"""MuJoCo's sysid: mass and centre of each body; armature, damping and friction of each joint.

Many short rollouts begin at measured states, are driven by measured torque or commands, and are
compared with measured positions, as its documentation does.
"""

from itertools import product

import mujoco
import numpy as np
from mujoco import sysid
from reading import enter, load_mujoco, predict_torque, prepare, read_case, split

#: Seconds of a rollout, most rollouts, and iterations of the optimiser.
WINDOW, MOST, ITERATIONS = 0.5, 24, 12
JOINT = ("armature", "damping", "frictionloss")


def dial(kind, joint):
    def turn(spec, parameter):
        value = parameter.value[0]
        if kind == "kp":
            sysid.apply_pgain(spec, joint, value)
        else:
            setattr(spec.joint(joint), kind, [value, 0, 0] if kind == "damping" else value)

    return turn


def collect(spec, model, joints, scale, fit):
    dials = sysid.ParameterDict()
    for body in (model.body(model.joint(j).bodyid[0]).name for j in joints):
        dials.add(sysid.body_inertia_param(spec, model, body))
    ends = dict.fromkeys(JOINT, (0.0, scale)) | ({"kp": (1.0, 100.0)} if fit else {})
    for j, (kind, (low, high)) in product(joints, ends.items()):
        start = 0.1 * high
        dials.add(sysid.Parameter(f"{j}_{kind}", start, low, high, modifier=dial(kind, j)))
    return dials


def cut(spec, model, joints, logs, kind):
    parts = []
    for log in logs:
        t, q, dq, *_ = prepare(log, joints, kind)
        u, rows = split(log, joints, kind)[2], round(WINDOW / float(np.median(np.diff(t))))
        for a in range(rows, len(t) - 2 * rows, max(rows, len(logs) * len(t) // MOST)):
            s, part = t[a : a + rows] - t[a], slice(a, a + rows)
            command = sysid.TimeSeries.from_control_names(s, u[part], model)
            seen = sysid.TimeSeries.from_names(s, q[part], model)
            state = sysid.create_initial_state(model, q[a], dq[a])
            parts.append((f"w{len(parts)}", state, command, seen))
    return [sysid.ModelSequences("robot", spec, *map(list, zip(*parts)))]


def main(case, out):
    path, said, (fitted, unseen) = read_case(case)
    kind = "cmd" if said["kind"] == "commands" else "tau"
    joints = [c[:-2] for c in fitted[0] if c.endswith(".q")]
    spec = load_mujoco(mujoco, path, said, joints)
    model = spec.compile()
    scale = float(fitted[0].filter(like=".tau").std().mean()) if kind == "tau" else 1.0
    dials = collect(spec, model, joints, scale, said.get("servo", {}).get("kp") == "fit")
    parts = cut(spec, model, joints, fitted, kind)
    residual = sysid.build_residual_fn(models_sequences=parts, n_threads=1)
    best, _ = sysid.optimize(dials, residual, verbose=False, max_iters=ITERATIONS)
    sysid.apply_param_modifiers_spec(best, spec)
    model = spec.compile()
    (out / "fitted.xml").write_text(spec.to_xml())
    if kind == "cmd":
        return {"robot": "fitted.xml"}
    return {"predictions": predict_torque(mujoco, model, out, unseen, joints)}


if __name__ == "__main__":
    enter(main, f"mujoco.sysid {mujoco.__version__}")
