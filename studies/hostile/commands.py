"""Commands that are hit while they work."""

from __future__ import annotations

#: Commands by name; ``good.csv`` is beside them, what they write is ``out.json``.
_PLACE = ("--workers", "2", "--resume", "kept")
COMMANDS: dict[str, tuple[str, ...]] = {
    "analyze": ("analyze", "two-link", "good.csv", "--quick", *_PLACE, "--json", "out.json"),
    "prune": ("prune", "two-link", "good.csv", "--quick", *_PLACE, "--json", "out.json"),
    "excite": (
        "excite", "two-link", "--evaluations", "400", "--samples", "60", *_PLACE, "--out", "out.json",
    ),
    "calibrate": (
        "calibrate", "two-link", "good.csv", "--quick", "--replicates", "4", *_PLACE,
        "--json", "out.json",
    ),
    "analyze on a cluster": (
        "analyze", "two-link", "good.csv", "--quick", "--engine", "dask", *_PLACE,
        "--json", "out.json",
    ),
}  # fmt: skip
