"""What rooms above hand down: functions that a lower room calls without knowing whose they are.

The package hands them down when it is first imported, so that imports run one way all the same.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

_HANDED: dict[str, Callable[..., Any]] = {}


def hand_down(**functions: Callable[..., Any]) -> None:
    """Let lower rooms call functions by what they do."""
    _HANDED.update(functions)


def handed(name: str) -> Callable[..., Any]:
    """Return what was handed down under a name."""
    return _HANDED[name]
