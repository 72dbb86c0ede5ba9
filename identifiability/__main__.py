"""``identifiability`` and ``python -m identifiability`` are the command line."""

import gc
import sys

#: New objects after which cycles of them are looked for, and how often among older ones. A command
#: makes few, and arrays are freed without: by default it spent a twentieth of its time looking.
SELDOM = (200_000, 20, 20)


def main() -> None:
    """Run the command line; Ctrl-C ends it without a traceback from its first moment on."""
    gc.set_threshold(*SELDOM)
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
