"""Place and route a netlist with Coriolis (runs in the layout environment).

``python place.py TECHNOLOGY NAME MARGIN [STEPS]`` reads NAME.blif and pins.json, and leaves NAME_cts_r.gds,
NAME_cts_r_export.def, and placed.json with the netlist behind the layout. It imports nothing of the project.
"""

# mypy: ignore-errors

import json
import math
import sys
from pathlib import Path

sys.path.insert(0, sys.argv[1])

from coriolis import CRL, Cfg
from coriolis.helpers import overlay, u
from coriolis.helpers.technology import setEnclosures
from coriolis.Hurricane import Cell, DataBase, DbU, Instance, Transformation, UpdateSession
from techno import StdCellLib, techno

TOP_LAYER = "m4"
PIN_UM = 0.46
"""Width of a pin: one that nothing reads has no wire behind it, and is a legal shape by itself."""

PITCHES_UM = {"m1": 0.46, "m2": 0.51}
"""Tracks on which pins stand: of metal 1 at the west and east sides, of metal 2 at the others."""


DIODES_UM, PROTECTED_UM = 60.0, 5000.0
"""Longer wires get a diode, each for this length: 63 um of m3 are the largest antenna of the smallest gate."""

STEPS = 4000000
"""Steps of the router before it gives up."""

ENCLOSURES_UM = {
    ("m1_via_m2", "m1"): (0.085, 0.085),
    ("m1_via_m2", "m2"): (0.085, 0.085),
    ("m2_via2_m3", "m2"): (0.06, 0.085),
}
"""Of vias by a metal, east and north. The exported ones fill the pitch of the wires, so that a via off its track, where
a pin is, came too close to the next, or the ends of two wires did. In metal 2, vias are as wide as the wires: there is
no notch between two vias of a wire."""

LARGE_ENOUGH = ("m1", "m2")
"""Metals whose wires have the least area with their vias: what the router added to be sure came too close to others."""

FILLERS = ("tie", "tie_w2", "tie_w4")
"""Cells that fill gaps: contacts of the wells without transistors, which the netlist does not contain."""
DIODE, GRID_UM, HEIGHT_UM = "diode_w1", 0.76, 6.08
"""Diode against antennas, which the netlist does not contain either; width of the narrowest filler, and row height."""

SUPPLIES = ("vdd", "vss")

CLOCK, CLOCK_BUFFER, SINKS, SPARE_UM = "clk", "buf_x4", 18, 60.8
"""Clock port, buffer of its tree, pins that a buffer drives (about), and side of the squares with spare buffers."""


