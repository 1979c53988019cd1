"""The thresholds of the paper as text, for rigs that are based on its rig and whose logs are its
own.
"""

from winchcascade.core.rig_toml import built_in_text

PAPER_RULES = "\n[thresholds]" + built_in_text("hsu2026").partition("\n[thresholds]")[2]
"""Table [thresholds] of the built-in rig, its last one."""
