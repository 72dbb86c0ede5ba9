"""The command line: load, validate, call the function of the same name, print where results are.

One file a command; heavy imports stand inside the functions, so that ``--help`` is quick.
"""

import io
import sys

import typer

from identifiability.cli.analyze import analyze
from identifiability.cli.calibrate import calibrate
from identifiability.cli.demo import demo
from identifiability.cli.diagnose import diagnose
from identifiability.cli.excite import excite
from identifiability.cli.export import export
from identifiability.cli.gain import gain
from identifiability.cli.grouping import Command
from identifiability.cli.inspect import inspect
from identifiability.cli.paper import paper
from identifiability.cli.prune import prune
from identifiability.cli.simulate import simulate

app = typer.Typer(
    name="identifiability",
    help="Which dynamic parameters of a robot do your logs determine, and which model is worth "
    "using?",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)
verbs = (demo, inspect, analyze, prune, diagnose, simulate, excite, export, calibrate, gain, paper)
for command in verbs:
    app.command(cls=Command)(command)


def main() -> None:
    """Run the command line."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # terminals that lack a sign print another
    app()
