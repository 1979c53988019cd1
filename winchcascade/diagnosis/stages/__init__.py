"""Diagnosis of a winch without a model: from line tension, line speed and mechanical power
alone.
"""
