"""`Stages`: results of pure functions, each computed once for the same inputs."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

#: Inputs that are compared by value; all others are compared by identity.
_BY_VALUE = (str, int, float, bool, bytes, Path, Enum, type(None))


class Stages:
    """A cache of results of stages.

    Inputs of a stage are results of earlier stages, which are frozen: the same object means the
    same content. Objects with a `stage_key` are the same if their keys are equal. The cache keeps
    its inputs alive, so that no identity is used twice. It is not pickled: a copy starts empty.
    """

    def __init__(self) -> None:
        self._kept: dict[tuple[Any, ...], tuple[Any, tuple[Any, ...]]] = {}

    def once(self, make: Callable[..., R], *inputs: Any, **call: Any) -> R:
        """Return ``make(*inputs, **call)``, computed at the first call with these inputs.

        Parameters
        ----------
        make : callable
            A function of a module.
        inputs
            Inputs that determine the result.
        call
            Arguments that do not affect it: the engine, progress.
        """
        key = (make, *map(_identity, inputs))
        if key not in self._kept:
            self._kept[key] = (make(*inputs, **call), inputs)
        return self._kept[key][0]

    def release(self) -> None:
        """Forget all results."""
        self._kept.clear()

    def __reduce__(self) -> tuple[type[Stages], tuple[()]]:
        """Return an empty memory for a copy."""
        return Stages, ()


def _identity(value: Any) -> Any:
    """Return a key that two equal inputs share."""
    if isinstance(value, _BY_VALUE):
        return type(value), value
    if isinstance(value, tuple):
        return tuple(map(_identity, value))
    return getattr(value, "stage_key", id(value))
