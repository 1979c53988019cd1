"""Outputs of the groups that draw reports and try the diagnosis: apart from the others, for a worker of their own."""

import pytest
from groups import SLOW
from test_reference import APART, require_stored


@pytest.mark.slow
@pytest.mark.parametrize("group", APART)
def test_every_output_is_the_stored_one(group: str) -> None:
    assert group in SLOW
    require_stored(group)
