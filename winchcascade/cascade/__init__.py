"""From a Run to powers, energies and efficiencies."""
