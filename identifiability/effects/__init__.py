"""Effects: the parts that models are made of, one file a subject.

Every name here is public vocabulary: it stands in reports, JSON, ladders and on the command line.

To add an effect: a class that states its columns under `declare`, in a file of its own or in that
of its subject; files of this folder are found by themselves, and `effect.ORDER` says
where it stands among the others.
"""

from importlib import import_module
from pkgutil import iter_modules

from .effect import AlongAxes, Effect, Family, Part, Placed, Shaped, Span
from .registry import (
    FAMILIES,
    default_effects,
    effect_laws,
    find_effect,
    find_families,
    find_family,
    forget,
    load_plugin,
    register,
    title_of,
)

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")

__all__ = [
    "FAMILIES",
    "AlongAxes",
    "Effect",
    "Family",
    "Part",
    "Placed",
    "Shaped",
    "Span",
    "default_effects",
    "effect_laws",
    "find_effect",
    "find_families",
    "find_family",
    "forget",
    "load_plugin",
    "register",
    "title_of",
]
