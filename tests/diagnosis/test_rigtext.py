"""Calibrated numbers and effects in the text of a rig file: they are in, and everything else
stays.
"""

import re
from functools import cache
from pathlib import Path

import msgspec
import pytest
from openlog import estimated_rig, made_log

from winchcascade import __version__, calibrate, load_rig
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.quantity import Calibrated, Quantity
from winchcascade.core.rig_file import EffectNumber, Rig, StatedEffect
from winchcascade.core.rig_toml import built_in, built_in_text, parse_rig
from winchcascade.diagnosis.fit.nuisances import (
    before_calibration,
    calibrated_numbers,
    quantity_of,
    with_quantity,
)
from winchcascade.diagnosis.handover.calibrate import Calibration
from winchcascade.diagnosis.handover.rig_text import (
    CORRECTED,
    MARK,
    calibrated_text,
    corrected_text,
)

PLACES = {("generator", "k_e"), ("restoring", "mu_screw"), ("drivetrain", "b_rotor")}
HSU = built_in_text("hsu2026")
BASED = 'based_on = "hsu2026"\nname = "ours"\n'


@cache
def calibration() -> Calibration:
    run = made_log(seed=1)
    run = msgspec.structs.replace(run, name="open circuit.csv", sha256="0123456789abcdef" * 4)
    return msgspec.structs.replace(calibrate(run, estimated_rig()), rig=built_in())


def rig_of(text: str, folder: Path) -> Rig:
    """A rig that was read from a file of your own."""
    path = folder / "rig.toml"
    path.write_bytes(text.encode())
    return load_rig(path)


def of_file(text: str, folder: Path) -> Calibration:
    return msgspec.structs.replace(calibration(), rig=rig_of(text, folder))


def without_numbers(rig: Rig) -> Rig:
    """The rig but for the calibrated numbers, its path and which numbers the file itself states."""
    for place in PLACES:
        rig = with_quantity(rig, *place, None)
    return msgspec.structs.replace(rig, path="", inherited=frozenset())


def assert_calibrated(text: str, found: Calibration) -> None:
    rig = parse_rig(text, "again")
    assert without_numbers(rig) == without_numbers(found.rig)
    assert (
        set(calibrated_numbers(rig))
        == {(n.section, n.name) for n in found.numbers if n.new}
        == PLACES
    )
    for n in (number for number in found.numbers if number.new):
        written, before = (quantity_of(one, n.section, n.name) for one in (rig, found.rig))
        assert written is not None
        assert before is not None
        assert written.value == pytest.approx(n.value, abs=0.01 * n.u)
        assert written.u == pytest.approx(n.u, rel=0.01)
        assert written.source.startswith(
            "calibrated from open circuit.csv (sha256 0123456789ab, 2800 samples): "
        )
        assert written.calibrated == Calibrated(
            "open circuit.csv", "0123456789abcdef" * 4, written.prior
        )
        assert written.prior.value == pytest.approx(before.prior.value, rel=1e-11)
        assert (written.prior.u or 0.0) == pytest.approx(before.prior.u or 0.0, rel=1e-11)
        assert (written.prior.unit, written.prior.source) == (
            before.prior.unit,
            before.prior.source,
        )


def test_only_the_lines_of_calibrated_numbers_change() -> None:
    first, _, text = calibrated_text(calibration()).partition("\n")
    log = "open circuit.csv (sha256 0123456789ab, 2800 samples)"
    assert first == f"{MARK}{__version__} from {log}: k_e, mu_screw, b_rotor."
    pairs = zip(HSU.splitlines(), text.splitlines(), strict=True)
    assert [old.split(" = ")[0] for old, new in pairs if old != new] == [
        "mu_screw",
        "b_rotor",
        "k_e",
    ]
    assert_calibrated(text, calibration())
    assert re.search(
        r'k_e = .*: regression of Vdc above [\d.]+ rpm, R2 = 0.99\d+; was 0.062", ', text
    )


OWN_KEYS = '[generator.k_e]\n# of the maker\nvalue = 0.0617\nu_percent = 0.5\nunit = "V/rpm"\n'

SPELLINGS = {
    "comment beside": re.sub(r"(k_e = \{.*\})", r"\1  # of the maker", HSU),
    "line ends": HSU.replace("pole_pairs =", "# of the maker\npole_pairs =").replace("\n", "\r\n"),
    "header": HSU.replace("[generator]\n", '[ "generator" ] # of the maker\n'),
    "quoted": HSU.replace("\nk_e =", '\n# of the maker\n  "k_e"   ='),
    "table": f'{BASED}[winch]\nr_drum = {{ value = 0.15, unit = "m" }}\n\n{OWN_KEYS}',
    "dotted": f"{BASED}# of the maker\ngenerator.k_e.value = 0.0617\ngenerator.k_e.unit = "
    f'"V/rpm"\n',
    "inline": f'{BASED}# of the maker\ngenerator = {{ k_e = {{ value = 0.0617, unit = "V/rpm" }} '
    f"}}\n",
    "looks like an entry": HSU.replace(
        "title =", "note = '''\n[generator]\nk_e = # of the maker\n'''\ntitle =", 1
    ),
    "of another rig": f'{BASED}[generator]\nr_s = {{ value = 0.7, unit = "ohm" }}\n\n# of the '
    f"maker\n",
}


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_every_spelling_of_an_entry_is_found_and_comments_and_line_ends_stay(
    tmp_path: Path, spelling: str
) -> None:
    found = of_file(SPELLINGS[spelling], tmp_path)
    text = calibrated_text(found)
    assert_calibrated(text, found)
    assert "# of the maker" in text
    assert text.count("\r\n") == ("\r\n" in SPELLINGS[spelling]) * text.count("\n")


