"""Diagnosis of a winch without a model: from line force, line speed and mechanical power alone."""
