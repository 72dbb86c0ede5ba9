"""Faults of a cluster: workers lost, workers of another program that join late, frozen schedulers.

The scheduler and its workers are processes of their own on the loopback address, as somebody would
start them; commands come to them with ``--scheduler``.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from hostile.commands import CLUSTER
from hostile.faults import ROOT, Days, Fault, check_refusal

#: A scheduler that does not answer for so long is given up [s].
PATIENCE = 10

#: Seconds from the freezing of a scheduler in which its command must have ended: a command asks
#: after ten seconds without a result, and waits for the answer as long as it was told.
SOON = 45.0

#: Seconds for a scheduler or a worker to be there.
THERE = 60.0

#: What a worker of another program adds to the work: that it did any is seen.
_OTHER = """
_right = run_limited

def run_limited(function, item):
    open({mark!r}, "a").close()
    return _right(function, item)
"""

#: What a command may say whose scheduler is silent.
SILENT = ("has not answered for", "There is no Dask scheduler", "was lost", "has no workers")


class ClusterDays(Days):
    """A place where commands on a cluster are hit as well."""

    def kills_on_a_cluster(self, command: str, count: int) -> Iterator[Fault]:
        """Yield faults: signals to a command that started a cluster of this machine."""
        with self.on(CLUSTER):
            yield from self.kills(command, count)

    def lost_workers_of_a_cluster(self, command: str, count: int) -> Iterator[Fault]:
        """Yield faults: workers of a cluster of this machine are killed."""
        with self.on(CLUSTER):
            yield from self.lost_workers(command, count)

    def late_workers(self, command: str, count: int) -> Iterator[Fault]:
        """Yield faults: a worker of another program joins shortly before or while a command works.

        It either gets nothing to do or ends the command with a sentence; it must never compute.
        """
        with tempfile.TemporaryDirectory() as name, _Cluster(Path(name, "cluster")) as cluster:
            others = [_other_program(Path(name), older) for older in (False, True)]
            for k in range(count):
                with self.place() as root, self.on(cluster.where):
                    late = float(self.rng.uniform(0.0, 0.8)) * self.reference(command)[1]
                    start = time.monotonic()
                    process = self.start(command, root)
                    time.sleep(late)
                    process.send_signal(signal.SIGSTOP)  # a worker takes seconds to join
                    with cluster.guest(others[k % 2]):
                        process.send_signal(signal.SIGCONT)
                        problems = self.end(process, root, command, (0, 2))
                    problems += check_refusal(process, root, ("version of identifiability",))
                    if (Path(name) / "computed").exists():
                        problems.append("a worker of another program computed")
                    problems += self.finish(command, root)
                    how = "refused" if process.returncode == 2 else "got nothing to do"
                    what = f"{'an older' if k % 2 else 'another'} program after {late:.2f} s: {how}"
                    told, took = self.told(command), time.monotonic() - start
                    yield Fault("late worker", told, what, took, tuple(problems))

    def frozen_schedulers(self, command: str, count: int) -> Iterator[Fault]:
        """Yield faults: a scheduler stops with its connections open, and goes on later."""
        with tempfile.TemporaryDirectory() as name, _Cluster(Path(name, "cluster")) as cluster:
            for _ in range(count):
                with self.place() as root, self.on(cluster.where):
                    at = float(self.rng.uniform(0.0, 1.0)) * self.reference(command)[1]
                    start = time.monotonic()
                    process = self.start(command, root)
                    time.sleep(at)
                    cluster.scheduler.send_signal(signal.SIGSTOP)
                    frozen = time.monotonic()
                    problems = self.end(process, root, command, (0, 2))
                    took = time.monotonic() - frozen
                    cluster.scheduler.send_signal(signal.SIGCONT)
                    if took > SOON:
                        problems.append(f"waited {took:.0f} s for a silent scheduler")
                    problems += check_refusal(process, root, SILENT) + self.finish(command, root)
                    what = f"frozen after {at:.2f} s: code {process.returncode} {took:.1f} s later"
                    told, took = self.told(command), time.monotonic() - start
                    yield Fault("frozen scheduler", told, what, took, tuple(problems))


def _other_program(place: Path, older: bool) -> Path:
    """Write a copy of the package that tells when it computes, and return where.

    The older one does not know how its work is checked.
    """
    folder = place / ("older" if older else "changed")
    shutil.copytree(
        ROOT / "identifiability", folder / "identifiability",
        ignore=shutil.ignore_patterns("__pycache__"),
    )  # fmt: skip
    engines = folder / "identifiability" / "foundation" / "engines"
    with (engines / "mapping.py").open("a") as file:
        file.write(_OTHER.format(mark=str(place / "computed")))
    if older:
        text = (engines / "cluster.py").read_text()
        (engines / "cluster.py").write_text(text.replace("def run_checked", "def _run_checked"))
    return folder


class _Cluster:
    """A scheduler and one worker of this program.

    Parameters
    ----------
    place : Path
        Folder that it makes for what it writes.
    """

    def __init__(self, place: Path) -> None:
        self.place = place

    def __enter__(self) -> _Cluster:
        self.place.mkdir()
        self._stack = contextlib.ExitStack()
        with contextlib.ExitStack() as stack:
            self.scheduler = stack.enter_context(
                self._process(ROOT, "scheduler", "Scheduler at:", "--host", "127.0.0.1")
            )
            said = (self.place / "scheduler").read_text()
            address = re.search(r"tcp://[\d.]+:\d+", said)
            self.address = address[0] if address else said
            stack.enter_context(self.guest(ROOT))
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def where(self) -> tuple[str, ...]:
        """Words that bring a command here."""
        return "--scheduler", self.address, "--patience", str(PATIENCE)

    def guest(self, program: Path) -> contextlib.AbstractContextManager[subprocess.Popen[bytes]]:
        """Be with a worker more, which has this package from a folder; it is there at once."""
        more = ("--nthreads", "1", "--no-nanny", "--local-directory", str(self.place))
        return self._process(program, "worker", "Registered to:", self.address, *more)

    @contextlib.contextmanager
    def _process(
        self, program: Path, what: str, ready: str, *words: str
    ) -> Iterator[subprocess.Popen[bytes]]:
        env = os.environ | {
            "PYTHONPATH": str(program), "PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1",
        }  # fmt: skip
        argv = [sys.executable, "-m", f"distributed.cli.dask_{what}", *words]
        argv += ["--port", "0"] if what == "scheduler" else []
        with (self.place / what).open("wb") as said:
            process = subprocess.Popen(
                [*argv, "--no-dashboard"], cwd=self.place, env=env, stdout=said, stderr=said
            )
        try:
            until = time.monotonic() + THERE
            while ready not in (self.place / what).read_text(errors="replace"):
                if time.monotonic() > until or process.poll() is not None:
                    raise RuntimeError((self.place / what).read_text(errors="replace"))
                time.sleep(0.1)
            yield process
        finally:
            process.kill()
            process.wait()
