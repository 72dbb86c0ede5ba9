"""From files to `Log`: CSV, Parquet, bags of ROS, DataFrames, short and long."""

from identifiability.logs.log import Log

__all__ = ["Log"]
