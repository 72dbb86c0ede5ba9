"""The studies stand beside the package; tests import them from there."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
STUDIES = ROOT / "studies"
if str(STUDIES) not in sys.path:
    sys.path.insert(0, str(STUDIES))
