"""Write the LEF abstract of a layout and read it back with KLayout (runs in the layout environment).

``python abstract.py LAYOUT.gds TOP PINS.json`` writes macro.lef and abstract.json, the result of the comparison of
macro.lef with LAYOUT.gds. It imports nothing of the project.
"""

# mypy: ignore-errors

import json
import sys
from pathlib import Path

import klayout.db as db

LAYERS = {
    "li": ("li1", 67, 20),
    "mcon": ("mcon", 67, 44),
    "m1": ("met1", 68, 20),
    "via": ("via", 68, 44),
    "m2": ("met2", 69, 20),
    "via2": ("via2", 69, 44),
    "m3": ("met3", 70, 20),
}
"""Layers of wires and vias: name in the placement, name in SkyWater's LEF, layer and purpose in GDS."""

HEAD = """VERSION 5.7 ;
BUSBITCHARS "[]" ;
DIVIDERCHAR "/" ;
UNITS
  DATABASE MICRONS 1000 ;
END UNITS

MACRO {top}
  CLASS BLOCK ;
  FOREIGN {top} 0 0 ;
  ORIGIN 0 0 ;
  SIZE {width_um:.3f} BY {height_um:.3f} ;
  SYMMETRY X Y R90 ;
"""


def metals(layout, top):
    """Return the merged geometry of every layer, in the names of the placement."""
    found = {}
    for name, (_, number, purpose) in LAYERS.items():
        index = layout.find_layer(number, purpose)
        found[name] = db.Region() if index is None else db.Region(top.begin_shapes_rec(index)).merged()
    return found


def rectangles(region, dbu):
    """Return the lines of a region's rectangles."""
    lines = []
    for polygon in region.decompose_trapezoids_to_region(db.Polygon.TD_htrapezoids).each():
        if not polygon.is_box():
            raise SystemExit(f"no rectangle: {polygon}")
        box = polygon.bbox().to_dtype(dbu)
        lines.append(f"RECT {box.left:.3f} {box.bottom:.3f} {box.right:.3f} {box.top:.3f} ;")
    return sorted(lines)


def lef(layout, top, said):
    """Return the abstract: each pin with its wire in the pin's layer, and all other metal and vias as obstructions."""
    metal, dbu = metals(layout, top), layout.dbu
    lines = [HEAD.format(top=top.name, **said)]
    pins = {name: db.Region() for name in LAYERS}
    for name, pin in said["pins"].items():
        lines += [f"  PIN {name}", f"    DIRECTION {pin['direction']} ;", f"    USE {pin['use']} ;", "    PORT"]
        for layer in sorted({box[0] for box in pin["boxes"]}):
            boxes = db.Region([db.DBox(*box[1:]).to_itype(dbu) for box in pin["boxes"] if box[0] == layer])
            if not (boxes - metal[layer]).is_empty():
                raise SystemExit(f"pin {name} has no metal in {layer}")
            wire = metal[layer].interacting(boxes)
            pins[layer] += wire
            lines += [f"      LAYER {LAYERS[layer][0]} ;", *(f"        {one}" for one in rectangles(wire, dbu))]
        lines += ["    END", f"  END {name}"]
    lines.append("  OBS")
    for layer, region in metal.items():
        rest = rectangles(region - pins[layer], dbu)
        lines += [f"    LAYER {LAYERS[layer][0]} ;", *(f"      {one}" for one in rest)] if rest else []
    return "\n".join([*lines, "  END", f"END {top.name}", "", "END LIBRARY", ""])


def compare(path, layout, top):
    """Return the differences between a LEF file as KLayout reads it and the layout: geometry, and names of the pins."""
    options, read = db.LoadLayoutOptions(), db.Layout()
    options.lefdef_config.macro_resolution_mode = 1  # the geometry of the LEF file
    read.read(str(path), options)
    macro, differ = read.cell(top.name), []
    if macro is None:
        return 0, [f"no macro {top.name}"]
    names = {info.name: index for index in read.layer_indexes() for info in [read.get_info(index)]}

    def shapes(name):
        return db.Region(macro.begin_shapes_rec(names[name])) if name in names else db.Region()

    found = 0
    for layer, metal in metals(layout, top).items():
        name, number, _ = LAYERS[layer]
        pins = shapes(f"{name}.PIN")
        if not (pins + shapes(f"{name}.OBS") ^ metal).is_empty():
            differ.append(f"geometry of {name}")
        index = layout.find_layer(number, 0)
        texts = db.Texts(top.shapes(index)) if index is not None else db.Texts()
        for text in db.Texts(macro.begin_shapes_rec(names[f"{name}.LABEL"])).each() if f"{name}.LABEL" in names else ():
            there = pins.merged().interacting(db.Region(text.bbox().enlarged(1, 1)))
            labels = {one.string for one in texts.interacting(there).each()}
            found += 1
            if labels != {text.string}:
                differ.append(f"pin {text.string} lies on {' '.join(sorted(labels)) or 'no wire'}")
    return found, differ


def main() -> None:
    """Write and compare the abstract of a layout."""
    gds, name, pins = sys.argv[1:]
    said, layout = json.loads(Path(pins).read_text()), db.Layout()
    layout.read(gds)
    top, path = layout.cell(name), Path("macro.lef")
    path.write_text(lef(layout, top, said))
    found, differ = compare(path, layout, top)
    Path("abstract.json").write_text(json.dumps({"labels": found, "differ": differ}))


if __name__ == "__main__":
    main()
