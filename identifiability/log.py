"""`Log`: measured motion and torque of the actuated joints, read from CSV, Parquet or a DataFrame.

One row a sample: ``t`` [s], ``<joint>.q`` and ``<joint>.tau`` for every actuated joint, optional
``<joint>.dq`` and ``<joint>.ddq``; SI units (rad or m, N·m or N).
"""

from __future__ import annotations

import csv
import hashlib
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from identifiability.errors import LogError, listing, near_match
from identifiability.names import Array
from identifiability.output import write_bytes, write_text

CHANNELS = ("q", "dq", "ddq", "tau")
PARQUET = (".parquet", ".pq")

#: Fewer samples than this say nothing about any robot.
FEWEST = 20

#: No time, position or torque in SI units is larger (time since 1970 in s is 1.7e9).
LARGEST = 1e12

#: No log is sampled faster than this [s].
SHORTEST_STEP = 1e-7


@dataclass(frozen=True)
class Log:
    """One recording.

    Attributes
    ----------
    name : str
        File name, or what the caller named it.
    joints : tuple of str
        Joints (or motors) in column order.
    t : (N,) [s]
    q, tau : (N, n) [rad or m; N·m or N]
    dq, ddq : (N, n) or None
        Derivatives, where the log has them for every joint.
    sha256 : str
        Hash of the file, or of the values for a DataFrame.
    """

    name: str
    joints: tuple[str, ...]
    t: Array
    q: Array
    tau: Array
    dq: Array | None
    ddq: Array | None
    sha256: str

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.t)

    @staticmethod
    def read(path: str | Path) -> Log:
        """Read a CSV or Parquet file.

        Raises
        ------
        LogError
            If the file is missing, is no table, lacks columns or holds values that cannot be.
        """
        path = Path(path)
        frame = Log.read_frame(path)
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        return _from_frame(frame, str(path), path.name, digest)

    @staticmethod
    def read_frame(path: str | Path) -> pd.DataFrame:
        """Read a CSV or Parquet file as it is.

        Raises
        ------
        LogError
            If the file is missing or is no table.
        """
        path = Path(path)
        form = "Parquet" if path.suffix.lower() in PARQUET else "CSV"
        try:
            if path.is_file():
                return pd.read_parquet(path) if form == "Parquet" else _read_csv(path)
        except pd.errors.ParserWarning:
            raise LogError(
                f"{path} has rows with more fields than its header; repair it."
            ) from None
        except Exception as error:  # noqa: BLE001 - foreign parsers may raise anything
            reason = " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__
            raise LogError(f"{path} cannot be read as {form}: {reason}.") from None
        raise LogError(f"There is no log file '{path}'; give a CSV or Parquet file.")

    @staticmethod
    def from_frame(frame: pd.DataFrame, name: str = "DataFrame") -> Log:
        """Return the log in a DataFrame with the same columns as a file.

        Raises
        ------
        LogError
        """
        log = _from_frame(frame, name, name, "")
        values = log.to_frame()
        digest = hashlib.sha256(",".join(values.columns).encode())
        digest.update(np.ascontiguousarray(values.to_numpy(float)).tobytes())
        return replace(log, sha256=digest.hexdigest())

    def to_frame(self) -> pd.DataFrame:
        """Return the log as a DataFrame that `from_frame` accepts."""
        columns = {"t": self.t}
        for kind in CHANNELS:
            values = getattr(self, kind)
            if values is not None:
                columns.update({f"{j}.{kind}": values[:, k] for k, j in enumerate(self.joints)})
        return pd.DataFrame(columns)

    def write(self, path: str | Path) -> Path:
        """Write a CSV or Parquet file, whole or not at all; CSV keeps every digit.

        Raises
        ------
        OutputError
        """
        path = Path(path)
        if path.suffix.lower() in PARQUET:
            return write_bytes(path, self.to_frame().to_parquet(index=False))
        return write_text(path, self.to_frame().to_csv(index=False))

    def select(self, joints: Sequence[str], motors: Sequence[str] = ()) -> Log:
        """Return the log with its joints in a robot's order.

        Parameters
        ----------
        joints : sequence of str
            The robot's actuated joints.
        motors : sequence of str
            Names of motors that the log may have instead (coupled transmissions).

        Raises
        ------
        LogError
            If the log names a joint that the robot does not have, or lacks one.
        """
        known = (*joints, *motors)
        for name in self.joints:
            if name not in known:
                raise LogError(
                    f"{self.name}: the column '{name}.q' names a joint that the robot does not "
                    f"have{near_match(name, known)} Its actuated joints are {listing(joints)}."
                )
        wanted = motors if motors and all(m in self.joints for m in motors) else joints
        missing = [j for j in wanted if j not in self.joints]
        if missing:
            raise LogError(
                f"{self.name} has no columns for the actuated joint"
                f"{'s' if len(missing) > 1 else ''} {listing(missing)}; every actuated joint needs "
                f"'<joint>.q' and '<joint>.tau'."
            )
        order = [self.joints.index(j) for j in wanted]

        def pick(x: Array | None) -> Array | None:
            return None if x is None else x[:, order]

        return Log(
            self.name, tuple(wanted), self.t, self.q[:, order], self.tau[:, order],
            pick(self.dq), pick(self.ddq), self.sha256,
        )  # fmt: skip


