"""What a shell is offered to complete a value with, asked for as a shell asks."""

import os
import subprocess
import sys

import pytest

from winchcascade.core.rig_toml import BUILT_IN as RIGS
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.tables.table_file import BUILT_IN as TABLES


def offered(line: str) -> list[str]:
    """Words that bash is offered for the last word of a line."""
    code = (
        "import sys; sys.argv = ['winchcascade']; from winchcascade.cli.entry import main; main()"
    )
    asked = {
        "COMP_WORDS": line,
        "COMP_CWORD": str(line.count(" ")),
        "_WINCHCASCADE_COMPLETE": "complete_bash",
    }
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | asked,
    )
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("winchcascade effects ", list(EFFECTS)),
        ("winchcascade effects ke", ["ke_rolloff", "ke_shift"]),
        ("winchcascade diagnose --suspect gas", ["gas_polytropic", "gas_volume", "gas_loss"]),
        (
            "winchcascade diagnose . --suspect ke_shift --suspect pre",
            ["precharge", "pressure_gain"],
        ),
        ("winchcascade rig ", list(RIGS)),
        ("winchcascade reduce log.csv --rig k", ["kitepower"]),
        ("winchcascade batch . --reports ", ["none", "html", "all"]),
        ("winchcascade reduce log.csv --window ", ["auto", "payout"]),
        ("winchcascade simulate log.csv --with ke_shift", ["ke_shift.k_e_change="]),
        ("winchcascade check . --against ", list(TABLES)),
        ("winchcascade audit hsu", list(TABLES)),
    ],
)
def test_a_value_is_completed_with_what_the_tool_knows(line: str, words: list[str]) -> None:
    assert offered(line) == words


@pytest.mark.parametrize(
    "line", ["winchcascade reduce log.csv --rig ./r", "winchcascade audit tables/t"]
)
def test_what_the_tool_does_not_know_is_left_to_the_shell_which_completes_files(line: str) -> None:
    assert offered(line) == []
