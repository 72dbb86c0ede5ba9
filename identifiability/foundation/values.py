"""`frozen`: what passes between stages, frozen in fact."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, TypeVar, dataclass_transform

import numpy as np

T = TypeVar("T")

#: Letters of a field, and of a whole value, in its `repr`: one screen.
SHORT, SCREEN = 60, 1500


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(cls: type[T]) -> type[T]:
    """Make a frozen dataclass with read-only arrays and a short `repr`.

    With arrays among its fields it equals only itself and can be hashed; without any, it is equal
    to what holds the same. The arrays that were given stay writable for whoever made them.
    """
    annotations = vars(cls).get("__annotations__", {})
    arrays = tuple(n for n, a in annotations.items() if "ndarray" in str(a) or "Array" in str(a))
    own = getattr(cls, "__post_init__", None)
    if arrays:

        def freeze(self: Any) -> None:
            for name in arrays:
                held = getattr(self, name)
                if isinstance(held, np.ndarray) and held.flags.writeable:
                    view = held.view()
                    view.flags.writeable = False
                    object.__setattr__(self, name, view)
            if own is not None:
                own(self)

        cls.__post_init__ = freeze  # type: ignore[attr-defined]
    if cls.__repr__ is object.__repr__:
        cls.__repr__ = _short  # type: ignore[method-assign]
    above = any("ndarray" in str(f.type) or "Array" in str(f.type) for f in _inherited(cls))
    return dataclass(frozen=True, eq=not (arrays or above), repr=False)(cls)


def _inherited(cls: type) -> tuple[Any, ...]:
    return tuple(getattr(cls, "__dataclass_fields__", {}).values())


def _short(self: Any) -> str:
    parts = [f"{f.name}={_brief(getattr(self, f.name))}" for f in fields(self) if f.repr]
    text = f"{type(self).__name__}({', '.join(parts)})"
    return text if len(text) <= SCREEN else f"{text[:SCREEN]}…)"


def _brief(held: Any) -> str:
    if isinstance(held, np.ndarray):
        return f"<{'×'.join(map(str, held.shape)) or 'scalar'} {held.dtype}>"
    if isinstance(held, (tuple, list)) and len(held) > 3:
        return f"<{len(held)} of {type(held[0]).__name__}>"
    text = repr(held)
    return text if len(text) <= SHORT else f"{text[:SHORT]}…"
