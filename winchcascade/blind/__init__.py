"""Trials with withheld answers: an independent twin of the rig, sealed envelopes, and scores."""
