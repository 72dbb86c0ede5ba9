"""``identifiability simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Argument, Option

from identifiability.cli import common, options
from identifiability.cli.common import Reads, Writes


@options.command("simulation/simulator.py", "simulation/motion.py:find_motion samples")
def simulate(
    machine: options.Machine,
    recorded: options.Recorded,
    motion: Annotated[str, Argument(), Reads("motion", "CSV", always=False)],
    out: Annotated[Path, Option(), Writes(".csv", ".parquet", ".pq")],
    **own: Any,
) -> None:
    """Make the log of a simulated robot along a prescribed motion.

    **You give** a robot and a motion. **You get** a log, with noise if you say which, and with an
    effect that the robot file does not have if you hide one: try on it whether *diagnose* finds it.

        identifiability simulate 3-rps 601 --noise paper --out run.csv
        identifiability simulate 3-rps random --hide stribeck_friction=0.1 --out run.parquet
        identifiability simulate arm.urdf motion.json --noise torque=0.02,encoder=1e-5 --out run.csv
        identifiability simulate fitted.xml measured.csv --out again.csv

    Noise levels are motion, torque (shares of each value), additive (share of the joint's rms),
    correlation (of the additive part from sample to sample) and encoder (steps, rad or m).

    Parameters
    ----------
    motion
        CSV or Parquet with `t` and `<joint>.q` (and `<joint>.dq`, `<joint>.ddq`), the name
        of a shipped trajectory (3-rps: 571, 595, 601), FILE.json:NAME, or 'random'.
    out
        Log to write: .csv or .parquet.
    """
    with common.sentences():
        import numpy as np  # noqa: PLC0415

        from identifiability.effects import effect_laws  # noqa: PLC0415
        from identifiability.foundation.errors import listing  # noqa: PLC0415
        from identifiability.simulation import simulate as run  # noqa: PLC0415
        from identifiability.simulation.forces import left_out  # noqa: PLC0415
        from identifiability.simulation.motion import find_motion  # noqa: PLC0415

        robot, rng = machine.load(recorded), np.random.default_rng(own["seed"])
        move = find_motion(robot, motion, own.pop("samples"), rng)
        log = run(robot, move, laws=effect_laws(), rng=rng, **own)
        log.write(out)
        missing = left_out(robot)
    if missing:
        typer.echo(
            f"The robot's sidecar states {listing(missing, 6)}, which are not simulated: give such "
            "effects by --hide."
        )
    typer.echo(f"{len(log)} samples of {robot.name} along {log.name}: {out}")
