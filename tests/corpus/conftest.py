"""The corpus is a package of its own beside its tests, which run in folders of their own."""

import sys
from pathlib import Path

if str(Path(__file__).parent) not in sys.path:
    sys.path.insert(0, str(Path(__file__).parent))
