"""Calibrated numbers in the text of a rig file: they are in, and everything else stays."""

import re
from functools import cache
from pathlib import Path

import msgspec
import pytest
from openlog import estimated_rig, made_log

from winchcascade import __version__, calibrate, load_rig
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.quantity import Calibrated, Quantity
from winchcascade.core.rig_file import EffectNumber, StatedEffect
from winchcascade.core.rig_toml import built_in, built_in_text, parse_rig
from winchcascade.diagnosis.calibrate import Calibration
from winchcascade.diagnosis.nuisances import before_calibration, calibrated_numbers, quantity_of, with_quantity
from winchcascade.diagnosis.rig_text import CORRECTED, MARK, calibrated_text, corrected_text

NAMES = {"k_e": "generator", "mu_screw": "restoring", "b_rotor": "drivetrain"}


@cache
def calibration() -> Calibration:
    run = made_log(seed=1)
    run = msgspec.structs.replace(run, name="open circuit.csv", sha256="0123456789abcdef" * 4)
    return msgspec.structs.replace(calibrate(run, estimated_rig()), rig=built_in())


def of_file(text: str, folder: Path) -> Calibration:
    """The calibration of a rig that was read from a file of one's own."""
    path = folder / "rig.toml"
    path.write_bytes(text.encode())
    return msgspec.structs.replace(calibration(), rig=load_rig(path))


def assert_calibrated(text: str, found: Calibration) -> None:
    rig = parse_rig(text, "again")
    for n in found.numbers:
        quantity = getattr(getattr(rig, n.section), n.name)
        if n.new:
            assert quantity.value == pytest.approx(n.value, abs=0.01 * n.u)
            assert quantity.u == pytest.approx(n.u, rel=0.01)
            assert quantity.source.startswith("calibrated from open circuit.csv (sha256 0123456789ab, 2800 samples): ")
            assert (quantity.calibrated.log, quantity.calibrated.sha256) == ("open circuit.csv", "0123456789abcdef" * 4)
            assert_same(quantity.prior, getattr(getattr(found.rig, n.section), n.name).prior)
        else:
            assert quantity == getattr(getattr(found.rig, n.section), n.name)


def assert_same(number: Quantity, other: Quantity) -> None:
    """Equal but for the last digits, which a file does not hold."""
    assert number.value == pytest.approx(other.value, rel=1e-11)
    assert number.u == (None if other.u is None else pytest.approx(other.u, rel=1e-11))
    assert (number.unit, number.source, number.calibrated) == (other.unit, other.source, other.calibrated)


def test_only_the_lines_of_calibrated_numbers_change() -> None:
    before, after = built_in_text("hsu2026").splitlines(), calibrated_text(calibration()).splitlines()
    assert (
        after[0]
        == f"{MARK}{__version__} from open circuit.csv (sha256 0123456789ab, 2800 samples): k_e, mu_screw, b_rotor."
    )
    assert len(after) == len(before) + 1
    changed = [old for old, new in zip(before, after[1:], strict=True) if old != new]
    assert [line.split(" = ")[0] for line in changed] == ["mu_screw", "b_rotor", "k_e"]


def test_an_entry_says_how_it_was_found_and_what_it_was() -> None:
    text = calibrated_text(calibration())
    assert_calibrated(text, calibration())
    assert re.search(r'k_e = .*: regression of Vdc above 1000 rpm, R2 = 0.99\d+; was 0.062", ', text)
    assert re.search(r'b_rotor = .*: line tension, torque and pressure; was 0.00075", ', text)


def test_a_number_keeps_digits_down_to_a_hundredth_of_its_uncertainty() -> None:
    (value,) = re.findall(r"mu_screw = \{ value = ([0-9.]+),", calibrated_text(calibration()))
    assert 5 <= len(value.partition(".")[2]) <= 7


def test_comments_beside_an_entry_and_the_ends_of_lines_stay(tmp_path: Path) -> None:
    own = built_in_text("hsu2026").replace("pole_pairs =", "# of the maker\npole_pairs =")
    own = re.sub(r"(k_e = \{.*\})", r"\1  # ours { since } spring", own).replace("\n", "\r\n")
    text = calibrated_text(of_file(own, tmp_path))
    assert text.count("\r\n") == text.count("\n")
    assert "  # ours { since } spring\r\n" in text
    assert "# of the maker\r\n" in text
    assert_calibrated(text, calibration())


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("[generator]\n", "[generator] # of the maker\n"),
        ("[generator]\n", '[ "generator" ]\n'),
        ("\nk_e =", '\n  "k_e"   ='),
    ],
)
def test_other_spellings_of_the_same_are_found(tmp_path: Path, old: str, new: str) -> None:
    found = of_file(built_in_text("hsu2026").replace(old, new, 1), tmp_path)
    assert_calibrated(calibrated_text(found), found)


