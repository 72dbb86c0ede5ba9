"""Faults while a command works: signals and lost workers.

A chain is a command with one folder for what it keeps: it is hit several times and then left alone
once. After each hit: no half file, no traceback, no process that stays. After the last run: the
bits of a run that nobody disturbed, and nothing left over.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hostile.commands import COMMANDS, PLACE
from hostile.processes import is_worker, members

#: Seconds after which a command hangs, and in which its workers must be gone after it.
HANGS, GONE = 180.0, 15.0

#: Seconds in which Python itself may still be starting: no line of this program has run.
EARLY = 1.0

#: In tracebacks from before this program runs: Python opens its streams, imports what the
#: installation names, then looks for the package.
STARTING = ("init_sys_streams", "init_import_site", "_get_module_details")

ROOT = Path(__file__).resolve().parents[2]

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)


@dataclass(frozen=True)
class Fault:
    """What came of one fault.

    Attributes
    ----------
    kind, command, what : str
    seconds : float
        How long the command lived.
    problems : tuple of str
    """

    kind: str
    command: str
    what: str
    seconds: float
    problems: tuple[str, ...]


class Days:
    """A place where commands are hit.

    Parameters
    ----------
    good : Path
        Log that they read.
    rng : Generator
    """

    def __init__(self, good: Path, rng: np.random.Generator) -> None:
        self.good, self.rng = good, rng
        self.references: dict[str, tuple[bytes, float]] = {}
        self.where = PLACE

    @contextlib.contextmanager
    def on(self, where: Sequence[str]) -> Iterator[None]:
        """Let commands work elsewhere meanwhile."""
        self.where, before = tuple(where), self.where
        try:
            yield
        finally:
            self.where = before

    def told(self, command: str) -> str:
        """Return a command with where it works, as the table calls it."""
        return command if self.where == PLACE else f"{command} on a cluster"

    def reference(self, command: str) -> tuple[bytes, float]:
        """Return what a command writes if nobody disturbs it, and how long it takes [s]."""
        if command not in self.references:
            with self.place() as root, self.on(PLACE):
                start = time.monotonic()
                process = self.start(command, root)
                process.wait()
                found = (root / "work" / "out.json").read_bytes()
                self.references[command] = found, time.monotonic() - start
        return self.references[command]

    @contextlib.contextmanager
    def place(self) -> Iterator[Path]:
        """Give a root with the folders ``work`` and ``scratch``."""
        with tempfile.TemporaryDirectory() as name:
            root = Path(name)
            for folder in ("work", "scratch", "state"):
                (root / folder).mkdir(mode=0o700)
            shutil.copy(self.good, root / "work" / "good.csv")
            yield root

    def start(
        self,
        command: str,
        root: Path,
        before: Sequence[str] = (),
        limits: Callable[[], None] | None = None,
    ) -> subprocess.Popen[bytes]:
        """Start a command in a session of its own."""
        env = os.environ | {
            "PYTHONPATH": str(ROOT), "TMPDIR": str(root / "scratch"), "PYTHONDONTWRITEBYTECODE": "1",
            "XDG_STATE_HOME": str(root / "state"), "OMP_NUM_THREADS": "1",
        }  # fmt: skip
        words = [*before, sys.executable, "-m", "identifiability", *COMMANDS[command]]
        words += [*self.where, "--resume", "kept"]

        def hear() -> None:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            if limits is not None:
                limits()

        with (root / "said").open("wb") as said:
            return subprocess.Popen(
                words, cwd=root / "work", env=env, stdout=said, stderr=said,
                start_new_session=True, preexec_fn=hear,  # noqa: PLW1509 - it touches no lock
            )  # fmt: skip

    def end(
        self, process: subprocess.Popen[bytes], root: Path, command: str, codes: Sequence[int]
    ) -> list[str]:
        """Wait for a command that was hit, and return what is wrong."""
        problems = []
        try:
            code = process.wait(HANGS)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            return [f"hung for {HANGS:g} s"]
        text = (root / "said").read_text(errors="replace")
        if code not in codes:
            problems.append(f"exit code {code}: {' '.join(text.split())[-200:]}")
        if "Traceback" in text and not any(frame in text for frame in STARTING):
            problems.append("traceback: " + " ".join(text.split())[-300:])
        start = time.monotonic()
        while members(process.pid) and time.monotonic() - start < GONE:
            time.sleep(0.05)
        if members(process.pid):
            problems.append(f"{len(members(process.pid))} processes stayed")
            os.killpg(process.pid, signal.SIGKILL)
        out = root / "work" / "out.json"
        if out.exists() and out.read_bytes() != self.reference(command)[0]:
            problems.append("a half file, or another result")
        return problems

    def finish(self, command: str, root: Path) -> list[str]:
        """Run a command undisturbed after all that, and return what is wrong."""
        (root / "work" / "out.json").unlink(missing_ok=True)
        problems = self.end(self.start(command, root), root, command, (0,))
        if not (root / "work" / "out.json").exists():
            problems.append("no result after resumption")
        left = {p.name for p in (root / "work").iterdir()} - {"good.csv", "out.json", "kept"}
        left |= {p.name for p in (root / "scratch").iterdir()}
        left |= {p.name for p in (root / "work").rglob("*.tmp")}
        if left:
            problems.append(f"left over: {', '.join(sorted(left))}")
        if (root / "work" / "canary").exists():
            problems.append("ran what was stored")
        return problems

    def kills(self, command: str, count: int) -> Iterator[Fault]:
        """Yield faults: signals at random moments from the first millisecond on."""
        _, whole = self.reference(command)
        with self.place() as root:
            for k in range(count):
                number = SIGNALS[k % len(SIGNALS)]
                # A third early, while Python and its modules load.
                most = 0.5 if k % 3 == 0 else whole
                at = float(self.rng.uniform(0.001, most))
                start = time.monotonic()
                process = self.start(command, root)
                time.sleep(at)
                process.send_signal(number)
                codes = (0, 130, 128 + number, -number, 1 if at < EARLY else 0)
                problems = self.end(process, root, command, codes)
                left = [p for p in (root / "scratch").iterdir() if number != signal.SIGKILL]
                own = [p for p in left if _of(p, process.pid)]
                if own:
                    problems.append(f"left {', '.join(p.name for p in own)}")
                if k == count - 1:
                    problems += self.finish(command, root)
                what = f"{number.name} after {at:.3f} s"
                yield Fault(
                    "signal", self.told(command), what, time.monotonic() - start, tuple(problems)
                )

    def lost_workers(self, command: str, count: int) -> Iterator[Fault]:
        """Yield faults: a worker is killed as soon as there is one, or a moment later."""
        for _ in range(count):
            with self.place() as root:
                start = time.monotonic()
                process = self.start(command, root)
                hit, wait = 0, float(self.rng.uniform(0.0, 1.0))
                while process.poll() is None and not hit:
                    workers = [p for p in members(process.pid) if is_worker(p, process.pid)]
                    if workers:
                        time.sleep(wait)
                        with contextlib.suppress(ProcessLookupError):
                            os.kill(int(self.rng.choice(workers)), signal.SIGKILL)
                        hit = 1
                    time.sleep(0.02)
                # A cluster whose worker ends before it is there cannot be started.
                codes = (0,) if self.where == PLACE else (0, 2)
                problems = self.end(process, root, command, codes)
                problems += check_refusal(process, root, ("could not be started",))
                problems += self.finish(command, root)
                what = f"a worker killed after {wait:.2f} s" if hit else "no worker was there"
                yield Fault(
                    "lost worker",
                    self.told(command),
                    what,
                    time.monotonic() - start,
                    tuple(problems),
                )


def check_refusal(process: subprocess.Popen[bytes], root: Path, words: Sequence[str]) -> list[str]:
    """Return what is wrong with the sentence of a command that was refused."""
    text = " ".join((root / "said").read_text(errors="replace").split())
    if process.returncode != 2 or any(word in text for word in words):
        return []
    return [f"said {text[-200:]!r}"]


def _of(path: Path, program: int) -> bool:
    return f"-{program}-" in path.name or not path.name.startswith("identifiability-")
