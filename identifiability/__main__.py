"""``identifiability`` and ``python -m identifiability`` are the command line."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C ends it without a traceback from its first moment on."""
    try:
        from identifiability.cli import main as run  # noqa: PLC0415 - takes a while

        run()
    except KeyboardInterrupt:
        _stop()
    except ImportError as error:  # what interrupts a library of C++ while it is loaded comes as one
        reason: BaseException | None = error
        while reason is not None and not isinstance(reason, (KeyboardInterrupt, SystemExit)):
            reason = reason.__cause__ or reason.__context__
        if isinstance(reason, SystemExit):
            raise reason from None
        if reason is None:
            raise
        _stop()


def _stop() -> None:
    sys.stderr.write("Stopped.\n")
    raise SystemExit(130) from None


if __name__ == "__main__":
    main()
