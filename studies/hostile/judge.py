"""Run a command on a hostile file in a process of its own, and say what it should not have done.

The command line is loaded once; every file is read by a fork of that process, under limits, with an
audit hook that writes down what would start programs, speak to a network or write elsewhere.
"""

from __future__ import annotations

import gc
import os
import re
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unicodedata import category

from hostile.case import Hostile

#: What a file may cost: seconds of CPU with the start of the program, seconds, and bytes.
CPU, WALL, MEMORY = 5.0, 60.0, 1_000_000_000

#: Beyond which a process is stopped: bytes more than the program has, and bytes of a file.
ADDRESSES, LARGEST = 4_000_000_000, 200_000_000

#: Letters of the longest sentence that anybody reads.
LONGEST = 800

#: What no file may cause, as Python's audit events.
FORBIDDEN = (
    "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork", "os.startfile",
    "subprocess.Popen", "socket.connect", "socket.bind", "socket.getaddrinfo", "socket.sendto",
    "urllib.Request", "pickle.find_class", "webbrowser.open", "os.kill",
)  # fmt: skip

#: What changes files, and which of its arguments are paths.
CHANGES = {
    "os.remove": 1, "os.rename": 2, "os.mkdir": 1, "os.rmdir": 1, "os.symlink": 2, "os.link": 2,
    "os.chmod": 1, "os.chown": 1, "os.truncate": 1, "shutil.rmtree": 1,
}  # fmt: skip

#: Names of files that commands may make.
MADE = "made"

#: What stands in a file that hostile files try to bring out.
SECRET = "the-secret-of-the-study"


@dataclass(frozen=True)
class Outcome:
    """What came of a file.

    Attributes
    ----------
    reader, name : str
    result : str
        ``refused``, ``read`` or ``failed``.
    cpu, wall : float
        [s]; CPU with the start of the program.
    memory : float
        Largest resident memory [MB].
    sentence : str
    problems : tuple of str
        Why it failed.
    """

    reader: str
    name: str
    result: str
    cpu: float
    wall: float
    memory: float
    sentence: str
    problems: tuple[str, ...]


def start_cost() -> float:
    """Load what the command line needs, so that forks have it; return the CPU that it took [s]."""
    begin = time.process_time()
    import mujoco  # noqa: F401, PLC0415
    import openpyxl  # noqa: F401, PLC0415
    import pyarrow.parquet  # noqa: F401, PLC0415
    import rosbags.highlevel  # noqa: F401, PLC0415
    import scipy.io  # noqa: F401, PLC0415

    import identifiability.cli  # noqa: PLC0415
    import identifiability.robot.compiled  # noqa: PLC0415
    import identifiability.robot.dh  # noqa: PLC0415
    import identifiability.workflows.excite  # noqa: PLC0415
    import identifiability.workflows.export  # noqa: PLC0415
    import identifiability.workflows.inspect  # noqa: PLC0415
    import identifiability.workflows.predict  # noqa: F401, PLC0415

    gc.freeze()
    return time.process_time() - begin


def judge(case: Hostile, good: Path, start: float) -> Outcome:
    """Return what came of a file.

    Parameters
    ----------
    case : Hostile
    good : Path
        Folder of good files that hostile ones are read together with.
    start : float
        CPU that the start of the program takes [s].
    """
    with tempfile.TemporaryDirectory() as place:
        root = Path(place)
        folder, scratch = root / "folder", root / "scratch"
        scratch.mkdir()
        shutil.copytree(good, folder)
        (folder / "secret.txt").write_text(SECRET)
        _make(case, folder)
        before = _listing(root)
        begin = time.monotonic()
        status, usage = _run(case, root)
        wall = time.monotonic() - begin
        said = (root / "out").read_bytes() + (root / "err").read_bytes()
        audit = (root / "audit").read_text(errors="replace").splitlines()
        new = _listing(root) - before - {"out", "err", "audit"}
    cpu, memory = usage.ru_utime + usage.ru_stime + start, usage.ru_maxrss * 1024
    text, code = said.decode(errors="replace"), os.waitstatus_to_exitcode(status)
    sentence = _sentence(text)
    problems = [*dict.fromkeys(audit), *_check_end(case, code), *_check_said(text)]
    if code == 2:
        problems += _check_sentence(text, sentence)
    problems += [f"left or wrote {p}" for p in sorted(new) if not p.startswith(f"folder/{MADE}")]
    if cpu > CPU:
        problems.append(f"{cpu:.1f} s of CPU")
    if wall > WALL:
        problems.append(f"{wall:.1f} s")
    if memory > MEMORY:
        problems.append(f"{memory / 1e6:.0f} MB")
    result = "failed" if problems else "read" if code == 0 else "refused"
    return Outcome(
        case.reader, case.name, result, cpu, wall, memory / 1e6, sentence[:300], tuple(problems)
    )


