"""Draw timing diagrams as SVG."""

from __future__ import annotations

from collections.abc import Sequence

from eskin.flow.datasheet.waves import Value, Wave

LABELS, CLOCK, LINE, HEIGHT, EDGE = 130, 30, 26, 16, 3
"""Width of the names and of a clock, height of a line and of a level within it, width of an edge; in pixels."""

STYLE = (
    "text{font:11px sans-serif}.value{text-anchor:middle;font-size:10px}"
    "polyline{fill:none;stroke:#0072b2;stroke-width:1.5}"
    ".clk{stroke:#000}.grid{stroke:#ddd}polygon{fill:#fff;stroke:#0072b2}.unknown{fill:#eee;stroke:#999}.note{fill:#555}"
)


def timing_diagram(waves: Sequence[Wave], title: str, first: int = 0) -> str:
    """Return a timing diagram as SVG text, one column per clock from ``first``, ended by a rising edge."""
    clocks = len(waves[0].values)
    wide, high = LABELS + CLOCK * clocks + 10, LINE * (len(waves) + 3) + 10
    bottom = LINE * (len(waves) + 2)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide}" height="{high}" viewBox="0 0 {wide} {high}">',
        f"<title>{title}</title>",
        f"<style>{STYLE}</style>",
        f'<rect width="{wide}" height="{high}" fill="#fff"/>',
        f'<text x="4" y="16" font-weight="bold">{title}</text>',
    ]
    for column in range(clocks):
        x = LABELS + CLOCK * column
        lines.append(f'<line class="grid" x1="{x}" y1="{LINE}" x2="{x}" y2="{bottom}"/>')
        lines.append(f'<text class="value note" x="{x + CLOCK / 2:g}" y="{bottom + 12}">{first + column}</text>')
    ticks = [(column + half, 1 - 2 * half) for column in range(clocks) for half in (0.0, 0.5)]
    lines += [_name("clk", LINE), _line([(0.0, 0.0), *_steps(ticks), (clocks, 0.0)], LINE, "clk")]
    for number, wave in enumerate(waves, 2):
        top = LINE * number
        lines += [_name(wave.name, top), *(_bus if wave.bus else _bit)(wave, top)]
    note = "a value is that just before the rising edge which ends its clock"
    lines += [f'<text class="note" x="{LABELS}" y="{bottom + 28}">{note}</text>', "</svg>"]
    return "\n".join(lines) + "\n"


def _name(name: str, top: int) -> str:
    return f'<text x="4" y="{top + 17}">{name}</text>'


def _line(points: Sequence[tuple[float, float]], top: int, kind: str = "") -> str:
    """Return an SVG line through points of clock and level."""
    text = " ".join(f"{LABELS + CLOCK * clock:g},{top + 4 + HEIGHT * (1 - level):g}" for clock, level in points)
    return f'<polyline{f" class={chr(34)}{kind}{chr(34)}" if kind else ""} points="{text}"/>'


def _steps(changes: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the corners of a waveform for a list of level changes."""
    corners, level = [], 0.0
    for clock, new in changes:
        corners += [(clock, level), (clock, new)]
        level = new
    return corners


def _runs(values: Sequence[Value]) -> list[tuple[int, int, Value]]:
    """Return first clock, clock after the last, and value of each stretch of equal values."""
    starts = [i for i, value in enumerate(values) if not i or value != values[i - 1]]
    ends = [*starts[1:], len(values)]
    return [(start, end, values[start]) for start, end in zip(starts, ends, strict=True)]


def _bit(wave: Wave, top: int) -> list[str]:
    """Return the drawing of a one-bit signal."""
    runs = _runs(wave.values)
    slope, level = EDGE / CLOCK, float(bool(runs[0][2]))
    points = [(0.0, level)]
    for start, _, value in runs[1:]:
        points += [(start + wave.delay, level), (start + wave.delay + slope, float(bool(value)))]
        level = float(bool(value))
    return [_line([*points, (len(wave.values), level)], top)]


def _bus(wave: Wave, top: int) -> list[str]:
    """Return the drawing of a multi-bit signal, grey where undefined."""
    lines = []
    high, low, middle = top + 4, top + 4 + HEIGHT, top + 4 + HEIGHT / 2
    for start, end, value in _runs(wave.values):
        left, right = LABELS + CLOCK * start, LABELS + CLOCK * end
        corners = [(left, middle), (left + EDGE, high), (right - EDGE, high), (right, middle)]
        corners += [(right - EDGE, low), (left + EDGE, low)]
        kind = ' class="unknown"' if value is None else ""
        lines.append(f'<polygon{kind} points="{" ".join(f"{x:g},{y:g}" for x, y in corners)}"/>')
        if value is not None:
            lines.append(f'<text class="value" x="{(left + right) / 2:g}" y="{middle + 4:g}">{value}</text>')
    return lines
