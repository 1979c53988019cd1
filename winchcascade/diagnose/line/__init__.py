"""Diagnose a winch of which only the stage from the line to the shaft is known: line force, speed and mechanical power."""
