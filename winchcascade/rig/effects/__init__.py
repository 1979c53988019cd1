"""Unmodelled effects that a rig may have, listed in `catalogue.py`."""
