"""[object.frame]: motion of an object over time."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import model_validator

from palpate.arrays import Array
from palpate.scenario.fields import Section
from palpate.scenario.signal import Row, table_of

LengthTable = Annotated[tuple[Row, ...], *table_of("m", "lengths", "mm")]
AngleTable = Annotated[tuple[Row, ...], *table_of("rad", "angles", "deg")]


class FrameMotion(Section):
    """[object.frame]: motion of an object; its frame has its origin at [object] position.

    Between rows the motion is linear, before the first and after the last it rests.

    Attributes:
        displacement: rows (time s, x, y, z m), device frame.
        rotation: rows (time s, angles about x, then y, then z of the device, rad), about the origin of the frame.
    """

    displacement: LengthTable | None = None
    rotation: AngleTable | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.displacement is None and self.rotation is None:
            raise ValueError(
                "displacement is missing; write for example "
                'displacement = [["0 s", "0 mm", "0 mm", "0 mm"], ["1 s", "0 mm", "0 mm", "5 mm"]]'
            )
        return self

    def rows(self) -> Array:
        """Return the motion as rows (n, 7): time, s; displacement, m; angles, rad."""
        tables = [
            np.zeros((1, 4)) if table is None else np.array(table) for table in (self.displacement, self.rotation)
        ]
        time = np.unique(np.concatenate([table[:, 0] for table in tables if len(table) > 1]))
        columns = [np.interp(time, table[:, 0], table[:, axis]) for table in tables for axis in (1, 2, 3)]
        return np.column_stack([time, *columns])
