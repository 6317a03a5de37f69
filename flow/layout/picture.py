"""Draw a picture of a GDS file (runs in the layout environment).

``python picture.py FILE.gds PICTURE.png``. It imports nothing of the project.
"""

# mypy: ignore-errors

import sys

from klayout import db, lay

SIDE = 900
BAR_UM = 20.0
"""Length of the scale bar."""
BAR_LAYER, BAR_COLOUR = (900, 0), 0xFFFFFF
COLOURS = {
    (64, 20): 0x3A3F4B,  # n-well
    (65, 20): 0x3F7F4F,  # diffusion
    (66, 20): 0xB04A4A,  # poly
    (67, 20): 0x8A6FB0,  # local interconnect
    (68, 20): 0x4C8BD0,  # metal 1
    (69, 20): 0xD08BC4,  # metal 2
    (70, 20): 0x56B8A8,  # metal 3
    (71, 20): 0xE0B04A,  # metal 4
}
"""Layers that are drawn, from below, and their colours."""


def add_scale_bar(layout: db.Layout) -> None:
    """Add a scale bar of ``BAR_UM`` below the lower left corner of the top cell."""
    top = layout.top_cell()
    box, thick = top.dbbox(), BAR_UM / 16
    at = db.DPoint(box.left, box.bottom - 6 * thick)
    shapes = top.shapes(layout.layer(*BAR_LAYER))
    shapes.insert(db.DBox(at.x, at.y, at.x + BAR_UM, at.y + thick))
    text = db.TextGenerator.default_generator()
    size = 3 * thick / (text.height() * layout.dbu)  # letters three times as high as the bar
    words = text.text(f"{BAR_UM:g} um", layout.dbu, size)
    words.move(round((at.x + BAR_UM + 2 * thick) / layout.dbu), round((at.y - thick) / layout.dbu))
    shapes.insert(words)


def main() -> None:
    """Draw the layers, with metals above the cells."""
    view = lay.LayoutView()
    view.set_config("background-color", "#14161a")
    for hidden in ("grid-visible", "text-visible", "cell-box-visible"):
        view.set_config(hidden, "false")
    view.load_layout(sys.argv[1], False)
    add_scale_bar(view.cellview(0).layout())
    view.max_hier()
    view.clear_layers()
    for (layer, datatype), colour in (COLOURS | {BAR_LAYER: BAR_COLOUR}).items():
        shown = lay.LayerProperties()
        shown.source = f"{layer}/{datatype}@1"
        shown.fill_color = shown.frame_color = colour
        shown.dither_pattern = 0 if layer < 69 or layer == BAR_LAYER[0] else 5
        shown.width = 1
        view.insert_layer(view.end_layers(), shown)
    view.zoom_fit()
    view.save_image(sys.argv[2], SIDE, SIDE)


if __name__ == "__main__":
    main()
