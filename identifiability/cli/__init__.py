"""The command line: its verbs, each built when it is needed."""

import io
import signal
import sys
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, NoReturn

import typer

from identifiability.foundation.values import Fields

from .options import helps


class Verbs(Mapping[str, Any]):
    """The commands by name, in the order of the help; each is built when it is needed."""

    def __init__(self) -> None:
        self.made: Fields = {}

    def __iter__(self) -> Iterator[str]:
        return iter(helps()["verbs"])

    def __len__(self) -> int:
        return len(helps()["verbs"])

    def __getitem__(self, name: str) -> Any:
        if name not in helps()["verbs"]:
            raise KeyError(name)
        if name not in self.made:
            from identifiability.cli import verbs  # noqa: PLC0415

            self.made[name] = getattr(verbs, name).made(name)
        return self.made[name]


class Group(typer.core.TyperGroup):
    """The command line: its help needs no verb's options."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.commands = Verbs()  # type: ignore[assignment] # nothing is added to it

    def get_params(self, ctx: Any) -> Any:
        """Return its switches, off by default: typer loads pydantic to convert other values."""
        switches = super().get_params(ctx)
        for switch in switches:
            switch.default = False
        return switches

    def format_commands(self, _: Any, formatter: Any) -> None:
        """Write the summaries of the verbs."""
        texts = helps()["verbs"].items()
        rows = [(name, text.partition("```")[0].replace("`", "").strip()) for name, text in texts]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


app = typer.Typer(
    name="identifiability",
    cls=Group,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Which dynamic parameters do your logs determine, and which model is worth using?",
    rich_markup_mode=None,
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
    """End the program as Ctrl-C does, so that unfinished files are removed."""
    raise SystemExit(128 + number)
