"""The command line: load, validate, call the function of the same name, print where results are.

One file a command, which is found by itself; heavy imports stand inside the functions, so that
``--help`` is quick.
"""

import io
import signal
import sys
from collections.abc import Iterator, Mapping
from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated, Any, NoReturn

import typer

from identifiability.cli.options import Verb, helps

#: Verbs in the order of the help; any other file here with a function of its name is one, too.
FIRST = (
    *("new", "demo", "inspect", "analyze", "prune", "diagnose", "simulate", "excite", "predict"),
    *("export", "calibrate", "payload", "compare", "paper"),
)


def _find(name: str) -> Verb | None:
    found = getattr(import_module(f"{__name__}.{name}"), name, None)
    return found if isinstance(found, Verb) else None


class Verbs(Mapping[str, Any]):
    """The commands by name, each made when it is asked for."""

    def __init__(self) -> None:
        here = sorted(module.name for module in iter_modules(__path__))
        self.names = [n for n in FIRST if n in here]
        self.names += [n for n in here if n not in FIRST and _find(n)]
        self.made: dict[str, Any] = {}

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, name: str) -> Any:
        if name not in self.made:
            verb = _find(name) if name in self.names else None
            if verb is None:
                raise KeyError(name)
            self.made[name] = verb.made(name)
        return self.made[name]


#: Verbs that went, and what to type instead.
GONE = {
    "batch": "identifiability analyze --each FOLDER --each FOLDER --out RESULTS",
    "convert": "identifiability new FOLDER --robot table.toml",
    "rollout": "identifiability predict ROBOT RESULT.json LOG --forward",
    "gain": "identifiability payload ROBOT EMPTY.csv LOADED.csv --mass KG --centre X,Y,Z",
}


class Group(typer.core.TyperGroup):
    """The command line: its help needs no verb's options."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.commands = Verbs()  # type: ignore[assignment] # nothing is added to it

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command that was typed; of one that went, what to type instead."""
        if args and args[0] in GONE:
            ctx.fail(f"'{args[0]}' is gone: type {GONE[args[0]]}")
        return super().resolve_command(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        told = helps()["verbs"]
        brief = {n: typer.core.TyperCommand(n, help=told.get(n)) for n in self.commands}
        typer.core.TyperGroup(
            name=self.name,
            commands=brief,  # type: ignore[arg-type] # of typer's own kind
            params=self.params,
            help=self.help,
            no_args_is_help=True,
            rich_markup_mode="markdown",
        ).format_help(ctx, formatter)


app = typer.Typer(
    name="identifiability",
    cls=Group,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Which dynamic parameters do your logs determine, and which model is worth using?",
    rich_markup_mode="markdown",
)


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
    """Take the options before a verb."""


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
