"""Check antennas, metal density and wire resistance of a layout (runs in the layout environment).

``python electrical.py FILE.gds TOP`` writes electrical.json. It imports nothing of the project. All numbers of the
technology are from ``sky130_fd_sc_hd.tlef`` and ``setRC.tcl`` of the platform ``sky130hd`` of OpenROAD-flow-scripts.
"""

# mypy: ignore-errors

import json
import re
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from klayout import db, pex


class Metal(NamedTuple):
    """A wiring layer, and the cuts below it."""

    name: str
    layer: tuple[int, int]  # GDS layer and data type, of the metal and of its cuts
    cut: tuple[int, int]
    thickness_um: float
    # most area of side walls per area of gate: of a net without and with a diffusion of at least 0.0225 um2
    antenna: float
    antenna_diffusion: float
    sheet_ohm: float
    # of one cut, and its side
    cut_ohm: float
    cut_um: float


METALS = (
    Metal("li", (67, 20), (66, 44), 0.1, 75, 85.125, 12.2, 0, 0.17),
    Metal("m1", (68, 20), (67, 44), 0.35, 400, 2609, 0.125, 9.249, 0.17),
    Metal("m2", (69, 20), (68, 44), 0.35, 400, 2609, 0.125, 4.5, 0.15),
    Metal("m3", (70, 20), (69, 44), 0.8, 400, 2609, 0.047, 3.369, 0.2),
    Metal("m4", (71, 20), (70, 44), 0.8, 400, 2609, 0.047, 0.377, 0.2),
)
POLY, DIFFUSION, CONTACT = (66, 20), (65, 20), (66, 44)

MOST_DENSE, WINDOW_UM, STEP_UM = 0.7, 700.0, 70.0
"""Largest share of a metal above ``li`` in a square window, or in a whole layout that is smaller."""

MOST_OHM = 5000.0
"""Largest resistance from the drains of a net to a gate: about that of the smallest transistor when it conducts."""


class Nets:
    """The nets of a layout, for which metals are added one by one."""

    def __init__(self, layout: db.Layout) -> None:
        self.layout = layout
        self.found = db.LayoutToNetlist(db.RecursiveShapeIterator(layout, layout.top_cell(), []))
        self.poly, diffusion, contact = (self._layer(*of) for of in ((POLY, "p"), (DIFFUSION, "d"), (CONTACT, "c")))
        self.gate, self.drain = self.poly & diffusion, diffusion - self.poly
        self.to_gate, self.to_drain = contact & self.poly, contact & self.drain
        layers = {"g": self.gate, "sd": self.drain, "cg": self.to_gate, "cd": self.to_drain}
        for name, region in layers.items():
            self.found.register(region, name)
        self._connect(self.poly, self.gate)
        self._connect(self.poly, self.to_gate)
        self._connect(self.drain, self.to_drain)
        self.metals: list[db.Region] = []
        self.cuts: list[db.Region] = []

    def _layer(self, number: tuple[int, int], name: str) -> db.Region:
        return self.found.make_polygon_layer(self.layout.layer(*number), name)

    def _connect(self, *regions: db.Region) -> None:
        for region in regions:
            self.found.connect(region)
        self.found.connect(*regions)

    def add(self, metal: Metal) -> None:
        """Add a metal above the others, and extract the nets again."""
        above = self._layer(metal.layer, metal.name)
        if self.metals:
            self.cuts.append(self._layer(metal.cut, f"cut {metal.name}"))
            self._connect(self.metals[-1], self.cuts[-1])
            self._connect(above, self.cuts[-1])
        else:
            self._connect(above, self.to_gate)
            self._connect(above, self.to_drain)
        self.metals.append(above)
        self.found.extract_netlist()


def antennas(nets: Nets) -> tuple[float, list[str], list[str]]:
    """Return the largest antenna as a share of its limit, every antenna above its limit, and inputs with such antennas.

    The antenna of a net is the area of a metal's side walls by the area of its gates, each time a metal is etched. A
    net without a drain is driven from outside: a diode outside protects an input, but the share does not contain it.
    """
    worst, found = [0.0], []
    for metal in METALS:
        nets.add(metal)
        for limit, diodes in ((metal.antenna, [nets.drain]), (metal.antenna_diffusion, [])):
            texts = db.Texts()
            area, side = (1.0, 0.0), (0.0, metal.thickness_um)
            nets.found.antenna_check(nets.gate, *area, nets.metals[-1], *side, 1e-6, diodes, texts)
            for text in texts.each():
                ratio = float(re.search(r"ratio: ([\d.e+-]+)", text.string)[1])
                at = text.trans.disp.to_dtype(nets.layout.dbu)
                found.append((ratio, limit, metal.name, nets.metals[-1], at))
    broken, inputs = [], []
    for ratio, limit, name, region, at in found:
        if ratio > limit and not (net := nets.found.probe_net(region, db.DPoint(at.x, at.y))):
            raise RuntimeError(f"no net at ({at.x}, {at.y}) in {name}")
        if ratio > limit and nets.found.shapes_of_net(net, nets.to_drain, True).is_empty():
            inputs.append(f"{name} antenna of {ratio:.0f} at ({at.x:.2f}, {at.y:.2f})")
        else:
            worst.append(ratio / limit)
            if ratio > limit:
                broken.append(f"{name} antenna of {ratio:.0f}, at most {limit:.0f}, at ({at.x:.2f}, {at.y:.2f})")
    return max(worst), broken, inputs


