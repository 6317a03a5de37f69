"""Round weights to few bits, for training and for the integer network."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

_CANDIDATES = 2.0 ** -np.arange(0, 4, 0.125)
"""Candidate steps, relative to the smallest step without clipping, down to 1/16."""


class Grid(NamedTuple):
    """Quantisation grid of a matrix: integer multiples of a step up to a largest value."""

    step: float
    """Value of an integer weight of 1."""
    largest: int
    """The largest multiple, positive or negative."""

    def whole(self, values: NDArray[np.floating]) -> NDArray[np.int64]:
        """Return values as multiples of the step, rounded half to even and clipped."""
        return np.clip(np.rint(values / self.step), -self.largest, self.largest).astype(np.int64)

    def error(self, values: NDArray[np.floating]) -> float:
        """Return the rms rounding error relative to the rms of the values."""
        size = math.sqrt(float(np.square(values).mean()))
        return math.sqrt(float(np.square(self.whole(values) * self.step - values).mean())) / size if size else 0.0

    def rounded(self, weights: Tensor) -> Tensor:
        """Return rounded weights with straight-through gradients."""
        near = (weights.detach() / self.step).round().clamp(-self.largest, self.largest) * self.step
        return weights + (near - weights.detach())


def grid_of(values: NDArray[np.floating], bits: int) -> Grid:
    """Return the grid of a bit width with the smallest mean square error."""
    largest = (1 << bits - 1) - 1
    return min((Grid(step, largest) for step in _steps(values, largest)), key=lambda grid: grid.error(values))


def related_grids(matrices: Sequence[NDArray[np.floating]], bits: Sequence[int]) -> list[Grid]:
    """Return a grid for each matrix; the steps differ by powers of two, so that shifts replace products.

    The sum of the squares of the relative errors is the smallest, over all steps of the first and the two nearest
    powers of two of each other one.
    """
    first, *others = matrices
    largest = [(1 << b - 1) - 1 for b in bits]
    free = [grid_of(matrix, b) for matrix, b in zip(matrices, bits, strict=True)]
    found = []
    for step in _steps(first, largest[0]):
        grids = [Grid(step, largest[0])]
        for matrix, most, own in zip(others, largest[1:], free[1:], strict=True):
            power = math.floor(math.log2(own.step / step))
            near = [Grid(step * 2.0**exponent, most) for exponent in (power, power + 1)]
            grids.append(min(near, key=lambda grid: grid.error(matrix)))
        found.append((sum(g.error(m) ** 2 for g, m in zip(grids, matrices, strict=True)), grids))
    return min(found, key=lambda pair: pair[0])[1]


def rounded_weights(matrices: Sequence[Tensor], bits: int) -> list[Tensor]:
    """Return input, recurrent and output matrices rounded for training."""
    arrays = [matrix.detach().cpu().double().numpy() for matrix in matrices]
    grids = [*related_grids(arrays[:2], (bits, bits)), grid_of(arrays[2], bits)]
    return [grid.rounded(matrix) for grid, matrix in zip(grids, matrices, strict=True)]


def _steps(values: NDArray[np.floating], largest: int) -> list[float]:
    top = float(np.abs(values).max()) or 1.0
    return [top / largest * float(part) for part in _CANDIDATES]
