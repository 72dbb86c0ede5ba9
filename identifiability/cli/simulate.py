"""``identifiability simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from identifiability.cli import options
from identifiability.cli.common import check_outputs, load_robot, sentences


def simulate(
    robot: options.Robot,
    motion: Annotated[
        str,
        typer.Argument(
            help="CSV or Parquet with `t` and `<joint>.q` (and `<joint>.dq`, `<joint>.ddq`), the "
            "name of a shipped trajectory (3-rps: 571, 595, 601), FILE.json:NAME, or 'random'."
        ),
    ],
    out: Annotated[Path, typer.Option(help="Log to write: .csv or .parquet.")],
    noise: Annotated[
        str, typer.Option(help="'none', 'paper', or levels such as motion=0.04,torque=0.05.")
    ] = "none",
    hide: Annotated[
        list[str] | None,
        typer.Option(
            help="Effect in the data but not in the robot file, as EFFECT or EFFECT=SHARE of this "
            "motion's torque; another motion gets another size."
        ),
    ] = None,
    samples: Annotated[
        int | None, typer.Option(min=20, max=10_000_000, help="Samples a period.")
    ] = None,
    derivatives: Annotated[
        bool, typer.Option(help="Whether the log has velocities and accelerations.")
    ] = True,
    sidecar: options.Sidecar = None,
    plugin: options.Plugin = None,
    seed: options.Seed = 0,
) -> None:
    """Make the log of a simulated robot along a prescribed motion.

    ```
    identifiability simulate 3-rps 601 --noise paper --out run.csv
    identifiability simulate 3-rps random --hide stribeck_friction=0.1 --out run.parquet
    ```
    """
    with sentences():
        import numpy as np  # noqa: PLC0415

        from identifiability.effects import effect_laws  # noqa: PLC0415
        from identifiability.simulation import Noise  # noqa: PLC0415
        from identifiability.simulation import simulate as run  # noqa: PLC0415
        from identifiability.simulation.motion import find_motion  # noqa: PLC0415

        check_outputs(out, inputs=[robot, motion, sidecar])
        machine = load_robot(robot, sidecar)
        rng = np.random.default_rng(seed)
        move = find_motion(machine, motion, samples, rng)
        log = run(
            machine, move, noise=Noise.parse(noise), hide=hide or (), laws=effect_laws(), rng=rng,
            derivatives=derivatives,
        )  # fmt: skip
        log.write(out)
    typer.echo(f"{len(log)} samples of {machine.name} along {log.name}: {out}")
