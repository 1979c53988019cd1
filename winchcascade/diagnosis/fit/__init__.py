"""Logs and a rig as one problem of least squares, and the search for the effects that explain
it.
"""
