"""`frozen`: what passes between stages, frozen in fact; `last`: what was made last is kept."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Hashable
from copy import copy
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from textwrap import shorten
from typing import Any, TypeVar, dataclass_transform

# NumPy is imported where there are arrays: what is refused at once waits for no library.
# `frozen`: what passes between stages, frozen in fact.


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(cls: Any = None, *, kw_only: bool = False) -> Any:
    """Make a frozen dataclass with read-only arrays and a short `repr`.

    With arrays among its fields it equals only itself and can be hashed; without any, it is equal
    to what holds the same. The arrays that were given stay writable for whoever made them. With
    ``@frozen(kw_only=True)`` its own fields are given by keyword. Every object has its own copy of
    a default that can change, such as a table or an array.
    """
    if cls is None:
        return partial(frozen, kw_only=kw_only)
    # Of NumPy's arrays, under its name or ours.
    arrays = tuple(n for n, a in vars(cls).get("__annotations__", {}).items() if "rray" in str(a))
    for name in vars(cls).get("__annotations__", {}):
        value = vars(cls).get(name)
        if value.__hash__ is None:  # each object has a default of its own
            setattr(cls, name, field(default_factory=partial(copy, value)))
    own = getattr(cls, "__post_init__", None)
    if arrays:
        import numpy as np  # noqa: PLC0415

        def freeze(self: Any) -> None:
            for name in arrays:
                value = getattr(self, name)
                if isinstance(value, np.ndarray) and value.flags.writeable:
                    view = value.view()
                    view.flags.writeable = False
                    object.__setattr__(self, name, view)
            if own is not None:
                own(self)

        cls.__post_init__ = freeze
    if cls.__repr__ is object.__repr__:
        cls.__repr__ = _short
    above = any("rray" in str(f.type) for f in getattr(cls, "__dataclass_fields__", {}).values())
    cls.__getstate__ = _state
    return dataclass(frozen=True, eq=not (arrays or above), repr=False, kw_only=kw_only)(cls)


def _state(self: Any) -> dict[str, Any]:
    """Return what is its own: what follows is neither sent to workers nor part of keys."""
    kind = type(self)
    own = (k for k in vars(self) if not isinstance(getattr(kind, k, None), cached_property))
    return {k: vars(self)[k] for k in own}


def _short(self: Any) -> str:
    parts = (f"{f.name}={reprlib.repr(getattr(self, f.name))}" for f in fields(self) if f.repr)
    return shorten(f"{type(self).__name__}({', '.join(parts)})", 280, placeholder="…)")


# What was made last is kept: many ask for the same few things in turn.


K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


def remember(kept: dict[K, V], key: K, make: Callable[[], V], most: int) -> V:
    """Return what is kept under a key, or is made now; of more than `most` the oldest goes."""
    if key not in kept:
        made = make()
        while len(kept) >= most:
            del kept[next(iter(kept))]
        kept[key] = made
    return kept[key]
