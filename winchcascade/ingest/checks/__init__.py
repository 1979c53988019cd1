"""Checks of the channels of a log that need neither phases nor the rig."""
