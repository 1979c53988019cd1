"""Comparison of reduced logs: runs of one load on two sides, and the intervals of their
differences.
"""
