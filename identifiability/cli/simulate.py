"""``identifiability simulate``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Reads
from identifiability.foundation.options import Period, Seed


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    noise: Annotated[str | None, Option(metavar="LEVELS")] = None
    hide: Sequence[str] = ()
    derivatives: bool = True
    seed: Seed = 0


@options.command()
def simulate(
    machine: options.Machine,
    recorded: options.Recorded,
    motion: Annotated[str, Reads("motion", "CSV", always=False)],
    out: Annotated[Path, Option(), options.Table],
    own: Options,
    samples: Period | None = None,
) -> None:
    """Make the log of a simulated robot along a prescribed motion."""
    with common.sentences():
        import numpy as np  # noqa: PLC0415

        from identifiability.effects import effect_laws  # noqa: PLC0415
        from identifiability.foundation.errors import listing  # noqa: PLC0415
        from identifiability.simulation import simulate as run  # noqa: PLC0415
        from identifiability.simulation.forces import left_out  # noqa: PLC0415
        from identifiability.simulation.motion import find_motion  # noqa: PLC0415

        robot, rng = machine.load(recorded), np.random.default_rng(own.seed)
        move = find_motion(robot, motion, samples, rng)
        log = run(robot, move, laws=effect_laws(), rng=rng, **vars(own))
        log.write(out)
        missing = left_out(robot)
    if missing:
        typer.echo(
            f"The robot's sidecar states {listing(missing, 6)}, which are not simulated: give such "
            "effects by --hide."
        )
    typer.echo(f"{len(log)} samples of {robot.name} along {log.name}: {out}")
