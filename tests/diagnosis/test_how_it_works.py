"""The page on how a diagnosis works names the functions that do it, in the order in which they
are called.
"""

import re
import sys
import threading
from pathlib import Path
from types import FrameType

from planted import campaign
from rigs import calibrated_rig

from winchcascade.diagnosis.diagnose import diagnose
from winchcascade.rig.effects.catalogue import EFFECTS

PAGE = Path(__file__).parents[2] / "docs" / "how_a_diagnosis_works.md"


def named() -> list[str]:
    """Functions in the order of the page, as module and name."""
    text = PAGE.read_text(encoding="utf-8").partition("## What is compared")[0]
    assert re.findall(r"(?m)^(\d+)\. ", text) == [str(number) for number in range(1, 17)]
    return re.findall(r"`(\w+\.\w+)`", text)


def called() -> list[str]:
    """Functions of the diagnosis in the order in which one with a planted cause calls them
    first; a class by its making.
    """
    order: dict[str, None] = {}

    def watch(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event == "call" and "diagnosis" in code.co_filename:
            name = code.co_qualname.removesuffix(".__init__")
            order.setdefault(f"{Path(code.co_filename).stem}.{name}")

    suspects = {name: EFFECTS[name] for name in ("copper_heating", "line_drag", "torque_gain")}
    runs = campaign({"copper_heating": {"r_s_change": 0.35}, "line_drag": {"b": 0.9}})
    threading.setprofile(watch)
    sys.setprofile(watch)
    try:
        found = diagnose(runs, calibrated_rig(), suspects)
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    assert {cause.effect for cause in found.causes} == {"copper_heating", "line_drag"}
    return list(order)


def test_the_page_names_what_is_called_in_its_order() -> None:
    order = called()
    places = {name: order.index(name) if name in order else None for name in named()}
    assert None not in places.values(), places
    assert sorted(places, key=lambda name: places[name] or 0) == list(places), places
