"""What decided the numbers of a result: versions, seed, options, and hashes of what went in."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from hashlib import sha256

import clarabel

from identifiability.foundation import __version__
from identifiability.foundation.engines.resume import NUMERICS, find_version
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.regression.reduction import LadderSource
from identifiability.robot import Robot

_PACKAGES = (*NUMERICS, "pandas")


def state_provenance(
    robot: Robot,
    samples: Sequence[Prepared],
    seed: int,
    source: LadderSource | None = None,
    options: Mapping[str, object] | None = None,
) -> dict[str, str]:
    """Return everything that decided the numbers: versions, seed, options, hashes of the inputs."""
    out = {"python": platform.python_version(), "identifiability": __version__}
    for package in _PACKAGES:
        out[package] = find_version(package) or "not installed"
    out["seed"] = str(seed)
    out["solver"] = _solver_settings()
    out.update({name: str(value) for name, value in (options or {}).items()})
    out[f"sha256 {robot.path.name}"] = robot.sha256
    if robot.sidecar is not None:
        out["sidecar"] = robot.sidecar.name
        out[f"sha256 {robot.sidecar.name}"] = sha256(robot.sidecar.read_bytes()).hexdigest()
    if robot.columns:
        out["columns"] = robot.columns.text
    if robot.time_unit:
        out["time unit"] = robot.time_unit
    if robot.torque.text:
        out["torque"] = robot.torque.text
    if robot.known_torque:
        out["known torque"] = "; ".join(k.text for k in robot.known_torque)
    if robot.angles is not None:
        out["angles"] = robot.angles
    if robot.locked:
        out["locked"] = ", ".join(f"{name} = {at:g}" for name, at in robot.locked.items())
    if source is not None:
        out["ladder"] = source.origin
        out["sha256 ladder"] = source.sha256
    for s in samples:
        out[f"sha256 {s.name}"] = s.sha256
    return out


def _solver_settings() -> str:
    """Return the solver of the physical set and its tolerances, which are its own defaults."""
    own = clarabel.DefaultSettings()
    return (
        f"clarabel, tol_gap_rel {own.tol_gap_rel:g}, tol_feas {own.tol_feas:g}, "
        f"max_iter {own.max_iter}"
    )
