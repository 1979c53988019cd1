"""Where measurement and model differ: by channel, phase, load and stage, against what noise and tolerances allow."""
