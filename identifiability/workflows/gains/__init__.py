"""What one unit of a torque column is, from logs with and without a known load.

What to use when: `identify_gains`, where a log's torques are currents or units of a drive.
"""

from identifiability.workflows.gains.result import Gain, Gains
from identifiability.workflows.gains.workflow import identify_gains

__all__ = ["Gain", "Gains", "identify_gains"]
