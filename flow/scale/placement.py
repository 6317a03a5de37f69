"""Place cells: taxels on their grid, all other cells for the shortest wires."""

from collections import Counter

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import spsolve

from eskin.flow.scale.array import Array, End

FAR_REACHING = 0.5
"""Share of the taxels beyond which a net does not determine the place of its driver."""


class Placement:
    """Positions in um, x to the right and y down, with the corner of taxel (0, 0) at the origin.

    Ports that belong to a taxel, samples for instance, are at that taxel; the others at the middle of the left edge.
    """

    def __init__(self, array: Array, pitch_um: float) -> None:
        config = array.config
        self.rows, self.columns, self.pitch_um = config.rows, config.columns, pitch_um
        self.array = array
        self.widths = Counter(name for _, name, _, _ in array.ports)
        self.of_ports = [self._port(name, bit) for _, name, bit, _ in array.ports]
        self.of_cells = self._least_squares()

    def of(self, end: End) -> tuple[float, float]:
        """Return the position of an endpoint of a net."""
        if end.what == "taxel":
            return self._taxel(end.number)
        return self.of_ports[end.number] if end.what == "port" else self.of_cells[end.number]

    def _taxel(self, index: int) -> tuple[float, float]:
        row, column = divmod(index, self.columns)
        return (column + 0.5) * self.pitch_um, (row + 0.5) * self.pitch_um

    def _port(self, name: str, bit: int) -> tuple[float, float]:
        width = self.widths[name]
        taxels = self.rows * self.columns
        if width % taxels == 0 and not name.startswith("event_") and width >= taxels > 1:
            return self._taxel(bit // (width // taxels))
        return 0.0, self.rows * self.pitch_um / 2

    def _least_squares(self) -> list[tuple[float, float]]:
        """Return the position of every cell with the least sum of squared wire lengths.

        Quadratic placement, as analytic placers begin with it: G. Sigl, K. Doll and F. M. Johannes, Analytical
        placement: a linear or a quadratic objective function?, DAC 1991. Cells may overlap; what is not in a taxel is
        so small beside the room between them that this moves little.
        """
        array = self.array
        drivers, readers = array.ends()
        trees, cells = array.trees(), len(array.cells)
        pulls: list[tuple[int, int]] = []  # cell, net
        fixed: list[tuple[int, float, float]] = []  # net, place
        nets = 0
        for net, ends in readers.items():
            if net in trees or net not in drivers or len(ends) > max(64, FAR_REACHING * len(array.taxels)):
                continue
            for end in (drivers[net], *ends):
                if end.what == "cell":
                    pulls.append((end.number, nets))
                else:
                    fixed.append((nets, *self.of(end)))
            nets += 1
        pulled, held = np.array(pulls).reshape(-1, 2), np.array(fixed).reshape(-1, 3)
        size = cells + nets
        one, two = pulled[:, 0], cells + pulled[:, 1]
        at = cells + held[:, 0].astype(np.int64)
        links = coo_matrix((-np.ones(len(pulls)), (one, two)), (size, size))
        weak = 1e-6  # weight of a pull to the middle of the left edge, for cells without a path to a taxel
        degree = sum((np.bincount(ends, minlength=size) for ends in (one, two, at)), np.full(size, weak))
        home = (0.0, self.rows * self.pitch_um / 2)
        matrix = csr_matrix(links + links.T + coo_matrix((degree, (range(size), range(size)))))
        found = [
            spsolve(matrix.tocsc(), np.bincount(at, held[:, axis + 1], size) + weak * home[axis]) for axis in (0, 1)
        ]
        return [(float(x), float(y)) for x, y in zip(found[0][:cells], found[1][:cells], strict=True)]