def test_a_number_that_is_calibrated_again_keeps_its_first_prior(tmp_path: Path) -> None:
    found = of_file(calibrated_text(calibration()), tmp_path)
    run = msgspec.structs.replace(found.run, name="later.csv", sha256="f" * 64)
    numbers = tuple(msgspec.structs.replace(n, value=1.01 * n.value) for n in found.numbers)
    text = calibrated_text(msgspec.structs.replace(found, run=run, numbers=numbers))
    assert text.count(MARK) == 1
    for place, number in calibrated_numbers(parse_rig(text, "again")).items():
        assert number.calibrated == Calibrated(
            "later.csv", "f" * 64, quantity_of(built_in(), *place)
        )


def test_a_number_that_the_rig_file_lacked_has_no_prior(tmp_path: Path) -> None:
    text = calibrated_text(of_file(re.sub(r"k_e = .*\n", "", HSU), tmp_path))
    k_e = parse_rig(text, "again").generator.k_e
    assert k_e is not None
    assert k_e.calibrated == Calibrated("open circuit.csv", "0123456789abcdef" * 4)
    assert before_calibration(parse_rig(text, "")).generator.k_e == msgspec.structs.replace(
        k_e, calibrated=None
    )


def test_a_name_with_quotes_and_control_characters_is_written_as_text() -> None:
    run = msgspec.structs.replace(calibration().run, name='open "A"\\\x1b[31m.csv')
    source = parse_rig(
        calibrated_text(msgspec.structs.replace(calibration(), run=run)), "again"
    ).generator.k_e
    assert source is not None
    assert source.source.startswith('calibrated from open "A"\\?[31m.csv (sha256 ')


def test_a_file_that_is_gone_and_a_number_that_no_rig_has_are_rejected(tmp_path: Path) -> None:
    found = of_file(HSU, tmp_path)
    (tmp_path / "rig.toml").unlink()
    with pytest.raises(RigError, match="the rig file cannot be read again"):
        calibrated_text(found)
    numbers = tuple(msgspec.structs.replace(n, value=-0.01) for n in calibration().numbers)
    with pytest.raises(LogError, match=r"k_e comes out as -0\.01, which no rig has"):
        calibrated_text(msgspec.structs.replace(calibration(), numbers=numbers))


# ------------------------------------------------------------------------- effects of a diagnosis
def drag(b: float) -> dict[str, StatedEffect]:
    number = EffectNumber(b, "N.m.s/rad", "diagnosis of a test", 0.9 * b, 1.1 * b)
    return {"line_drag": StatedEffect({"b": number}, ("a.csv", "b.csv"))}


K_E = {
    ("generator", "k_e"): Quantity(
        0.0612, "V/rpm", "diagnosis of Day 2: 0.987 times the stated number", 1e-4
    )
}


def test_effects_are_added_after_all_that_the_rig_file_has_and_entries_corrected() -> None:
    first, _, rest = corrected_text(built_in(), drag(0.5), {}, "Day 2\n").partition("\n")
    assert first == f"{CORRECTED}{__version__} from Day 2?: line_drag."
    assert rest.startswith(HSU.rstrip())
    assert parse_rig(rest, "again").effects == drag(0.5)
    assert (
        parse_rig(corrected_text(built_in(), {}, K_E, "Day 2"), "again").generator.k_e
        == K_E["generator", "k_e"]
    )


@pytest.mark.parametrize(
    "own", ["[effects]\nline_drag = { b = 0.1 }\n", "[effects.line_drag]\nb = 0.1\n"]
)
def test_an_effect_takes_the_place_of_the_one_of_its_name(tmp_path: Path, own: str) -> None:
    rig = rig_of(
        f"{HSU}\n{own}# of the screw\n[effects.screw_friction]\nmu_change = 0.01\n".replace(
            "\n", "\r\n"
        ),
        tmp_path,
    )
    text = corrected_text(rig, drag(0.7), {}, "Day 3")
    assert text.count("\r\n") == text.count("\n")
    assert "# of the screw\r\n" in text
    assert parse_rig(text, "again").effects == {**rig.effects, **drag(0.7)}


@pytest.mark.parametrize("spelling", ["line ends", "dotted"])
def test_a_corrected_rig_file_has_the_numbers_before_their_calibration(
    tmp_path: Path, spelling: str
) -> None:
    """The effects were found against those numbers; with the calibrated ones they would count
    twice.
    """
    found = of_file(SPELLINGS[spelling], tmp_path)
    before = found.rig
    again = corrected_text(rig_of(calibrated_text(found), tmp_path), drag(0.5), K_E, "Day 2")
    assert MARK not in again
    expected = with_quantity(before, "generator", "k_e", K_E["generator", "k_e"])
    written = parse_rig(again, before.path)
    assert written.states("generator.k_e", "drivetrain.b_rotor", "restoring.mu_screw")
    assert written == msgspec.structs.replace(
        expected, effects=drag(0.5), inherited=written.inherited
    )
