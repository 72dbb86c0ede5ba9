"""Provenance of a result: versions, seed, options, and hashes of its inputs."""

import platform
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from importlib import metadata

from identifiability.foundation import __version__
from identifiability.foundation.names import PART, Strings
from identifiability.logs import Log
from identifiability.logs.prepare import Dataset
from identifiability.regression.reduction import LadderSource
from identifiability.robot import Robot

#: Packages whose version may change a result in its last bits.
_PACKAGES = ("numpy", "scipy", "pin", "mujoco", "cvxpy", "clarabel", "emcee", "pandas")


def state_provenance(
    robot: Robot,
    samples: Sequence[Dataset],
    seed: int,
    source: LadderSource | None = None,
    options: Mapping[str, object] | None = None,
) -> dict[str, str]:
    """Return the provenance of the numbers: versions, seed, options, hashes of the inputs."""
    out = {"python": platform.python_version(), "identifiability": __version__}
    out |= {package: _find_version(package) for package in _PACKAGES}
    out |= {"seed": str(seed)}
    out |= {name: str(value) for name, value in (options or {}).items()}
    out[f"sha256 {robot.path.name}"] = robot.sha256
    if robot.sidecar is not None:
        out["sidecar"] = robot.sidecar.name
        out[f"sha256 {robot.sidecar.name}"] = sha256(robot.sidecar.read_bytes()).hexdigest()
    masses = (f"{', '.join(b.bodies)}: {b.mass}" for b in robot.bounds if b.mass is not None)
    known_torque = (k.text for k in robot.known_torque)
    locked = (f"{name} = {at:g}" for name, at in robot.locked.items())
    conventions = {
        "known masses": "; ".join(masses),
        "columns": robot.columns.text,
        "time unit": robot.time_unit,
        "torque": robot.torque.text,
        "known torque": "; ".join(known_torque),
        "angles": robot.angles,
        "locked": ", ".join(locked),
    }
    out |= {name: text for name, text in conventions.items() if text}
    if source is not None:
        out["ladder"] = source.origin
        out["sha256 ladder"] = source.sha256
    out |= {f"sha256 {s.path or s.name}": s.sha256 for s in samples}
    return out


def _find_version(package: str) -> str:
    """Return the version of a package; Conda may have it under another name."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def given_paths(logs: Iterable[Log | Dataset]) -> Strings:
    """Return the paths of logs as they were given, and the names of logs in memory."""
    # A part of a log in memory bears the name of the log, as a part of a file bears its path.
    named = [log for log in logs if not log.drives_alone]
    return tuple(log.path or log.name.partition(PART)[0] for log in named)