def _check_end(case: Hostile, code: int) -> list[str]:
    """Return what is wrong with how a command ended."""
    if code < 0:
        return [f"ended by {signal.Signals(-code).name}"]
    if code not in (0, 2):
        return [f"exit code {code}"]
    return ["read what cannot be read"] if case.must_fail and code == 0 else []


def _check_said(text: str) -> list[str]:
    """Return what is wrong with what a command printed."""
    short, problems = " ".join(text.split())[-200:], []
    if "Traceback" in text:
        problems.append(f"traceback: {short}")
    if re.search(r"\.py:\d+: \w*Warning", text):
        problems.append(f"warning: {short}")
    if SECRET in text:
        problems.append("printed what stands in another file")
    if "not enough memory" in text:
        problems.append("ran out of memory")
    unseen = sorted({repr(c) for c in text if category(c) in ("Cc", "Cf", "Cs") and c != "\n"})
    if unseen:
        problems.append(f"control characters on the terminal: {' '.join(unseen)}")
    return problems


def _make(case: Hostile, folder: Path) -> None:
    """Make a file in a process of its own, whose memory is not that of what reads it."""
    child = os.fork()
    if child == 0:
        done = 1
        try:
            case.make(folder)
            done = 0
        except BaseException:  # noqa: BLE001 - a fork must not go on as the study
            traceback.print_exc()
        finally:
            os._exit(done)
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
        raise RuntimeError(f"{case.reader}, {case.name}: the file could not be made")


def _run(case: Hostile, root: Path) -> tuple[int, Any]:
    """Return the status and the use of resources of a fork that runs the command."""
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if child == 0:
        _be(case, root)
    watch = os.pidfd_open(child)
    try:
        if not select.select([watch], [], [], WALL)[0]:
            os.killpg(child, signal.SIGKILL)
    finally:
        os.close(watch)
    _, status, usage = os.wait4(child, 0)
    return status, usage


def _be(case: Hostile, root: Path) -> None:
    """Be the command; never returns."""
    code = 1
    try:
        os.setsid()
        for number, name in ((1, "out"), (2, "err")):
            os.dup2(os.open(root / name, os.O_WRONLY | os.O_CREAT, 0o600), number)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.chdir(root / "folder")
        os.environ.update(TMPDIR=str(root / "scratch"), COLUMNS="100", HOME=str(root / "scratch"))
        tempfile.tempdir = None
        size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST, LARGEST))
        resource.setrlimit(resource.RLIMIT_CPU, (2 * int(CPU), 3 * int(CPU)))
        resource.setrlimit(resource.RLIMIT_AS, (size + ADDRESSES, size + ADDRESSES))
        sys.argv = ["identifiability", *case.words]
        from identifiability.cli import main  # noqa: PLC0415

        sys.addaudithook(_hook(root))
        main()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # noqa: BLE001 - it is what the study looks for
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(code)


def _hook(root: Path) -> Callable[[str, tuple[Any, ...]], None]:
    """Return an audit hook that writes down what must not be."""
    audit = os.open(root / "audit", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)

    def tell(text: str) -> None:
        os.write(audit, f"{text[:200]}\n".encode(errors="replace"))

    def inside(path: Any) -> bool:
        if isinstance(path, int):
            return True
        place = Path(os.path.realpath(os.path.dirname(os.fsdecode(path)) or "."))  # noqa: PTH120
        return place == root or root in place.parents

    def hook(event: str, args: tuple[Any, ...]) -> None:
        if event in FORBIDDEN:
            tell(f"{event} {args!r:.100}")
        elif event == "ctypes.dlopen" and args[0] and inside(args[0]):
            tell(f"loaded {args[0]!r}")
        elif event == "open" and args[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
            if not inside(args[0]) and os.fsdecode(args[0]) != os.devnull:
                tell(f"wrote {args[0]!r}")
        elif event in CHANGES and not all(inside(p) for p in args[: CHANGES[event]]):
            tell(f"{event} {args!r:.100}")

    return hook


def _listing(root: Path) -> set[str]:
    return {str(p.relative_to(root)) for p in root.rglob("*")}


def _sentence(text: str) -> str:
    """Return what a command said last, from the word Error on."""
    start = text.rfind("Error: ")
    return text[start:].strip() if start >= 0 else text.strip()[-300:]


def _check_sentence(text: str, sentence: str) -> list[str]:
    """Return what is wrong with the sentence of a refusal."""
    if text.lstrip().startswith("Usage: "):  # a name that looks like an option
        return []
    if text.count("Error: ") != 1 and not re.search(r"Error: all is well", text):
        return [f"{text.count('Error: ')} sentences: {text[-200:]!r}"]
    if not sentence or "\n" in sentence:
        return [f"no single line: {sentence[:200]!r}"]
    if len(sentence) > LONGEST:
        return [f"a sentence of {len(sentence)} letters: {sentence[:200]!r}"]
    return [] if sentence[-1] in ".?" else [f"no full stop: {sentence[-100:]!r}"]
