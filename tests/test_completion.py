"""What a shell is offered to complete a value with, asked for as a shell asks."""

import json
import subprocess
import sys

import pytest

from winchcascade.core.rig_toml import BUILT_IN as RIGS
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.tables.table_file import BUILT_IN as TABLES

WORDS: dict[str, list[str]] = {
    "winchcascade effects ": list(EFFECTS),
    "winchcascade effects ke": ["ke_rolloff", "ke_shift"],
    "winchcascade diagnose --suspect gas": ["gas_polytropic", "gas_volume", "gas_loss"],
    "winchcascade diagnose . --suspect ke_shift --suspect pre": ["precharge", "pressure_gain"],
    "winchcascade rig ": list(RIGS),
    "winchcascade reduce log.csv --rig k": ["kitepower"],
    "winchcascade batch . --reports ": ["none", "html", "all"],
    "winchcascade reduce log.csv --window ": ["auto", "payout"],
    "winchcascade simulate log.csv --with ke_shift": ["ke_shift.k_e_change="],
    "winchcascade check . --against ": list(TABLES),
    "winchcascade audit hsu": list(TABLES),
    "winchcascade reduce log.csv --rig ./r": [],
    "winchcascade audit tables/t": [],
}
"""Lines, and the words that bash is offered for the last word of each; none where the tool does not
know any, as the shell then completes files.
"""

CODE = """
import contextlib, io, json, os, sys
from winchcascade.cli.entry import main

sys.argv = ["winchcascade"]
os.environ["_WINCHCASCADE_COMPLETE"] = "complete_bash"
offered = {}
for line in json.load(sys.stdin):
    os.environ |= {"COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.suppress(SystemExit):
        main()
    offered[line] = out.getvalue().split()
print(json.dumps(offered))
"""


@pytest.fixture(scope="module")
def offered() -> dict[str, list[str]]:
    """Words that bash is offered for each line, by one process under the name of the command."""
    done = subprocess.run(
        [sys.executable, "-c", CODE],
        input=json.dumps([*WORDS]),
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    found: dict[str, list[str]] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("line", WORDS)
def test_a_value_is_completed_with_what_the_tool_knows(
    line: str, offered: dict[str, list[str]]
) -> None:
    assert offered[line] == WORDS[line]