def pins(IoPin, names, side_um):
    """Return the pin positions, evenly spread in order around the four sides."""
    each = -(-len(names) // 4)
    found = []
    for number, side in enumerate((IoPin.WEST, IoPin.EAST, IoPin.SOUTH, IoPin.NORTH)):
        pitch = PITCHES_UM["m1" if number < 2 else "m2"]
        part = names[number * each : (number + 1) * each]
        step = 0.9 * side_um / (len(part) + 1)
        found += [(side, name, u(round((i + 1) * step / pitch) * pitch), 0, 1) for i, name in enumerate(part)]
    return found


def um(length):
    """Return a length of the data base in um."""
    return round(DbU.toPhysical(length, DbU.UnitPowerMicro), 3)


def cells(cell):
    """Return kind and wires of every instance but fillers and diodes, by name."""
    found = {}
    for instance in cell.getInstances():
        kind = instance.getMasterCell().getName()
        plugs = [(plug.getMasterNet().getName(), plug.getNet()) for plug in instance.getPlugs()]
        if kind not in (*FILLERS, DIODE):
            found[instance.getName()] = (
                kind,
                {pin: net.getName() for pin, net in plugs if net and pin not in SUPPLIES},
            )
    return found


def fill_gaps(cell):
    """Fill the gaps that the diodes leave in the rows, where the well would be broken."""
    filler = next(i.getMasterCell() for i in cell.getInstances() if i.getMasterCell().getName() == FILLERS[0])
    turned = (Transformation.Orientation.MY, Transformation.Orientation.R2)
    rows = {}
    for instance in cell.getInstances():
        box = instance.getAbutmentBox()
        rows.setdefault(box.getYMin(), []).append((box.getXMin(), box.getXMax(), instance))
    UpdateSession.open()
    for y, row in sorted(rows.items()):
        upside_down = row[0][2].getTransformation().getOrientation() in turned
        way = Transformation.Orientation.MY if upside_down else Transformation.Orientation.ID
        end = cell.getAbutmentBox().getXMax()
        at = cell.getAbutmentBox().getXMin()
        for left, right in [*sorted((left, right) for left, right, _ in row), (end, end)]:
            while at + u(GRID_UM) <= left:
                new = Instance.create(cell, f"gap_{um(at)}_{um(y)}", filler)
                new.setTransformation(Transformation(at, y + (u(HEIGHT_UM) if upside_down else 0), way))
                new.setPlacementStatus(Instance.PlacementStatus.PLACED)
                at += u(GRID_UM)
            at = max(at, right)
    UpdateSession.close()


def main() -> None:
    """Place and route the netlist in the working folder."""
    techno.setup()
    StdCellLib.setup()
    tech = DataBase.getDB().getTechnology()
    for (via, metal), sides in ENCLOSURES_UM.items():
        setEnclosures(tech.getLayer(via), tech.getLayer(metal), tuple(map(u, sides)))
    for metal in LARGE_ENOUGH:
        tech.getLayer(metal).setMinimalArea(0)
    with overlay.CfgCache(priority=Cfg.Parameter.Priority.UserFile) as cfg:
        cfg.misc.catchCore = False
        cfg.misc.verboseLevel1 = False
        cfg.misc.verboseLevel2 = False
        cfg.etesian.feedNames = ",".join(FILLERS)
        cfg.etesian.antennaGateMaxWL = u(DIODES_UM)
        cfg.etesian.antennaDiodeMaxWL = u(PROTECTED_UM)
        cfg.anabatic.topRoutingLayer = TOP_LAYER
        cfg.spares.buffer = CLOCK_BUFFER
        cfg.spares.maxSinks = SINKS
        cfg.block.spareSide = u(SPARE_UM)
        cfg.katana.eventsLimit = int(sys.argv[4]) if len(sys.argv) > 4 else STEPS
    CRL.AllianceFramework.get().getEnvironment().setCLOCK("^clk$")
    from coriolis.plugins.block.block import Block
    from coriolis.plugins.block.configuration import BlockConf, IoPin

    name, margin = sys.argv[2], float(sys.argv[3])
    said = json.loads(Path("pins.json").read_text())
    cell = CRL.Blif.load(name)
    CRL.restoreNetsDirection(cell, Cell.Flags_TerminalNetlist)
    conf = BlockConf(cell, ioPins=pins(IoPin, said["pins"], math.sqrt(said["area_um2"] * (1 + margin)) - 6.08))
    conf.cfg.etesian.spaceMargin = margin
    conf.cfg.etesian.aspectRatio = 1.0
    conf.cfg.etesian.uniformDensity = True
    conf.cfg.anabatic.globalIterations = 20
    conf.cfg.anabatic.topRoutingLayer = TOP_LAYER
    conf.cfg.katana.hTracksReservedLocal = 10
    conf.cfg.katana.vTracksReservedLocal = 10
    conf.useSpares, conf.useClockTree, conf.useHFNS = True, True, False
    conf.useHTree(CLOCK)
    block = Block(conf)
    routed = bool(block.doPnR())
    fill_gaps(cell)
    UpdateSession.open()
    for net in cell.getNets():
        for pin in net.getPins():
            pin.setWidth(max(pin.getWidth(), u(PIN_UM)))
    UpdateSession.close()
    block.save()
    CRL.DefExport.drive(cell, 0)
    box = cell.getAbutmentBox()
    said = {"routed": routed, "width_um": um(box.getWidth()), "height_um": um(box.getHeight()), "cells": cells(cell)}
    Path("placed.json").write_text(json.dumps(said))


if __name__ == "__main__":
    main()
