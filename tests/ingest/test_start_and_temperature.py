"""When a run began and how warm the machine was: by the stamps and the columns of the log, and
by its campaign.
"""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pandas as pd
import pytest
from campaign_log import HEAD, NOON, ROWS, T, kinds, read, stamps, text, with_time, write

from winchcascade import read_run
from winchcascade.batch.campaign_diagnosis import read_logs
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import CampaignError
from winchcascade.core.rig_toml import built_in, parse_rig
from winchcascade.report.figures.histories import channels_drawn

BEGAN = NOON.replace(tzinfo=dt.UTC).timestamp()
WINDING = '\n[channels.winding]\nunit = "degC"\n'


def heated(header: str, *, slope: float = 0.0) -> str:
    """The log with one more column, a temperature that rises from 80."""
    rows = [[*row, f"{80.0 + slope * t:.4f}"] for t, row in zip(T, ROWS, strict=True)]
    return text(rows, [*HEAD, header])


@pytest.mark.parametrize(
    ("form", "began"),
    [
        ("%Y-%m-%dT%H:%M:%S.~+02:00", BEGAN - 7200.0), ("%d.%m.%Y %H:%M:%S.~", BEGAN), ("%Y%m%d%H%M%S.~", BEGAN),
        ("%m/%d/%Y %H:%M:%S.~", BEGAN), ("%H:%M:%S.~", None), ("%H%M%S.~", None),
    ],
)  # fmt: skip
def test_a_run_begins_at_the_date_of_its_first_stamp(
    form: str, began: float | None, tmp_path: Path
) -> None:
    assert read(tmp_path, text(*with_time(stamps(form)))).started == began


def test_dates_of_a_frame_a_parquet_file_and_a_workbook_are_a_start(tmp_path: Path) -> None:
    frame = pd.DataFrame(
        [[float(cell) for cell in row[1:]] for row in ROWS[:2000]], columns=HEAD[1:]
    )
    frame.insert(0, "Time", [NOON + dt.timedelta(seconds=t) for t in T[:2000]])
    frame.to_parquet(tmp_path / "log.parquet")
    frame.to_excel(tmp_path / "log.xlsx", index=False)
    for log in (frame, tmp_path / "log.parquet", tmp_path / "log.xlsx"):
        assert read_run(log).started == pytest.approx(BEGAN, abs=1e-3)


def test_a_date_that_may_be_read_in_two_ways_and_seconds_of_the_log_are_no_start(
    tmp_path: Path,
) -> None:
    fourth = dt.datetime(2026, 5, 4, 10)
    assert read(tmp_path, text(*with_time(stamps("%m/%d/%Y %H:%M:%S.~", fourth)))).started is None
    assert (
        read(tmp_path, text(*with_time(stamps("%d.%m.%Y %H:%M:%S.~", fourth)))).started is not None
    )
    assert (
        read(tmp_path, text(*with_time([f"{BEGAN + t:.3f}" for t in T], "Time (s)"))).started
        == BEGAN
    )
    assert read(tmp_path, text()).started is None


@pytest.mark.parametrize(
    ("header", "kelvin"),
    [
        ("Winding temperature (degC)", 353.15), ("T_motor [°C]", 353.15), ("Ambient temperature "
                                                                           "(degC)", None),
        ("Winding temperature", None),
    ],
)  # fmt: skip
def test_a_column_named_for_the_machine_gives_the_temperature(
    header: str, kelvin: float | None, tmp_path: Path
) -> None:
    run = read(tmp_path, heated(header))
    assert run.temperature == (None if kelvin is None else pytest.approx(kelvin))
    assert kinds(run) == (set() if kelvin else {"unknown_column"})


@pytest.mark.parametrize(
    ("header", "kelvin"), [("winding", 353.15), ("winding (K)", 80.0), ("winding (°F)", 299.817)]
)
def test_a_declared_channel_of_temperature_is_in_kelvin(
    header: str, kelvin: float, tmp_path: Path
) -> None:
    sensor = '[sensors.winding]\nunit = "degC"\nlow = -20\nhigh = 60\naccuracy = 2.0\n'
    rig = parse_rig('based_on = "hsu2026"\n' + WINDING + sensor, "rig.toml")
    assert (rig.sensors["winding"].low, rig.sensors["winding"].high) == pytest.approx(
        (253.15, 333.15)
    )
    run = read(tmp_path, heated(header), rig=rig)
    assert run.channels["winding"] == pytest.approx(kelvin, abs=0.01)
    assert run.temperature == pytest.approx(kelvin, abs=0.01)
    assert kinds(run) == {"thresholds_assumed"} | (
        set() if 253.15 < kelvin < 333.15 else {"out_of_range"}
    )
    assert channels_drawn(run, rig)[-1] == ("winding", "winding", "K", 1.0)


def campaign(folder: Path, *entries: str) -> Path:
    path = folder / "campaign.toml"
    path.write_text(
        "".join(f'[[run]]\nfile = "log.csv"\nload_ohm = 36\n{entry}\n' for entry in entries)
    )
    return path


@pytest.mark.parametrize(
    ("stated", "began"),
    [
        ("2026-05-14T09:30:00", 9.5),
        ('"2026-05-14T09:30:00"', 9.5),
        ("2026-05-14 09:30:00+02:00", 7.5),
    ],
)
def test_a_campaign_overrides_the_time_and_the_temperature_of_a_log(
    stated: str, began: float, tmp_path: Path
) -> None:
    write(tmp_path, heated("Winding temperature (degC)"))
    listed = load_campaign(
        campaign(tmp_path, f"started = {stated}\ntemperature_c = 31.0", "cycles = [1, 1]")
    )
    first, second = read_logs(listed, built_in(), lambda _: None, loads=True)
    assert first.started == dt.datetime(2026, 5, 14, tzinfo=dt.UTC).timestamp() + 3600.0 * began
    assert second.started is None
    assert [first.temperature, second.temperature] == pytest.approx([304.15, 353.15])


@pytest.mark.parametrize(
    ("entries", "place"),
    [
        (["started = 2026-05-14"], "run 1: started"), (['started = "yesterday"'], "run 1: started"),
        (["temperature_c = 5000"], "run 1: temperature_c"), (["temperature_c = nan"], "run 1: temperature_c"),
        (["started = 2026-05-14T09:30:00", "started = 2026-05-14T11:30:00Z"], "run 2"),
    ],
)  # fmt: skip
def test_a_wrong_time_or_temperature_is_rejected_with_its_place(
    entries: list[str], place: str, tmp_path: Path
) -> None:
    with pytest.raises(CampaignError, match=place):
        load_campaign(campaign(tmp_path, *entries))
