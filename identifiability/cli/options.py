"""The options that several commands have, each declared once, and their choices."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from identifiability.cli.common import sentences

#: Where ``--help`` shows the options of velocity and acceleration, and of processes.
DERIVATIVES, COMPUTING = "Velocity and acceleration", "Where it runs"


class Derivatives(StrEnum):
    """Where velocity and acceleration come from."""

    auto = "auto"
    given = "given"
    butterworth = "butterworth"
    fourier = "fourier"


class EngineName(StrEnum):
    """Where long work runs."""

    serial = "serial"
    processes = "processes"
    dask = "dask"


def _robots(typed: str) -> list[str]:
    """Return the shipped robots that begin so, for the shell; it adds the files itself."""
    package = Path(__file__).resolve().parents[1]
    shipped = [*package.glob("models/*/robot.*"), *package.parent.glob("models/*/robot.*")]
    return sorted({p.parent.name for p in shipped if p.parent.name.startswith(typed)})


def _load_plugins(context: typer.Context, paths: list[Path] | None) -> list[Path]:
    """Register the effects of the user's files before the command asks for any."""
    if paths and not context.resilient_parsing:
        from identifiability.effects import load_plugin  # noqa: PLC0415

        with sentences():
            for path in paths:
                load_plugin(path)
    return paths or []


Robot = Annotated[
    str,
    typer.Argument(
        help="MJCF or URDF file, or a shipped robot such as 3-rps.", autocompletion=_robots
    ),
]
Logs = Annotated[
    list[str],
    typer.Argument(
        help="Logs to fit: CSV or Parquet with `t`, `<joint>.q`, `<joint>.tau` and, if measured, "
        "`<joint>.dq`, `<joint>.ddq`, in SI units; or bags of ROS, as `run.mcap:/joint_states`."
    ),
]
Validate = Annotated[
    list[str] | None, typer.Option(help="Held-out log; may be given several times.")
]
Ladder = Annotated[
    str | None, typer.Option(help="TOML ladder of models; default: the one beside the robot.")
]
Model = Annotated[
    str | None,
    typer.Option(
        help="Effects of the model, such as rigid_body,viscous_friction, or a model file (.toml)."
    ),
]
Sidecar = Annotated[str | None, typer.Option(help="TOML with what the robot file cannot say.")]
Plugin = Annotated[
    list[Path] | None,
    typer.Option(
        help="Python file that registers effects of your own; may be given several times.",
        callback=_load_plugins,
    ),
]
Report = Annotated[Path | None, typer.Option(help="Write an HTML report here.")]
Json = Annotated[Path | None, typer.Option(help="Write the result as JSON here.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of every random choice.")]
Weighting = Annotated[
    str,
    typer.Option(
        metavar="wls|ols", autocompletion=lambda: ["wls", "ols"],
        help="Weight actuators by their own variance, or all alike.",
    ),
]  # fmt: skip
CadPrior = Annotated[
    float, typer.Option(min=0, help="Weight of a log-det prior around the robot file's bodies.")
]

Source = Annotated[
    Derivatives,
    typer.Option(
        help="Velocity and acceleration: the log's own or computed.", rich_help_panel=DERIVATIVES
    ),
]
Cutoff = Annotated[
    float | None,
    typer.Option(
        min=0, help="Low-pass for computed derivatives [Hz].", rich_help_panel=DERIVATIVES
    ),
]
Period = Annotated[
    float | None,
    typer.Option(
        min=0, help="Period of periodic motion [s], for fourier.", rich_help_panel=DERIVATIVES
    ),
]
Harmonics = Annotated[
    int, typer.Option(min=1, help="Harmonics of the Fourier fit.", rich_help_panel=DERIVATIVES)
]
Decimate = Annotated[
    int | None,
    typer.Option(
        min=1, help="Parallel filter and keep every k-th sample.", rich_help_panel=DERIVATIVES
    ),
]

Engine = Annotated[
    EngineName | None,
    typer.Option(
        help="In this process, in several (default), or on a Dask cluster; the result is the same.",
        rich_help_panel=COMPUTING,
    ),
]
Workers = Annotated[
    int | None,
    typer.Option(
        min=1, help="Processes on this machine; default: one a core.", rich_help_panel=COMPUTING
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        help="Address of a running Dask scheduler, such as tcp://host:8786.",
        rich_help_panel=COMPUTING,
    ),
]
Resume = Annotated[
    Path | None,
    typer.Option(
        help="Folder that keeps finished work; the same command takes it from there when it runs "
        "again.",
        rich_help_panel=COMPUTING,
    ),
]
