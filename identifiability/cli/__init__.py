"""The command line: load, validate, call the function of the same name, print where results are.

One file a command; heavy imports stand inside the functions, so that ``--help`` is quick.
"""

import io
import signal
import sys
from typing import Annotated, NoReturn

import typer

from identifiability.cli.analyze import analyze
from identifiability.cli.batch import batch
from identifiability.cli.calibrate import calibrate
from identifiability.cli.compare import compare
from identifiability.cli.convert import convert
from identifiability.cli.demo import demo
from identifiability.cli.diagnose import diagnose
from identifiability.cli.excite import excite
from identifiability.cli.export import export
from identifiability.cli.gain import gain
from identifiability.cli.inspect import inspect
from identifiability.cli.new import new
from identifiability.cli.options import Command
from identifiability.cli.paper import paper
from identifiability.cli.payload import payload
from identifiability.cli.predict import predict
from identifiability.cli.prune import prune
from identifiability.cli.rollout import rollout
from identifiability.cli.simulate import simulate

app = typer.Typer(
    name="identifiability",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)
verbs = (
    *(new, demo, inspect, analyze, prune, diagnose, simulate, excite, predict, export, calibrate),
    *(payload, compare, rollout, gain, convert, batch, paper),
)
for command in verbs:
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
