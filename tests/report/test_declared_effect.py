"""An effect that changes one number needs its declaration only: commands, diagnosis and reports
take all from there.
"""

import re

import pytest
from diagnosed import SUSPECTS, made_logs
from rigs import calibrated_rig

from winchcascade.diagnosis.diagnose import diagnose
from winchcascade.report.content import Measured
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.diagnosis_parts import causes_table
from winchcascade.report.results.effects import effects_report
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.effects.effect import Display, Effect, Parameter

PRESSURE_ZERO = Effect(
    name="pressure_zero",
    label="Pressure sensor zero",
    stage="sensor",
    summary="Zero error of the pressure sensor.",
    shows_as="pressure alone, by the same amount in every phase.",
    taken_for="another precharge (precharge), which force shows too.",
    source="Plausible range.",
    fields=(
        Parameter(
            "offset", "Pa", -1e5, 1e5, (-1e7, 1e7), "plausible range", "sensors.zero.pressure"
        ),
    ),
    display=Display("zero of the pressure sensor", 1e-3, "kPa"),
)


@pytest.mark.slow
def test_an_effect_that_is_only_declared_is_described_diagnosed_and_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(EFFECTS, "pressure_zero", PRESSURE_ZERO)
    assert re.search(
        r"(?m)^pressure_zero +offset +Zero error of the pressure sensor.$",
        terminal_text(effects_report()),
    )
    assert terminal_text(effects_report("pressure_zero")).startswith(
        "pressure_zero (sensor): Zero error"
    )
    runs = [one.run for one in made_logs({"pressure_zero": {"offset": 40e3}})]
    found = diagnose(
        runs, calibrated_rig(), {name: EFFECTS[name] for name in (*SUSPECTS, "pressure_zero")}
    )
    (cause,) = found.causes
    assert cause.effect == "pressure_zero"
    assert cause.parameters["offset"].low < 40e3 < cause.parameters["offset"].high
    table = causes_table(found)
    assert table is not None
    row = dict(zip((column.name for column in table.columns), table.cells[0], strict=True))
    assert (row["effect"], row["what changes"], row["unit"]) == (
        "Pressure sensor zero (pressure_zero)",
        "zero of the pressure sensor",
        "kPa",
    )
    assert isinstance(row["found"], Measured)
    assert row["found"].value == pytest.approx(1e-3 * cause.parameters["offset"].value)
