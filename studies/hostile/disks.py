"""Faults of disks while a command works: full, small, gone, and spoilt memories of finished work."""

from __future__ import annotations

import resource
import shutil
import time
from collections.abc import Iterator

from hostile.faults import Days, Fault
from hostile.memories import SPOILERS

#: Kept results that are spoilt before a run.
TOGETHER = 3


class DiskDays(Days):
    """A place where disks fail."""

    def full_disks(self, command: str, count: int) -> Iterator[Fault]:
        """Yield faults: no file may be longer than some bytes; with them, then without."""
        for _ in range(count):
            most = int(self.rng.integers(0, len(self.reference(command)[0])))

            def limit(most: int = most) -> None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))

            with self.place() as root:
                start = time.monotonic()
                process = self.start(command, root, limits=limit)
                problems = self.end(process, root, command, (2,)) + self.finish(command, root)
                what = f"no file longer than {most} bytes"
                yield Fault(
                    "full disk", self.told(command), what, time.monotonic() - start, tuple(problems)
                )

    def small_disks(self, command: str, count: int) -> Iterator[Fault]:
        """Yield faults: a disk of its own of some kB, or one that cannot be written to."""
        for k in range(count):
            size = "ro,size=64k" if k % 3 == 2 else f"size={4 * int(self.rng.integers(1, 8))}k"
            script = (
                f'cp good.csv ../; mount -t tmpfs -o {size} none . && cd . && cd "$PWD"; '
                'cp ../good.csv . 2>/dev/null || ln -s ../good.csv . 2>/dev/null; "$@"; code=$?; '
                "ls -A > ../listing; exit $code"
            )
            before = ("unshare", "-rm", "sh", "-c", script, "sh")
            with self.place() as root:
                start = time.monotonic()
                process = self.start(command, root, before)
                problems = self.end(process, root, command, (0, 2))
                seen = (
                    set((root / "listing").read_text().split())
                    if (root / "listing").exists()
                    else set()
                )
                if seen - {"good.csv", "out.json", "kept"}:
                    problems.append(f"left {', '.join(sorted(seen))}")
                if process.returncode == 2:
                    for path in [*(root / "scratch").rglob("out.json")]:
                        if path.read_bytes() != self.reference(command)[0]:
                            problems.append("what was saved elsewhere is another result")
                        shutil.rmtree(path.parent)
                problems += self.finish(command, root)
                yield Fault(
                    "small disk",
                    self.told(command),
                    size,
                    time.monotonic() - start,
                    tuple(problems),
                )

    def vanished(self, command: str, count: int) -> Iterator[Fault]:
        """Yield faults: the folder of the result is moved away while the command works."""
        _, whole = self.reference(command)
        for _ in range(count):
            with self.place() as root:
                at = float(self.rng.uniform(0.1, 0.9)) * whole
                start = time.monotonic()
                process = self.start(command, root)
                time.sleep(at)
                (root / "work").rename(root / "moved")
                problems = self.end(process, root, command, (0, 2))
                (root / "moved").rename(root / "work")
                for path in [*(root / "scratch").rglob("out.json")]:
                    if path.read_bytes() != self.reference(command)[0]:
                        problems.append("what was saved elsewhere is another result")
                    shutil.rmtree(path.parent)
                problems += self.finish(command, root)
                what = f"moved after {at:.2f} s"
                yield Fault(
                    "vanished folder",
                    self.told(command),
                    what,
                    time.monotonic() - start,
                    tuple(problems),
                )

    def spoilt_memories(self, command: str, count: int) -> Iterator[Fault]:
        """Yield faults: what is kept is cut, turned, older, foreign, a program, a pipe, a link."""
        with self.place() as root:
            first = self.finish(command, root)
            for k in range(0, count, TOGETHER):
                start = time.monotonic()
                kept = sorted((root / "work" / "kept").rglob("*.result"))
                names = [
                    tuple(SPOILERS)[j % len(SPOILERS)] for j in range(k, min(k + TOGETHER, count))
                ]
                for name, at in zip(names, self.rng.permutation(len(kept)), strict=False):
                    SPOILERS[name](kept[at], root, self.rng)
                problems = tuple(first + self.finish(command, root))
                first = []
                for name in names:
                    yield Fault(
                        "spoilt memory",
                        self.told(command),
                        name,
                        time.monotonic() - start,
                        problems,
                    )
