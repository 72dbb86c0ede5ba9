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
TAKES_EFFECTS = {"effects": (), "hide": (), "separate": (), "model": ("calibrate", "prune")}


def estimators(typed: str = "") -> list[str]:
    """Return the registered estimators that begin so, a plugin's among them."""
    from identifiability.estimation.estimate import ESTIMATORS  # noqa: PLC0415

    return [name for name in ESTIMATORS if name.startswith(typed)]


def command(
    function: Callable[..., None], first: Callable[[dict[str, Any]], None] = lambda _options: None
) -> Callable[..., None]:
    """Return the function as a command: groups become their options, with help from docstrings.

    `first` is called before it, with what was typed: groups and options by name.

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

    @wraps(function)
    def called(**options: Any) -> None:
        whole = {
            name: kind(**{f.name: options.pop(f.name) for f in fields(kind) if f.name not in own})
            for name, kind in groups.items()
        }
        first({**whole, **options})
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


def effects(option: str) -> list[str]:
    """Return the effects that an option takes, a plugin's among them."""
    if option == "hide":
        from identifiability.effects import effect_laws  # noqa: PLC0415
        from identifiability.simulation.hidden import hideable  # noqa: PLC0415

        return hideable(effect_laws())
    from identifiability.effects.registry import FAMILIES  # noqa: PLC0415

    return list(FAMILIES)


class Command(typer.core.TyperCommand):
    """A command whose help lists the estimators and effects there are when it is asked for."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        for parameter in self.params:
            name = str(parameter.name)
            if name == "method":
                parameter.metavar = "|".join(estimators())
            if name in TAKES_EFFECTS and str(self.name) not in TAKES_EFFECTS[name]:
                self.epilog = f"**Effects**: {', '.join(effects(name))}"
        super().format_help(ctx, formatter)