def densities(nets: Nets) -> tuple[dict[str, float], list[str]]:
    """Return the largest density of every metal above ``li``, and every window with too much metal, as text."""
    dbu, box = nets.layout.dbu, nets.layout.top_cell().bbox()
    window, step = round(WINDOW_UM / dbu), round(STEP_UM / dbu)
    found, broken = {}, []
    for metal, region in list(zip(METALS, nets.metals, strict=True))[1:]:
        flat = region.merged()
        for left in range(box.left, max(box.right - window, box.left) + 1, step):
            for bottom in range(box.bottom, max(box.top - window, box.bottom) + 1, step):
                part = db.Box(left, bottom, left + window, bottom + window) & box
                share = (flat & db.Region(part)).area() / part.area()
                found[metal.name] = max(share, found.get(metal.name, 0.0))
                if share > MOST_DENSE:
                    at = f"({left * dbu:.0f}, {bottom * dbu:.0f})"
                    broken.append(
                        f"{metal.name} density of {100 * share:.0f} %, at most {100 * MOST_DENSE:.0f} %, at {at}"
                    )
    return found, broken


def resistances(nets: Nets, top: str) -> tuple[int, float, list[str]]:
    """Return how many nets have drains and gates, the largest resistance between these, and nets above the limit."""
    tech = pex.RExtractorTech()
    for number, metal in enumerate(METALS):
        conductor = pex.RExtractorTechConductor()
        conductor.layer, conductor.resistance = number, metal.sheet_ohm
        tech.add_conductor(conductor)
        if number:
            via = pex.RExtractorTechVia()
            via.cut_layer, via.bottom_conductor, via.top_conductor = len(METALS) + number, number - 1, number
            via.resistance = metal.cut_ohm * metal.cut_um**2
            tech.add_via(via)
    extractor = pex.RNetExtractor(nets.layout.dbu)
    worst, broken, number = 0.0, [], 0
    for net in nets.found.netlist().circuit_by_name(top).each_net():
        drains, gates = (
            [shape.bbox().center() for shape in nets.found.shapes_of_net(net, cut, True).each_merged()]
            for cut in (nets.to_drain, nets.to_gate)
        )
        if not drains or not gates:
            continue  # a port, or a supply
        wires = [*enumerate(nets.metals), *enumerate(nets.cuts, len(METALS) + 1)]
        shapes = {layer: nets.found.shapes_of_net(net, region, True) for layer, region in wires}
        ohm = largest(extractor.extract(tech, shapes, {0: drains + gates}, {}), len(drains))
        number, worst = number + 1, max(worst, ohm)
        if ohm > MOST_OHM:
            at = gates[0].to_dtype(nets.layout.dbu)
            broken.append(f"wire of {ohm:.0f} ohm, at most {MOST_OHM:.0f}, to ({at.x:.2f}, {at.y:.2f})")
    return number, worst, broken


def largest(network: pex.RNetwork, drains: int) -> float:
    """Return the largest resistance from a port of a network to its first ports, which are one node."""
    nodes, gates = {}, []
    for node in network.each_node():
        port = node.port_index() if node.type() == pex.RNodeType.VertexPort else None
        nodes[node.object_id()] = 0 if port is not None and port < drains else 1 + len(nodes)
        gates += [nodes[node.object_id()]] if port is not None and port >= drains else []
    siemens = np.zeros((len(nodes) + 1,) * 2)
    for element in network.each_element():
        ends = [nodes[end.object_id()] for end in (element.a(), element.b())]
        value = 1 / max(element.resistance(), 1e-3)
        siemens[ends, ends] += value
        siemens[ends, ends[::-1]] -= value
    used = [at for at in range(1, len(siemens)) if siemens[at, at]]
    ohm = dict(zip(used, np.diag(np.linalg.inv(siemens[np.ix_(used, used)])), strict=True))
    return max(float(ohm.get(at, np.inf)) for at in gates)


def main() -> None:
    """Run all checks."""
    layout = db.Layout()
    layout.read(sys.argv[1])
    nets = Nets(layout)
    antenna, broken, inputs = antennas(nets)
    density, dense = densities(nets)
    number, ohm, resistive = resistances(nets, sys.argv[2])
    said = {
        "antenna_share": round(antenna, 3),
        "inputs": inputs,
        "density": {name: round(share, 3) for name, share in density.items()},
        "nets": number,
        "largest_ohm": round(ohm, 1),
        "violations": broken + dense + resistive,
    }
    Path("electrical.json").write_text(json.dumps(said))


if __name__ == "__main__":
    main()
