"""The corrected rig in irregular waves: seas, floats, and what the rig gives in them."""
