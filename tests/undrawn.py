"""Reports without their drawings, for tests that look at something else: drawing takes most of
the time of a page.
"""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any

import pytest
from matplotlib.figure import Figure


@contextmanager
def undrawn() -> Iterator[None]:
    """Within this context every figure of a report that is made in this process is an empty
    drawing.
    """

    def savefig(_figure: Figure, out: IO[Any], **_options: Any) -> None:
        out.write(EMPTY.encode() if isinstance(out, io.BytesIO) else EMPTY)

    with pytest.MonkeyPatch.context() as changed:
        changed.setattr(Figure, "savefig", savefig)
        yield


EMPTY = '<svg xmlns="http://www.w3.org/2000/svg" width="10pt" height="10pt" viewBox="0 0 10 10"></svg>\n'
