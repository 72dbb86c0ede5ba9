"""The benchmarks beside others and beside naive forms stand in studies/."""

import sys
from pathlib import Path

STUDIES = Path(__file__).resolve().parents[2] / "studies"
sys.path.insert(0, str(STUDIES))
