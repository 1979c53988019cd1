"""Figures of results: one style, one module for each kind of result."""
