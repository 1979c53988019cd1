"""What a shell offers to complete a value with; where it is given nothing it offers files."""

from __future__ import annotations


def rig_names(incomplete: str) -> list[str]:
    """Built-in rigs that start like this."""
    from winchcascade.rigtoml import BUILT_IN

    return [name for name in BUILT_IN if name.startswith(incomplete)]


def table_names(incomplete: str) -> list[str]:
    """Built-in tables that start like this."""
    from winchcascade.tabletoml import BUILT_IN

    return [name for name in BUILT_IN if name.startswith(incomplete)]


def effect_names(incomplete: str) -> list[tuple[str, str]]:
    """Effects that start like this, each with what is unmodelled without it."""
    from winchcascade.effects.catalogue import EFFECTS, words

    return [(name, words(kind).summary) for name, kind in EFFECTS.items() if name.startswith(incomplete)]


def report_choices(incomplete: str) -> list[str]:
    """Choices of `--reports` that start like this."""
    from winchcascade.batch.run import REPORTS

    return [name for name in REPORTS if name.startswith(incomplete)]
