"""Run studies: ``python studies [NAME...] [--quick]``; those of the paper if none is named.

`identifiability paper` runs this folder by `runpy` with its ``words`` in place of the command line
and with the ``place`` where long work runs.
"""

import sys

from paper_study.command import main

if __name__ == "__main__":
    sys.exit(main(globals().get("words", sys.argv[1:]), globals().get("place")))
