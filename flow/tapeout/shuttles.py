"""Requirements of chip shuttles: pins, tile sizes and file names."""

from dataclasses import dataclass

from eskin.base.errors import InputError

DENSITY = 0.6
"""Share of a tile or core that cells may fill, as the templates of the shuttles set it."""

IHP = {
    "1x1": (202.08, 154.98), "1x2": (202.08, 313.74), "2x2": (419.52, 313.74), "3x2": (636.96, 313.74),
    "4x2": (854.40, 313.74), "6x2": (1289.28, 313.74), "8x2": (1724.16, 313.74),
}  # fmt: skip
SKY = {
    "1x1": (161.00, 111.52), "1x2": (161.00, 225.76), "2x2": (334.88, 225.76), "3x2": (508.76, 225.76),
    "4x2": (682.64, 225.76), "6x2": (1030.40, 225.76), "8x2": (1378.16, 225.76),
}  # fmt: skip
GF = {"1x1": (3048.0, 4238.0)}


@dataclass(frozen=True)
class Shuttle:
    """Requirements of one shuttle."""

    name: str
    process: str  # in words
    pdk: str  # name of the design kit
    # width and height in micrometres of what can be rented, the smallest first: tiles of Tiny Tapeout (from
    # ``tech/*/tile_sizes.yaml`` of its support tools), or the core of a slot of wafer.space (from its template)
    sizes: dict[str, tuple[float, float]]
    cells: tuple[str, ...]  # Verilog of the cells, below the root of the design kit
    # fastest clock at the pins: Tiny Tapeout states 50 MHz for outputs, the template of wafer.space aims at 25 MHz
    fastest_hz: float

    @property
    def tiny(self) -> bool:
        """True for Tiny Tapeout shuttles."""
        return self.name.startswith("tt-")

    def smallest(self, area_um2: float) -> str:
        """Return the smallest size for a given cell area."""
        for size, (width, height) in self.sizes.items():
            if area_um2 <= DENSITY * width * height:
                return size
        width, height = next(reversed(self.sizes.values()))
        raise InputError(
            f"{area_um2:,.0f} um2 of cells do not fit: the largest size of {self.name}, {next(reversed(self.sizes))}, "
            f"holds {DENSITY * width * height:,.0f} um2 at {DENSITY:.0%}; use fewer --rows and --columns"
        )


SHUTTLES = {
    shuttle.name: shuttle
    for shuttle in (
        Shuttle(
            "tt-ihp",
            "IHP SG13G2, 130 nm",
            "ihp-sg13g2",
            IHP,
            ("libs.ref/sg13g2_io/verilog/sg13g2_io.v", "libs.ref/sg13g2_stdcell/verilog/sg13g2_stdcell.v"),
            50e6,
        ),
        Shuttle(
            "tt-sky",
            "SkyWater 130 nm",
            "sky130A",
            SKY,
            ("libs.ref/sky130_fd_sc_hd/verilog/primitives.v", "libs.ref/sky130_fd_sc_hd/verilog/sky130_fd_sc_hd.v"),
            50e6,
        ),
        Shuttle("wafer-gf180", "GlobalFoundries 180 nm", "gf180mcuD", GF, (), 25e6),
    )
}
"""All shuttles, by name."""
