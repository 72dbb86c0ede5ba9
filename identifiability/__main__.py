"""``identifiability`` and ``python -m identifiability`` are the command line."""

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import TextIO

from identifiability.foundation.loading import import_less, loading


def main() -> None:
    """Run the command line; Ctrl-C ends it without a traceback from its first moment on."""
    # A cron job may lack both streams: output is then dropped, and the work is done.
    sys.stdout, sys.stderr = sys.stdout or _nowhere(), sys.stderr or _nowhere()
    import_less()
    try:
        with loading():
            from identifiability.cli import main as run  # noqa: PLC0415 - takes a while
        try:
            run()
        finally:
            sys.stdout.flush()
    except KeyboardInterrupt:
        _stop()
    except BrokenPipeError:
        raise
    except OSError as error:  # of the stream alone: those of files are sentences already
        sys.stdout = _nowhere()
        with suppress(OSError):  # it may be the very one
            sys.stderr.write(f"Error: the output cannot be written: {error.strerror or error}.\n")
        raise SystemExit(2) from None
    except (ImportError, RuntimeError) as error:
        # An interrupt arrives wrapped if it comes while a C++ library is loaded or a class is made.
        reason: BaseException | None = error
        while reason is not None and not isinstance(reason, (KeyboardInterrupt, SystemExit)):
            reason = reason.__cause__ or reason.__context__
        if isinstance(reason, SystemExit):
            raise reason from None
        if reason is None:
            raise
        _stop()


def _nowhere() -> TextIO:
    return Path(os.devnull).open("w")


def _stop() -> None:
    sys.stderr.write("Stopped.\n")
    raise SystemExit(130) from None


if __name__ == "__main__":
    from robot_identifiability import main as check_and_run

    check_and_run()
