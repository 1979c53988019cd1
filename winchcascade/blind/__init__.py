"""Trials with withheld answers: an independent twin of the rig, sealed answers, and scores."""
