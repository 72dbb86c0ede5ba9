"""``python -m identifiability`` is the command line."""

from identifiability.cli import main

main()
