"""Read a case and its logs; filter motion. Adapters may use it: it needs numpy, scipy, pandas."""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.signal import butter, filtfilt

#: Cutoff of the zero-phase low-pass of motion and torque, and its order [Hz].
CUTOFF, ORDER = 10.0, 4

#: Inertial parameters of a link, in Pinocchio's order.
KINDS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")

#: Largest standard error, over its value, of a value that least squares calls identifiable.
CALLED = 0.1


class RefusalError(Exception):
    """The tool cannot do the case; the text says why."""


def read_case(folder: Path) -> tuple[Path, dict[str, Any], list[list[pd.DataFrame]]]:
    """Return robot file, sidecar, and fitted and held-out logs of a case of torque."""
    entry = tomllib.loads((folder / "case.toml").read_text(encoding="utf-8"))
    robot = folder / entry["robot"]
    sidecar = folder / entry["sidecar"] if "sidecar" in entry else robot.with_suffix(".toml")
    said = tomllib.loads(sidecar.read_text(encoding="utf-8")) if sidecar.is_file() else {}
    logs = [[pd.read_csv(folder / name) for name in entry[k]] for k in ("logs", "validate")]
    return robot, said | {"kind": entry["exam"]["kind"]}, logs


def load_chain(pin: Any, robot: Path, said: dict[str, Any]) -> tuple[Any, list[str], list[str]]:
    """Return Pinocchio's model, its joints, and our names of the columns of a regressor.

    Columns are the ten inertial parameters of each link, then Fv, Fc, Ia and off of all joints.
    """
    if said["kind"] == "commands":
        raise RefusalError("The logs have no torque.")
    if robot.suffix != ".urdf":
        raise RefusalError("It needs an open chain in a URDF.")
    if "transmission" in said:
        raise RefusalError("Motors are coupled.")
    text = robot.read_text(encoding="utf-8")  # angles, not sines and cosines
    model = pin.buildModelFromXML(text.replace('type="continuous"', 'type="revolute"'))
    model.gravity.linear = np.array(said.get("gravity", [0, 0, -9.81]))
    joints = [str(name) for name in model.names[1:]]
    links = {f.parentJoint: f.name for f in reversed(list(model.frames)) if f.type == pin.BODY}
    names = [f"{links[k + 1]}.{kind}" for k in range(model.nv) for kind in KINDS]
    names += [f"{joint}.{kind}" for kind in ("Fv", "Fc", "Ia", "off") for joint in joints]
    return model, joints, names


def split(log: pd.DataFrame, joints: list[str]) -> tuple[Any, Any, Any]:
    """Return times, positions and torque of a log."""
    q, tau = (log[[f"{j}.{k}" for j in joints]].to_numpy() for k in ("q", "tau"))
    return log["t"].to_numpy(), q, tau


def prepare(log: pd.DataFrame, joints: list[str]) -> tuple[Any, ...]:
    """Return times and low-passed q, dq, ddq, tau (N, n) of a log."""
    t, *columns = split(log, joints)
    step = float(np.median(np.diff(t)))
    low = butter(ORDER, min(0.9, 2 * CUTOFF * step))
    q, tau = (filtfilt(*low, x, axis=0) for x in columns)
    dq = np.gradient(q, step, axis=0)
    return t, q, dq, np.gradient(dq, step, axis=0), tau


def state_value(terms: dict[str, float], x: float, sigma: float) -> dict[str, Any]:
    """Return a value with the interval of its standard error."""
    called = bool(sigma < CALLED * abs(x))
    ends = {"low": x - 1.96 * sigma, "high": x + 1.96 * sigma, "called": called}
    return {"terms": terms, "value": float(x), **ends}


def write(out: Path, tool: str, **answer: Any) -> None:
    """Write `result.json`; a value may be given as terms, value and standard error."""
    answer["values"] = [
        x if isinstance(x, dict) else state_value(*x) for x in answer.get("values", [])
    ]
    (out / "result.json").write_text(json.dumps({"tool": tool, **answer}), encoding="utf-8")


def write_prediction(out: Path, k: int, t: Any, tau: Any, joints: list[str]) -> str:
    """Write the predicted torque of a held-out log and return its name."""
    frame = pd.DataFrame(tau, columns=[f"{j}.tau" for j in joints])
    frame.insert(0, "t", t)
    frame.to_csv(out / f"unseen{k}.csv", index=False)
    return f"unseen{k}.csv"


def enter(main: Any, tool: str) -> None:
    """Run an adapter on the folders of the command line; write a refusal if there is one."""
    case, out = map(Path, sys.argv[1:])
    try:
        write(out, tool, **main(case, out))
    except RefusalError as why:
        write(out, tool, refused=str(why))
