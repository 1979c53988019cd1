"""Whole campaigns: every log reduced, kept, and reported together."""
