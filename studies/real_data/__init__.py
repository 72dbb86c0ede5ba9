"""Sidecars and ladders of robots whose logs are public."""

from pathlib import Path

#: Where they are.
FOLDER = Path(__file__).resolve().parent
