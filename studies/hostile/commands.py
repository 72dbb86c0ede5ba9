"""Commands that are hit while they work."""

from __future__ import annotations

#: Commands by name; ``good.csv`` is beside them, what they write is ``out.json``.
COMMANDS: dict[str, tuple[str, ...]] = {
    "analyze": ("analyze", "two-link", "good.csv", "--quick", "--json", "out.json"),
    "prune": ("prune", "two-link", "good.csv", "--quick", "--json", "out.json"),
    "excite": (
        "excite", "two-link", "--evaluations", "400", "--samples", "60", "--out", "out.json",
    ),
    "calibrate": (
        "calibrate", "two-link", "good.csv", "--quick", "--replicates", "4", "--json", "out.json",
    ),
}  # fmt: skip

#: Where they work, unless something else is said: in processes of this machine.
PLACE = ("--workers", "2")

#: The same on a cluster of this machine.
CLUSTER = (*PLACE, "--engine", "dask")
