"""The command line: load, validate, call the function of the same name, print where results are.

One file a command, which is found by itself; heavy imports stand inside the functions, so that
``--help`` is quick.
"""

import io
import signal
import sys
from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated, NoReturn

import typer

from identifiability.cli.options import Command

app = typer.Typer(
    name="identifiability",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)
#: Verbs in the order of the help; any other file here with a function of its name is one, too.
FIRST = (
    *("new", "demo", "inspect", "analyze", "prune", "diagnose", "simulate", "excite", "predict"),
    *("export", "calibrate", "payload", "compare", "rollout", "gain", "convert", "batch", "paper"),
)
_found = sorted(module.name for module in iter_modules(__path__))
for name in sorted(_found, key=lambda name: (*FIRST, name).index(name)):
    command = getattr(import_module(f"{__name__}.{name}"), name, None)
    if command is not None:
        app.command(cls=Command)(command)


def _print_version(wanted: bool) -> None:
    if wanted:
        from identifiability import __version__  # noqa: PLC0415

        typer.echo(f"identifiability {__version__}")
        raise typer.Exit


@app.callback()
def _describe(
    *,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Which dynamic parameters do your logs determine, and which model is worth using?"""


def main() -> None:
    """Run the command line."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # terminals that lack a sign print another
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):  # not on every system
            signal.signal(getattr(signal, name), _end)
    app()


def _end(number: int, _frame: object) -> NoReturn:
    """End as after Ctrl-C: what was begun is put away."""
    raise SystemExit(128 + number)
