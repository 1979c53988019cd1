"""What the page on adding an effect shows of its trials."""

import re

from pages import DOCS, read, shown

PAGE = DOCS / "adding_an_effect.md"


def test_the_trial_says_what_the_text_says() -> None:
    diagnoses = re.split(r"^(?=\w)", shown(PAGE)["python try_it.py"], flags=re.MULTILINE)[1:]
    causes = [re.findall(r"^  (\w+)\.\w+ (\S+) \((\S+) to (\S+)\)", part, re.MULTILINE) for part in diagnoses]
    assert [[cause[0] for cause in found] for found in causes] == [
        ["torque_zero"], [], ["rotor_friction"], ["clutch_drag"],
    ]  # fmt: skip
    ((_, _, low, high),) = causes[0]
    assert float(low) <= 5.0 <= float(high)
    assert ["unexplained" in part for part in diagnoses] == [False, True, False, False]


def test_the_signature_is_that_of_the_declaration() -> None:
    lines = [line.split() for line in shown(PAGE)["python signature.py"].splitlines()]
    assert {name for name, change, _ in lines if float(change) > 0.0} == {"torque"}


def test_a_law_is_written_in_three_places_and_is_then_simulated_booked_compared_diagnosed_and_exported() -> None:
    law = read(PAGE).split("## 6.")[1]
    assert len(re.findall(r"Put into `winchcascade/rig/", law)) == len(re.findall("Put into", law)) == 3
    printed = shown(PAGE)["python try_law.py"]
    booked, missing = re.findall(r"booked: (\d+) J .*; missing (\S+) of", printed)[0]
    assert int(booked) > 100
    assert float(missing) < 1e-3
    given, corrected = (float(error) for error in re.findall(r"model as \w+: (\S+) N m", printed))
    assert abs(given) > 5.0 > 0.5 > abs(corrected)
    assert "diagnosed: rotor_fan\nexported: N.m.s3/rad3\n" in printed
