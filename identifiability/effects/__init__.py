"""Effects: the parts that models are made of, one file a subject.

Every name here is public vocabulary: reports, JSON, ladders and the command line use it.

To add an effect: a class that states its columns under `declare`, in a file of its own or in that
of its subject; the package finds the files of this folder, and `effect.ORDER` states their order.
"""

from importlib import import_module
from pkgutil import iter_modules

from .effect import Along, AlongAxes, Effect, Family, Part, Placed, Shaped, Span
from .registry import (
    FAMILIES,
    declare,
    default_effects,
    effect_laws,
    find_effect,
    find_families,
    find_family,
    forget,
    joints_of,
    load_plugin,
    name_place,
    register,
    title_of,
)

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")

__all__ = [
    "FAMILIES",
    "Along",
    "AlongAxes",
    "Effect",
    "Family",
    "Part",
    "Placed",
    "Shaped",
    "Span",
    "declare",
    "default_effects",
    "effect_laws",
    "find_effect",
    "find_families",
    "find_family",
    "forget",
    "joints_of",
    "load_plugin",
    "name_place",
    "register",
    "title_of",
]
