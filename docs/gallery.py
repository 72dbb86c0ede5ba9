"""Make the five real pages that the documentation opens with: `python docs/gallery.py FOLDER`.

Of the sample logs that are shipped, as `identifiability new` copies them; `make docs` writes them
beside the site.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from identifiability import Robot, analyze, diagnose, new_study, payload, predict
from identifiability.foundation.result import Result


def _logs(folder: Path, robot: str) -> tuple[Robot, list[Path]]:
    study = new_study(folder / robot, robot=robot)
    logs = [study.folder / f"run{k}.csv" for k in (1, 2, 3)]
    return Robot.load(study.folder / study.robot), [log for log in logs if log.exists()]


def arm(folder: Path) -> Result:
    """Return what logs determine of a six-axis arm."""
    robot, logs = _logs(folder, "six-dof-arm")
    return analyze(robot, logs[:2], validate=logs[2])


def closed_chain(folder: Path) -> Result:
    """Return what logs determine of a parallel robot."""
    robot, logs = _logs(folder, "3-rps")
    return analyze(robot, logs)


def quadruped(folder: Path) -> Result:
    """Return how a robot without torque sensors moves by commands, before and after a fit."""
    robot, logs = _logs(folder, "quadruped")
    fitted = analyze(robot, logs[:2]).to_json("fitted.json")
    return predict(robot, fitted, logs[2], forward=True)


def missing(folder: Path) -> Result:
    """Return what the model of the arm misses."""
    robot, logs = _logs(folder, "six-dof-arm")
    found = diagnose(robot, logs[:2], validate=logs[2])
    found.write_model("model.toml")
    return found


def load(folder: Path) -> Result:
    """Return what hangs on the arm."""
    robot, logs = _logs(folder, "six-dof-arm")
    loaded = logs[0].with_name("loaded.csv")
    return payload(robot, analyze(robot, logs[:2]), loaded, without=logs[2])


#: By the name of the file.
PAGES: dict[str, Callable[[Path], Result]] = {
    "arm": arm,
    "closed-chain": closed_chain,
    "quadruped": quadruped,
    "missing": missing,
    "payload": load,
}


def write_gallery(out: Path) -> list[Path]:
    """Write every page into a folder."""
    out = out.absolute()
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for name, make in PAGES.items():
        # Lines to type name logs as from their own folder.
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            written.append(make(Path()).write_report(out / f"{name}.html"))
    return written


if __name__ == "__main__":
    write_gallery(Path(sys.argv[1]))
