"""Faults of files: units, windows, several tables, cells."""