OWN_KEYS = """[generator.k_e]
# line to line
value = 0.0617
u_percent = 0.5
unit = "V/rpm"
"""

DOTTED = 'generator.k_e.value = 0.0617\ngenerator.k_e.unit = "V/rpm" # rms\n'


@pytest.mark.parametrize("entry", [OWN_KEYS, DOTTED], ids=["table", "dotted"])
def test_keys_on_lines_of_their_own_are_replaced(tmp_path: Path, entry: str) -> None:
    head, sections = entry, ""
    if entry is OWN_KEYS:
        head, sections = sections, head
    own = f'based_on = "hsu2026"\nname = "ours"\n{head}\n[winch]\nr_drum = {{ value = 0.15, unit = "m" }}\n\n{sections}'
    found = of_file(own, tmp_path)
    text = calibrated_text(found)
    assert_calibrated(text, found)
    assert "u_percent" not in text
    assert text.count("0.0617") == 1  # as the number before
    assert ("# line to line" in text) == (entry is OWN_KEYS)


def test_a_number_that_a_file_takes_from_another_rig_is_added_to_it(tmp_path: Path) -> None:
    own = 'based_on = "hsu2026"\nname = "ours"\n\n[generator]\nr_s = { value = 0.7, unit = "ohm" }\n\n# the end\n'
    found = of_file(own, tmp_path)
    text = calibrated_text(found)
    assert_calibrated(text, found)
    assert text.index("r_s =") < text.index("k_e =") < text.index("# the end") < text.index("[restoring]")
    assert parse_rig(text, "again").generator.r_s == found.rig.generator.r_s


def test_a_calibration_of_a_calibrated_file_replaces_its_first_line(tmp_path: Path) -> None:
    found = of_file(calibrated_text(calibration()), tmp_path)
    again = calibrated_text(found)
    assert again.count(MARK) == 1
    assert_calibrated(again, found)


def test_a_number_that_is_calibrated_again_keeps_its_first_prior(tmp_path: Path) -> None:
    found = of_file(calibrated_text(calibration()), tmp_path)
    run = msgspec.structs.replace(found.run, name="later.csv", sha256="f" * 64)
    numbers = [msgspec.structs.replace(n, value=1.01 * n.value) for n in found.numbers]
    again = parse_rig(calibrated_text(msgspec.structs.replace(found, run=run, numbers=tuple(numbers))), "again")
    assert set(calibrated_numbers(again)) == {(section, name) for name, section in NAMES.items()}
    for place, number in calibrated_numbers(again).items():
        assert number.calibrated == Calibrated("later.csv", "f" * 64, quantity_of(built_in(), *place))


def test_a_number_that_the_rig_file_lacked_has_no_prior(tmp_path: Path) -> None:
    found = calibration()
    bare = with_quantity(found.rig, "generator", "k_e", None)
    path = tmp_path / "rig.toml"
    path.write_text(re.sub(r"k_e = .*\n", "", built_in_text("hsu2026")), encoding="utf-8")
    again = parse_rig(
        calibrated_text(msgspec.structs.replace(found, rig=msgspec.structs.replace(bare, path=str(path)))), ""
    )
    k_e = again.generator.k_e
    assert k_e is not None
    assert k_e.calibrated == Calibrated("open circuit.csv", "0123456789abcdef" * 4)
    assert before_calibration(again).generator.k_e == msgspec.structs.replace(k_e, calibrated=None)


@pytest.mark.parametrize("own", [False, True], ids=["inline", "keys of their own"])
def test_a_corrected_rig_file_has_the_numbers_before_their_calibration(tmp_path: Path, own: bool) -> None:
    """The effects were found against those numbers; with the calibrated ones they would count twice."""
    text = built_in_text("hsu2026")
    if own:
        text = re.sub(r"b_rotor = \{ value = (\S+), .*\}", r'b_rotor.value = \1\nb_rotor.unit = "N.m.s/rad"', text)
    found = of_file(text, tmp_path)
    before = found.rig
    calibrated = of_file(calibrated_text(found), tmp_path).rig
    number = Quantity(0.0612, "V/rpm", "diagnosis of Day 2", 1e-4)
    again = corrected_text(calibrated, DRAG, {("generator", "k_e"): number}, "Day 2")
    assert MARK not in again
    rig = parse_rig(again, before.path)
    assert calibrated_numbers(rig) == {}
    expected = with_quantity(before, "generator", "k_e", number)
    assert rig == msgspec.structs.replace(expected, effects=DRAG)


