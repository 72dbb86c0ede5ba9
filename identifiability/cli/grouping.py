"""How groups of options become the options of a command, with help from docstrings.

A command names a group as one parameter, ``place: Place``; `command` puts the group's options in
its place.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from copy import copy
from dataclasses import fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, getdoc, signature
from typing import Annotated, Any, get_args, get_type_hints

import typer
from typer import Argument, Option

#: Where a docstring begins to speak of parameters, and what it says of one.
_HELP = re.compile(r"\n*^(?:Parameters|Attributes)\n-+\n", re.MULTILINE)
_ENTRY = re.compile(r"^(\w+)\n((?: {4}.*\n)+)", re.MULTILINE)


#: Options that take effects, and verbs in which an option of that name takes something else.
TAKES_EFFECTS = {"effects": (), "hide": (), "separate": (), "model": ("calibrate",)}


#: Options that had another name: verb and old name, and the new one.
RENAMED = {
    ("calibrate", "--trials"): "--replicates",
    ("prune", "--model"): "--out",
}


def shipped_robots() -> list[str]:
    """Return the names of the shipped robots."""
    from identifiability.robot import locate  # noqa: PLC0415

    return locate.shipped_robots()


def estimators(typed: str = "") -> list[str]:
    """Return the registered estimators that begin so, a plugin's among them."""
    from identifiability.estimation.estimate import ESTIMATORS  # noqa: PLC0415

    return [name for name in ESTIMATORS if name.startswith(typed)]


def command(
    function: Callable[..., None],
    first: Callable[[dict[str, Any], dict[str, tuple[Any, ...]]], None] = lambda _given, _marks: (
        None
    ),
) -> Callable[..., None]:
    """Return the function as a command: groups become their options, with help from docstrings.

    `first` is called before it, with what was typed (groups and options by name) and with the
    marks that stand beside options in annotations, by name.

    An option of the command itself stands before one of a group with its name. What a docstring
    says of its parameters or attributes is the help of these options, and the rest of the
    function's is the help of the command.
    """
    hints = get_type_hints(function)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    own = {option.name: option for option in _options(function)}
    flat = [
        option
        for name in signature(function).parameters
        for option in (_options(groups[name]) if name in groups else [own[name]])
        if name not in groups or option.name not in own
    ]

    holders = (function, *groups.values())
    marks = {name: found for holder in holders for name, found in _marks(holder).items()}

    @wraps(function)
    def called(**options: Any) -> None:
        whole = {
            name: kind(**{f.name: options.pop(f.name) for f in fields(kind) if f.name not in own})
            for name, kind in groups.items()
        }
        first({**whole, **options}, marks)
        function(**whole, **options)

    called.__doc__ = _HELP.split(getdoc(function) or "")[0]
    called.__signature__ = Signature(flat)  # type: ignore[attr-defined]
    called.__annotations__ = {option.name: option.annotation for option in flat}
    return called


def _options(holder: Any) -> list[Parameter]:
    """Return the parameters of a function or group as typer reads them, with help."""
    told = _HELP.split(getdoc(holder) or "")[-1]
    helps = {name: " ".join(text.split()) for name, text in _ENTRY.findall(f"{told}\n")}
    kinds = get_type_hints(holder, include_extras=True)
    found = []
    for name, given in signature(holder).parameters.items():
        kind, notes = kinds[name], getattr(kinds[name], "__metadata__", ())
        if notes:
            kind, note = get_args(kind)[0], copy(notes[0])
        else:
            note = Argument() if given.default is given.empty else Option()
        if name in helps:
            note.help = helps[name]
        found.append(given.replace(kind=Parameter.KEYWORD_ONLY, annotation=Annotated[kind, note]))
    return found


def _marks(holder: Any) -> dict[str, tuple[Any, ...]]:
    """Return what stands beside the options of a function or group in their annotations."""
    hints = get_type_hints(holder, include_extras=True)
    kinds = {name: getattr(kind, "__metadata__", ())[1:] for name, kind in hints.items()}
    return {name: found for name, found in kinds.items() if found}


def effects(option: str) -> list[str]:
    """Return the effects that an option takes, a plugin's among them."""
    if option == "hide":
        from identifiability.effects import effect_laws  # noqa: PLC0415
        from identifiability.simulation.forces import hideable  # noqa: PLC0415

        return hideable(effect_laws())
    from identifiability.effects.registry import FAMILIES  # noqa: PLC0415

    return list(FAMILIES)


class Command(typer.core.TyperCommand):
    """A command whose help lists what there is when it is asked for, and that knows old options."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        takes, robots = "", ""
        for parameter in self.params:
            name = str(parameter.name)
            if name == "method":
                parameter.metavar = "|".join(estimators())
            if name in TAKES_EFFECTS and str(self.name) not in TAKES_EFFECTS[name]:
                takes = f"**Effects**: {', '.join(effects(name))}"
            if name == "robot":
                robots = f"**Shipped robots**: {', '.join(shipped_robots())}"
        self.epilog = "\n\n".join(filter(None, (robots, takes))) or None
        super().format_help(ctx, formatter)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse an option that has another name now, with that name."""
        for given in args[: args.index("--")] if "--" in args else args:
            new = RENAMED.get((str(self.name), given.partition("=")[0]))
            if new is not None:
                ctx.fail(f"{given.partition('=')[0]} is called {new} now.")
        return super().parse_args(ctx, args)
