"""Problems of logs: one registry of checks, in one order, with a ledger of their actions.

A check is one function with a key. Its sentences stand in `foundation/findings.toml`. Some checks
change logs when they are read (`mends`). The others compare prepared logs with the robot file,
limits and physics. Each observation or action is a `Finding`; `foundation.findings.ledger` makes a
table of them.
"""

from importlib import import_module
from pkgutil import iter_modules

from .registry import MeasuredLogs, find_always, find_oddities, mend

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")

__all__ = [
    "MeasuredLogs",
    "find_always",
    "find_oddities",
    "mend",
]
