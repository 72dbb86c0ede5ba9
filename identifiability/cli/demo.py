"""``identifiability demo``: the paper's robot, simulated, analysed and validated."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from identifiability.cli import common, options
from identifiability.cli.analyze import print_analysis
from identifiability.cli.common import Writes
from identifiability.foundation.options import Seed

if TYPE_CHECKING:
    from identifiability.logs import Log
    from identifiability.workflows.analyze import Analysis


@options.command()
def demo(
    quick: bool = False,
    folder: Annotated[Path, Writes()] = Path("reports"),
    seed: Seed = 0,
) -> None:
    """Run the main job on a simulated robot: the paper's 3-RPS with the paper's noise."""
    with common.sentences(), common.progress() as say:
        folder.mkdir(parents=True, exist_ok=True)
        outputs = options.Outputs(folder / "demo.html", folder / "demo.json")
        common.check_outputs(outputs.report, outputs.json)
        result, logs = run_demo(quick, seed, say, folder)
        read = [log.write(log.path) for log in logs]  # what the page's lines are about
        written = [*read, *outputs.write(result, say)]
    print_analysis(result, written)
    page = (folder / "demo.html").resolve().as_uri()
    print(f"Open the page: python -m webbrowser {page}")


def run_demo(
    quick: bool,
    seed: int = 0,
    say: Callable[[str, float], None] = lambda _text, _share: None,
    folder: Path = Path("reports"),
) -> tuple[Analysis, list[Log]]:
    """Analyse Models 1 to 4 of the 3-RPS robot on trajectory 601, validated on 595.

    Returns the logs, too, which have the paths of files in a folder that they may be written to.
    """
    from dataclasses import replace  # noqa: PLC0415

    import numpy as np  # noqa: PLC0415

    from identifiability.robot import Robot  # noqa: PLC0415
    from identifiability.simulation import PAPER_NOISE, simulate  # noqa: PLC0415
    from identifiability.simulation.motion import find_motion  # noqa: PLC0415
    from identifiability.workflows.analyze import analyze  # noqa: PLC0415

    robot, logs = Robot.load("3-rps"), []
    for name, rng in zip(("601", "595"), np.random.default_rng(seed).spawn(2), strict=True):
        say(f"simulating trajectory {name}", 0.0)
        motion = find_motion(robot, name, 100 if quick else None, rng)
        log = simulate(robot, motion, noise=PAPER_NOISE, rng=rng)
        logs.append(replace(log, name=f"{name}.csv", path=str(folder / f"{name}.csv")))
    return analyze(robot, logs[:1], logs[1:], seed=seed, progress=say), logs