def _read_csv(path: Path) -> pd.DataFrame:
    """Read a CSV by its own header; pandas would rename repeated columns and shift long rows."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # rows longer than the header
        warnings.simplefilter("ignore", pd.errors.DtypeWarning)  # text is reported by row later
        frame = pd.read_csv(path, index_col=False)
    with path.open(encoding="utf-8-sig", newline="") as stream:
        header = next((row for row in csv.reader(stream) if row), [])
    return frame.set_axis(header, axis=1) if len(header) == frame.shape[1] else frame


def _check_columns(columns: list[str], source: str) -> None:
    """Refuse a table without time, or with a column twice."""
    if "t" not in columns:
        if len(columns) == 1 and any(mark in columns[0] for mark in ";\t"):
            raise LogError(f"{source} is not separated by commas; write it as CSV with commas.")
        likely = [c for c in columns if c == "T" or c.casefold().startswith("time")]
        guess = f", did you mean '{likely[0]}'?" if likely else "."
        raise LogError(
            f"{source} has no column 't' (time in s){guess} It has the columns {listing(columns)}."
        )
    repeated = sorted({c for c in columns if columns.count(c) > 1})
    if repeated:
        raise LogError(f"{source} has the column '{repeated[0]}' more than once; keep one of them.")


def _from_frame(frame: pd.DataFrame, source: str, name: str, digest: str) -> Log:
    columns = [str(c).strip() for c in frame.columns]
    frame = frame.set_axis(columns, axis=1)
    _check_columns(columns, source)
    joints = [c.removesuffix(".q") for c in columns if c.endswith(".q")]
    if not joints:
        raise LogError(
            f"{source} has no position column; expected '<joint>.q' and '<joint>.tau' for every "
            f"actuated joint, found {listing(columns)}."
        )
    named = {c.removesuffix(".tau") for c in columns if c.endswith(".tau")}
    for joint in joints:
        if joint not in named:
            raise LogError(
                f"{source} has '{joint}.q' but no torque column '{joint}.tau'"
                f"{near_match(joint + '.tau', _loose(columns, joint))} "
                "Every actuated joint needs both."
            )
    for joint in sorted(named):
        if joint not in joints:
            raise LogError(
                f"{source} has '{joint}.tau' but no position column '{joint}.q'"
                f"{near_match(joint + '.q', _loose(columns, joint))} "
                "Every actuated joint needs both."
            )
    values = {c: _numbers(frame, c, source) for c in columns if _wanted(c, joints)}
    _check_times(values["t"], source)
    channels = {kind: _channel(values, joints, kind) for kind in CHANNELS}
    q, tau = channels["q"], channels["tau"]
    assert q is not None
    assert tau is not None
    return Log(name, tuple(joints), values["t"], q, tau, channels["dq"], channels["ddq"], digest)


def _loose(columns: list[str], joint: str) -> list[str]:
    """Return the columns that may be a misspelt one of a joint: those that belong nowhere else."""
    owners = [(c, *c.rpartition(".")[::2]) for c in columns]
    paired = {joint, *(o for _, o, _ in owners if {f"{o}.q", f"{o}.tau"} <= set(columns))}
    return [c for c, owner, kind in owners if owner not in paired or kind not in CHANNELS]


def _wanted(column: str, joints: list[str]) -> bool:
    return column == "t" or any(column == f"{j}.{kind}" for j in joints for kind in CHANNELS)


def _channel(values: dict[str, Array], joints: list[str], kind: str) -> Array | None:
    if any(f"{j}.{kind}" not in values for j in joints):
        return None
    return np.stack([values[f"{j}.{kind}"] for j in joints], 1)


def _numbers(frame: pd.DataFrame, column: str, source: str) -> Array:
    """Return a column as floats, or say which row is not a finite number."""
    given = frame[column]
    if getattr(given.dtype, "kind", "O") in "mMcb":
        raise LogError(
            f"{source}: column '{column}' holds {given.dtype} (first '{given.iloc[0]}'); give "
            f"numbers in SI units{', seconds' if column == 't' else ''}."
        )
    numbers = pd.to_numeric(given, errors="coerce").to_numpy(float, na_value=np.nan)
    bad = np.flatnonzero(~np.isfinite(numbers))
    if len(bad):
        advice = (
            "give numbers with a decimal point"
            if len(bad) == len(numbers)
            else "remove or repair these rows"
        )
        raise LogError(
            f"{source}: column '{column}' is not a finite number in {len(bad)} of {len(numbers)} "
            f"rows, first in data row {bad[0] + 1} ('{given.iloc[bad[0]]}'); {advice}."
        )
    bad = np.flatnonzero(np.abs(numbers) > LARGEST)
    if len(bad):
        raise LogError(
            f"{source}: column '{column}' is {numbers[bad[0]]:g} in data row {bad[0] + 1}, more "
            f"than anything in SI units can be{' (time in s)' if column == 't' else ''}; repair "
            "the value or convert the unit."
        )
    return numbers


def _check_times(t: Array, source: str) -> None:
    if len(t) < FEWEST:
        raise LogError(
            f"{source} has {len(t)} samples, too few to say anything; at least {FEWEST} are needed "
            "and some hundreds are usual."
        )
    back = np.flatnonzero(np.diff(t) <= 0)
    if len(back):
        k = int(back[0])
        raise LogError(
            f"{source}: time does not increase after data row {k + 1} (t = {t[k]:g} s, then "
            f"{t[k + 1]:g} s); sort the rows and remove repeated ones."
        )
    step = float(np.median(np.diff(t)))
    if step < SHORTEST_STEP:
        raise LogError(
            f"{source} has a sampling step of {step:.3g} s, which no robot has; give the time in s."
        )
