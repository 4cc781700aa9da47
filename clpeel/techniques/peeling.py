"""Peeling: for techniques that go over the geometry until nothing is left to peel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from clpeel.errors import InputError
from clpeel.options import count, option
from clpeel.techniques.precision import Bounded

CoincidentName = Literal["keep", "paper"]

MAX_PASSES = 1 << 20


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Peeling(Bounded):
    """The options of all techniques that peel.

    coincident: "keep" keeps all fragments of equal depth, in the order of submission. "paper" keeps only the first, as
    the papers do.
    """

    passes: int | None = option(None, count(MAX_PASSES), help="peel so many times and stop, where the technique peels")
    occlusion_query: bool = option(True, help="stop the passes where one finds nothing")
    coincident: CoincidentName = option("keep", help="of equal depths keep all fragments, or the first alone")

    def check_together(self) -> None:
        """Raises InputError if nothing would end the passes."""
        if self.passes is None and not self.occlusion_query:
            raise InputError(
                "passes: expected a number with occlusion_query=False, as nothing else ends the passes; got none"
            )
