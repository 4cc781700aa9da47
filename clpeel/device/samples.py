"""Samples: where they lie in a pixel of the picture. Each has a cell to itself, as kernels draw cell by cell."""

from __future__ import annotations

from dataclasses import dataclass

from clpeel.device.layout import REGULAR, SUBPIXELS


@dataclass(frozen=True)
class Pattern:
    """Where the samples of a pixel lie: `columns` x `rows` cells, with one sample in each.

    down: None for samples in the middle of their cells, as on a regular grid. Otherwise the pattern is rotated: among
    n samples each has a column and a row of its own, of n columns and n rows. So an edge that is nearly upright or
    nearly level passes them one by one, and its pixels have n steps from nothing to all. In a cell of row j the sample
    is in the j-th of `rows` columns. In a cell of column i it is in the down[i]-th of `columns` rows.
    """

    columns: int
    rows: int
    down: tuple[int, ...] | None = None

    @property
    def places(self) -> tuple[tuple[float, float], ...]:
        """Each sample's place, right and down from the pixel's upper left corner, in pixels: row by row of cells."""
        n, down = self.columns * self.rows, self.down
        cells = [(i, j) for j in range(self.rows) for i in range(self.columns)]
        if down is None:
            return tuple(((i + 0.5) / self.columns, (j + 0.5) / self.rows) for i, j in cells)
        return tuple(((self.rows * i + j + 0.5) / n, (self.columns * j + down[i] + 0.5) / n) for i, j in cells)

    @property
    def across(self) -> float:
        """How many samples a pixel has in its width for each in its height."""
        return self.columns / self.rows

    @property
    def word(self) -> int:
        """The pattern as kernels have it (kernels/base/common.h, PATTERN). A block of cells shows it several times."""
        if self.down is None:
            return REGULAR
        right = sum((j % self.rows) * (4 // self.rows) << 2 * j for j in range(4))
        down = sum(self.down[i % self.columns] * (4 // self.columns) << 2 * i for i in range(4))
        return right | down << 8 | SUBPIXELS // 2 // self.rows << 16 | SUBPIXELS // 2 // self.columns << 24

    @property
    def side_bits(self) -> int:
        """The base 2 logarithms of `columns`, and of `rows` in the bits from the 8th on."""
        return self.columns.bit_length() - 1 | self.rows.bit_length() - 1 << 8


PATTERNS = {
    1: Pattern(1, 1),
    4: Pattern(2, 2, (1, 0)),
    8: Pattern(4, 2, (1, 3, 0, 2)),
    16: Pattern(4, 4, (3, 2, 1, 0)),
    64: Pattern(8, 8),
    256: Pattern(16, 16),
}
"""The pattern of each number of samples. Columns and rows divide a tile's side, so a pixel's samples share a tile."""
