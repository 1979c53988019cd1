"""Formulas of rig files and tables: their terms, and texts that are none."""

import pytest
from loops import rejections

from winchcascade.core.errors import RigError
from winchcascade.core.formula import Product, read_formula

KNOWN = ("a", "b", "p_in", "p_out")


@pytest.mark.parametrize(
    ("text", "terms"),
    [
        ("p_in - p_out", (Product(1.0, ("p_in",)), Product(-1.0, ("p_out",)))),
        ("60 V * a", (Product(60.0, ("a",), scaled=True),)),
        ("-a*b/p_in + 2 kW", (Product(-1.0, ("a", "b"), ("p_in",)), Product(2000.0, scaled=True))),
        ("1 - a / b / 4", (Product(1.0, scaled=True), Product(-0.25, ("a",), ("b",), scaled=True))),
        ("a / (0.5 b p_in^3)", (Product(2.0, ("a",), ("b", "p_in", "p_in", "p_in"), scaled=True),)),
        (
            "(a - b) (p_in + 2)",
            (
                Product(1.0, ("a", "p_in")),
                Product(2.0, ("a",), scaled=True),
                Product(-1.0, ("b", "p_in")),
                Product(-2.0, ("b",), scaled=True),
            ),
        ),
        ("2 m/s * a**-2 / 4", (Product(0.5, (), ("a", "a"), scaled=True),)),
        ("60 V/a", (Product(60.0, (), ("a",), scaled=True),)),
    ],
)
def test_a_formula_is_a_sum_of_products_and_quotients(
    text: str, terms: tuple[Product, ...]
) -> None:
    assert read_formula(text, KNOWN, "here", RigError).terms == terms


WRONG = """
* a @ a
a ^ 0.5 @ 0.5 term
a ^ b @ b term
a ^ 10 @ 10 term
a / (a + b) @ a b term
(a @ term
a) @ term
a * c @ c a
60 furlongs * a @ furlongs unit
a + @ term
a / 0 @ above
1e999 * a @ above
"""


def test_another_text_is_rejected_with_its_place() -> None:
    assert (
        rejections(
            lambda text, where: read_formula(text, KNOWN, f"{where}: is", RigError), RigError, WRONG
        )
        == []
    )
