"""What the baseline leaves out: one small file per unmodelled effect, listed in `catalogue.py`."""
