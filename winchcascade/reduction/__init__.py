"""From a run to phases, windows, energies, efficiencies and their uncertainties."""
