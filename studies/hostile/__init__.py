"""Hostile days: files that nobody means well with, and faults while a command works."""
