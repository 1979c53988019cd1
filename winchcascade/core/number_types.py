"""Types of the numbers of a rig file, with their possible values."""

from typing import Annotated

from msgspec import Meta

NotNegative = Annotated[float, Meta(ge=0.0, le=1e15)]
Positive = Annotated[float, Meta(gt=0.0, le=1e15)]
ShareOfAll = Annotated[float, Meta(gt=0.0, le=1.0)]
Finite = Annotated[float, Meta(ge=-1e15, le=1e15)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
