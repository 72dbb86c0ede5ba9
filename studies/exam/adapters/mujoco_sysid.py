"""MuJoCo's sysid: mass and centre of each body; armature, damping and friction of each joint.

Many short rollouts begin at measured states, are driven by measured torque or commands, and are
compared with measured positions, as its documentation does.
"""

import re

import mujoco
import numpy as np
from mujoco import sysid
from reading import RefusalError, enter, prepare, read_case, split, write_prediction

#: Seconds of a rollout, most rollouts, and iterations of the optimiser.
WINDOW, MOST, ITERATIONS = 0.5, 24, 12


def load(path, said, joints):
    if "transmission" in said:
        raise RefusalError("Motors are coupled.")
    text = re.sub(r"(?s)<(visual|collision)\b.*?</\1>", "", path.read_text())
    try:
        urdf = mujoco.MjSpec.from_string(text)
        urdf.compile()
        spec = mujoco.MjSpec.from_string(urdf.to_xml())
    except ValueError as error:
        raise RefusalError("MuJoCo cannot read the robot file.") from error
    spec.option.gravity = said.get("gravity", [0, 0, -9.81])
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    if len(spec.joints) > len(joints):
        raise RefusalError("Rollouts begin at states, and the logs lack passive joints.")
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for j in joints:
        motor = spec.add_actuator(name=j, target=j, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        spec.add_sensor(name=f"{j}_q", type=mujoco.mjtSensor.mjSENS_JOINTPOS, objname=j,
                        objtype=mujoco.mjtObj.mjOBJ_JOINT)  # fmt: skip
        gains = [said.get("servo", {}).get(x, 0.0) for x in ("kp", "kv")]
        kp, kv = (x[j] if isinstance(x, dict) else x for x in gains)
        if said["kind"] == "commands":
            motor.set_to_position(kp=10.0 if kp == "fit" else kp, kv=kv)
    return spec


def collect(spec, model, joints, scale, fit):
    dials = sysid.ParameterDict()
    for body in (model.body(model.joint(j).bodyid[0]).name for j in joints):
        dials.add(sysid.body_inertia_param(spec, model, body))
    for j in joints:
        for kind, share in (("armature", 0.02), ("damping", 0.1), ("frictionloss", 0.1)):

            def turn(spec, p, j=j, kind=kind):
                setattr(
                    spec.joint(j), kind, [p.value[0], 0, 0] if kind == "damping" else p.value[0]
                )

            dials.add(sysid.Parameter(f"{j}_{kind}", share * scale, 0.0, scale, modifier=turn))
        if fit:

            def gain(spec, p, j=j):
                sysid.apply_pgain(spec, j, p.value[0])

            dials.add(sysid.Parameter(f"{j}_kp", 10.0, 1.0, 100.0, modifier=gain))
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
    spec = load(path, said, joints)
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
    data, files = mujoco.MjData(model), []
    for k, log in enumerate(unseen):
        t, *motion, _ = prepare(log, joints)
        tau = np.zeros_like(motion[0])
        for row in range(len(t)):
            data.qpos, data.qvel, data.qacc = (x[row] for x in motion)
            mujoco.mj_inverse(model, data)
            tau[row] = data.qfrc_inverse
        files.append(write_prediction(out, k, t, tau, joints))
    return {"predictions": files}


if __name__ == "__main__":
    enter(main, f"mujoco.sysid {mujoco.__version__}")
