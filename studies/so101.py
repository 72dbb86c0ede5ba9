"""SO-101: does the exported robot move as a real hobby arm does on commands that chose nothing?

The arm has six position servos, and its logs hold positions and commands at 50 Hz. Three motions
are fitted, once with stated gains and once with `kp = "fit"`. MuJoCo alone then moves the exported
file by the commands of the other motions, from the first row to the last. The prediction of the
command itself, and of the command at its best common delay, are listed for comparison.

Two motions are sealed: they are rolled out only with `--sealed`.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import mujoco
import numpy as np
import pandas as pd
from mujoco import rollout
from shared import data_folder, study_parser, write_answer

from identifiability import analyze, export
from identifiability.foundation.findings import of_key
from identifiability.foundation.names import Array
from identifiability.foundation.result import Result

FITTED = ("chirp_sweep", "multisine", "large_amplitude")
HELD_OUT = ("friction_gravity", "coupled_joints", "workspace_sweep")
SEALED = ("pick_place", "single_joint_elbow")

#: Sidecars: gains that logs tell, and those of published models of such arms.
GAINS = {
    "fit": '[servo]\nkp = "fit"\n',
    "stated": "[servo]\nkp = 17.8\nkv = 0.6\nlimit = 3.35\n",
}

#: Largest median error of positions over held-out motions [mrad].
MOST_ERROR = 20.0

#: Longest processor time of an analysis with its page, and until its first page, in times that
#: MuJoCo alone takes for the held-out motions: seconds depend on the machine.
MOST_TURNS = {"page": 30.0, "first page": 6.0}

#: Most steps of rollouts of an analysis. Times of one machine vary by half, and steps do not.
MOST_STEPS = 7_000_000

#: Delays of the command that are tried [rows].
DELAYS = range(13)


def roll_alone(path: Path, log: pd.DataFrame, joints: Sequence[str], delay: float) -> Array:
    """Return positions (N, n) [rad] of an exported file in MuJoCo, moved by a log's commands.

    Parameters
    ----------
    path : Path
        Of an MJCF.
    log : DataFrame
        With ``t``, and ``.q`` and ``.cmd`` of each joint.
    joints : sequence of str
    delay : float [s]
        From the time of a row until its command acts.
    """
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    t = log["t"].to_numpy()
    commands = log[[f"{j}.cmd" for j in joints]].to_numpy()
    at = [model.joint(j).qposadr[0] for j in joints]
    motors = [model.actuator(j).id for j in joints]
    data.qpos[at] = log[[f"{j}.q" for j in joints]].to_numpy()[0]
    times = np.arange(0.0, t[-1], model.opt.timestep)
    acting = np.clip(np.searchsorted(t, times - delay, side="right") - 1, 0, len(t) - 1)
    path_of_joints = np.zeros((len(times), len(joints)))
    for k, row in enumerate(acting):
        path_of_joints[k] = data.qpos[at]
        data.ctrl[motors] = commands[row]
        mujoco.mj_step(model, data)
    return np.stack([np.interp(t, times, x) for x in path_of_joints.T], axis=1)


def rms(error: Array) -> float:
    """Return the root mean square of errors of positions [mrad]."""
    return 1e3 * float(np.sqrt(np.mean(error**2)))


def judge_motion(
    path: Path, log: pd.DataFrame, joints: Sequence[str], delay: float
) -> dict[str, Any]:
    """Return errors [mrad] of the command, the delayed command and the exported robot."""
    q = log[[f"{j}.q" for j in joints]].to_numpy()
    command = log[[f"{j}.cmd" for j in joints]].to_numpy()
    late = [rms(command[: len(q) - k] - q[k:]) for k in DELAYS]
    begin = time.process_time()
    error = roll_alone(path, log, joints, delay) - q
    seconds = time.process_time() - begin
    worst = int(np.argmax(np.mean(error**2, axis=0)))
    return {
        "command [mrad]": rms(command - q),
        "best delay [mrad]": min(late),
        "exported [mrad]": rms(error),
        "worst joint": joints[worst],
        "its error [mrad]": rms(error[:, worst]),
        "moved in [s]": seconds,
    }


def judge_gains(
    data: Path, gains: str, motions: Sequence[str]
) -> tuple[pd.DataFrame, dict[str, float]]:
    """Return one row a held-out motion, and the processor time until each page [s]."""
    steps = 0
    plain = rollout.rollout

    def counted(model: Any, data: Any, state: Array, control: Array, **more: Any) -> Any:
        nonlocal steps
        steps += len(control)
        return plain(model, data, state, control, **more)

    with TemporaryDirectory() as folder, patch.object(rollout, "rollout", counted):
        robot = Path(folder) / "so101.urdf"
        shutil.copy(data / "so101.urdf", robot)
        robot.with_suffix(".toml").write_text(GAINS[gains])
        logs = [data / f"{name}.csv" for name in FITTED]
        seconds = {}
        begin = time.process_time()

        def write(name: str, answer: Result) -> None:
            answer.write_report(Path(folder) / "page.html")
            seconds[name] = time.process_time() - begin

        first = partial(write, "first page")
        result = analyze(robot, logs, data / f"{HELD_OUT[0]}.csv", first=first)
        write("page", result)
        needed = steps
        file = Path(folder) / "fitted.xml"
        export(robot, result.to_json(Path(folder) / "result.json"), file)
        delay = float(result.recordings.rolled.delays.mean())
        joints = result.robot.joints
        # Rollouts follow every joint, so that no command column is in doubt.
        blamed = "; ".join(of_key(result.warnings, "uneven"))
        rows = []
        for name in motions:
            log = pd.read_csv(data / f"{name}.csv")
            judged = judge_motion(file, log, joints, delay)
            told = {"blamed": blamed, "steps": needed}
            rows.append({"gains": gains, "motion": name, **judged, **told})
    return pd.DataFrame(rows), seconds


def failed_checks(frame: pd.DataFrame, seconds: dict[str, dict[str, float]]) -> list[str]:
    """Return required checks that failed, in words."""
    failed = []
    for gains, rows in frame.groupby("gains"):
        median = float(rows["exported [mrad]"].median())
        if median > MOST_ERROR:
            failed.append(f"{gains}: median error {median:.1f} mrad")
        worse = rows[rows["exported [mrad]"] >= rows["command [mrad]"]]
        failed += [f"{gains}: worse than the command in {motion}" for motion in worse["motion"]]
        if rows["steps"].max() > MOST_STEPS:
            failed.append(f"{gains}: {rows['steps'].max():,} steps of rollouts")
        failed += [f"{gains}: {blamed}" for blamed in rows["blamed"].unique() if blamed]
    for gains, times in seconds.items():
        of_gains = (frame["gains"] == gains) & frame["motion"].isin(HELD_OUT)
        turn = frame.loc[of_gains, "moved in [s]"].sum()
        late = {name: x for name, x in times.items() if x > MOST_TURNS[name] * turn}
        failed += [
            f"{gains}: {x:.0f} s of processor time until the {name}, more than "
            f"{MOST_TURNS[name] * turn:.0f} s"
            for name, x in late.items()
        ]
        failed += [f"{gains}: no {name}" for name in MOST_TURNS if name not in times]
    return failed


def main(argv: Sequence[str] | None = None) -> pd.DataFrame:
    """Run the study, print its table and write its files."""
    parser = study_parser("so101", __doc__, "gains that logs tell alone")
    parser.add_argument("--data", help="folder of the data sets")
    parser.add_argument("--sealed", action="store_true", help="roll out the sealed motions, too")
    arguments = parser.parse_args(argv)
    data = data_folder("so101", arguments.data)
    motions = HELD_OUT + SEALED * arguments.sealed
    kinds = ("fit",) if arguments.quick else tuple(GAINS)
    judged = {gains: judge_gains(data, gains, motions) for gains in kinds}
    frame = pd.concat([rows for rows, _ in judged.values()], ignore_index=True)
    seconds = {gains: x for gains, (_, x) in judged.items()}
    print(frame.round(1).to_string(index=False))
    failed = failed_checks(frame, seconds)
    median = frame.groupby("gains")["exported [mrad]"].median().round(1).to_dict()
    statement = f"Median error of held-out motions [mrad], by gains: {median}."
    more = {"seconds": seconds, "failed": failed}
    write_answer(
        arguments.out, "SO-101", statement, {"held-out motions": frame.round(1)}, __doc__, more
    )
    if failed:
        raise SystemExit(f"Required checks failed: {'; '.join(failed)}.")
    return frame


if __name__ == "__main__":
    main()