def test_a_name_with_quotes_and_control_characters_is_written_as_text(tmp_path: Path) -> None:
    run = msgspec.structs.replace(calibration().run, name='open "A"\\\x1b[31m.csv')
    text = calibrated_text(msgspec.structs.replace(calibration(), run=run))
    source = parse_rig(text, "again").generator.k_e
    assert source is not None
    assert source.source.startswith('calibrated from open "A"\\?[31m.csv (sha256 ')


def test_an_entry_that_cannot_be_replaced_is_rejected(tmp_path: Path) -> None:
    own = 'based_on = "hsu2026"\nname = "ours"\ngenerator = { k_e = { value = 0.0617, unit = "V/rpm" } }\n'
    with pytest.raises(
        RigError, match=r"\[generator\] k_e stands there in a way that cannot be replaced; write it as k_e"
    ):
        calibrated_text(of_file(own, tmp_path))


def test_a_text_that_only_looks_like_an_entry_is_not_taken_for_it(tmp_path: Path) -> None:
    own = built_in_text("hsu2026").replace(
        'title = "Winch-driven power take-off on a crane test stand"',
        "note = '''\n[generator]\nk_e = { value = 1, unit = \"V/rpm\" }\n'''",
    )
    with pytest.raises(RigError, match=r"rig\.toml: .* cannot be re"):
        calibrated_text(of_file(own, tmp_path))


def test_a_file_that_is_gone_is_reported(tmp_path: Path) -> None:
    found = of_file(built_in_text("hsu2026"), tmp_path)
    (tmp_path / "rig.toml").unlink()
    with pytest.raises(RigError, match="the rig file cannot be read again"):
        calibrated_text(found)


def test_a_number_that_no_rig_has_is_not_written() -> None:
    numbers = tuple(
        msgspec.structs.replace(n, value=-0.01) if n.name == "mu_screw" else n for n in calibration().numbers
    )
    with pytest.raises(
        LogError, match=r"mu_screw comes out as -0\.01, which no rig has, so that no rig file is written"
    ):
        calibrated_text(msgspec.structs.replace(calibration(), numbers=numbers))


DRAG = {
    "line_drag": StatedEffect(
        {"b": EffectNumber(0.5, "N.m.s/rad", "diagnosis of a test", 0.4, 0.6)}, ("a.csv", "b.csv")
    )
}
MORE_DRAG = {"line_drag": StatedEffect({"b": EffectNumber(0.7, "N.m.s/rad")}, ("c.csv",))}


def test_effects_are_added_after_all_that_the_rig_file_has() -> None:
    text = corrected_text(built_in(), DRAG, {}, "Day 2\n")
    first, _, rest = text.partition("\n")
    assert first == f"{CORRECTED}{__version__} from Day 2?: line_drag."
    assert rest.startswith(built_in_text("hsu2026").rstrip())
    assert parse_rig(text, "again").effects == DRAG


def test_a_rig_file_of_ones_own_keeps_its_line_ends_and_its_other_effects(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    own = corrected_text(built_in(), DRAG, {}, "Day 2") + "# of the screw\n[effects.screw_friction]\nmu_change = 0.01\n"
    path.write_bytes(own.replace("\n", "\r\n").encode())
    text = corrected_text(load_rig(path), MORE_DRAG, {}, "Day 3")
    assert text.count("\r\n") == text.count("\n")
    assert text.count(CORRECTED) == text.count("[effects.line_drag]") == 1
    assert "# of the screw\r\n[effects.screw_friction]" in text
    assert parse_rig(text, "again").effects == {**load_rig(path).effects, **MORE_DRAG}


def test_an_effect_that_cannot_be_replaced_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text('based_on = "hsu2026"\nname = "own"\n[effects]\nline_drag = { b = 0.1 }\n', encoding="utf-8")
    with pytest.raises(RigError, match=r"write each effect that it states as a table \[effects.NAME\]"):
        corrected_text(load_rig(path), DRAG, {}, "Day 2")


def test_a_corrected_entry_keeps_its_unit_and_states_its_source() -> None:
    number = Quantity(0.0612, "V/rpm", "diagnosis of Day 2: 0.987 times the stated number", 1e-4)
    text = corrected_text(built_in(), {}, {("generator", "k_e"): number}, "Day 2")
    assert text.startswith(f"{CORRECTED}{__version__} from Day 2: k_e.\n")
    again = parse_rig(text, "again")
    assert again.generator.k_e == number
    assert again.effects == {}
