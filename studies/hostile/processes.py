"""The processes of a command, as Linux lists them."""

from __future__ import annotations

from pathlib import Path


def members(session: int) -> list[int]:
    """Return the processes of a session that have not ended."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(path.parent.name))
    return found


def is_worker(process: int, leader: int) -> bool:
    """Return whether a process is a worker that another one started."""
    try:
        words = Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return False
    return process != leader and any(b"popen_loky" in w or b"spawn_main" in w for w in words)
