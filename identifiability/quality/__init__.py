"""What is wrong with logs: one registry of checks, in one order, with a ledger of what was done.

A check is one function with a key, whose sentences stand in `foundation/findings.toml`; some change
logs when they are read (`mends`), the others compare prepared logs with robot file, limits and
physics. What each found or did is a `Finding`, of which `foundation.findings.ledger` makes
the table.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from .registry import MeasuredLogs, Oddities, RawLogs, find_always, find_oddities, mend

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")

__all__ = [
    "MeasuredLogs",
    "Oddities",
    "RawLogs",
    "find_always",
    "find_oddities",
    "mend",
]
