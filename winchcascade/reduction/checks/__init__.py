"""Cross-checks of a reduction that need phases or the rig: load, lags between channels, zeros of
sensors, sampling.
"""
