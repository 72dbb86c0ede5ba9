"""`frozen`: immutable dataclasses that stages exchange; caches; mappings `Fields` and `Json`."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Hashable
from copy import copy
from dataclasses import dataclass, field, fields
from functools import cached_property, partial, wraps
from textwrap import shorten
from typing import Any, Concatenate, ParamSpec, TypeAlias, TypeVar, dataclass_transform

#: An object of JSON, by its keys.
Json: TypeAlias = dict[str, Any]

#: Values by the name of a field, an argument or a column.
Fields: TypeAlias = dict[str, Any]

# NumPy is imported where there are arrays: what is refused at once waits for no library.
# `frozen`: what passes between stages, frozen in fact.


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(cls: Any = None, *, kw_only: bool = False) -> Any:
    """Make a frozen dataclass with read-only arrays and a short `repr`.

    An object with arrays equals only itself and can be hashed. Objects without arrays are equal if
    their fields are. The caller's arrays stay writable. With ``@frozen(kw_only=True)`` the fields
    of the class are given by keyword. Every object has a copy of a mutable default, such as a table
    or an array.
    """
    if cls is None:
        return partial(frozen, kw_only=kw_only)
    # Of NumPy's arrays, under its name or ours.
    annotations = vars(cls).get("__annotations__", {})
    arrays = tuple(n for n, a in annotations.items() if "rray" in str(a))
    for name in annotations:
        value = vars(cls).get(name)
        if value.__hash__ is None:  # each object has a copy of its default
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
    """Return the fields without derived values: workers and keys need only these."""
    kind = type(self)
    own = (k for k in vars(self) if not isinstance(getattr(kind, k, None), cached_property))
    return {k: vars(self)[k] for k in own}


def _short(self: Any) -> str:
    parts = (f"{f.name}={reprlib.repr(getattr(self, f.name))}" for f in fields(self) if f.repr)
    return shorten(f"{type(self).__name__}({', '.join(parts)})", 280, placeholder="…)")


# Caches: of the last results, for many callers that need the same few in turn; of all results.


P = ParamSpec("P")
T = TypeVar("T")
K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


def remember(kept: dict[K, V], key: K, make: Callable[[], V], most: int) -> V:
    """Return the value of a key, or make it; if more than `most` are kept, drop the oldest."""
    if key not in kept:
        made = make()
        while len(kept) >= most:
            del kept[next(iter(kept))]
        kept[key] = made
    return kept[key]


def once_each(method: Callable[Concatenate[T, P], V]) -> Callable[Concatenate[T, P], V]:
    """Return a method whose object keeps the result of each set of arguments."""

    @wraps(method)
    def look(self: T, /, *about: P.args, **named: P.kwargs) -> V:
        results = vars(self).setdefault("_results", {})
        key = method, about, tuple(named.items())
        if key not in results:
            results[key] = method(self, *about, **named)
        return results[key]

    return look


def copy_afresh(kept: T) -> T:
    """Return a shallow copy of an object, without the results that `once_each` keeps."""
    copied = copy(kept)
    vars(copied).pop("_results", None)
    return copied
