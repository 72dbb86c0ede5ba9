"""``identifiability`` and ``python -m identifiability`` are the command line."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C ends it without a traceback from its first moment on."""
    try:
        from identifiability.cli import main as run  # noqa: PLC0415 - takes a while

        run()
    except KeyboardInterrupt:
        sys.stderr.write("Stopped.\n")
        raise SystemExit(130) from None


if __name__ == "__main__":
    main()
