"""Record the page of ``eskin demo`` in a browser as docs/figures/demo.gif (``python -m docs.figures.demo``)."""

import io
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageColor

from eskin.base.figures.style import PALETTE
from tests.browser import opened

OUT = Path(__file__).with_suffix(".gif")
FRAMES = 30
LEVELS = {"#ffffff": 14, PALETTE["sky"]: 7, PALETTE["orange"]: 7, PALETTE["green"]: 4}
"""Number of shades for each colour of the page, from its background on."""


def shades() -> list[tuple[int, ...]]:
    """Return the colour palette of the recording."""
    back, card = ImageColor.getrgb("#0d1117"), ImageColor.getrgb("#161b22")
    found: list[tuple[int, ...]] = [back, card]
    for name, levels in LEVELS.items():
        full = ImageColor.getrgb(name)
        for level in range(1, levels + 1):
            found.append(tuple(round(b + (f - b) * level / levels) for b, f in zip(card, full, strict=True)))
    return found


def main() -> None:
    """Write the recording."""
    # Slow enough that screenshots catch every part of the scan.
    words = ["demo", "--port", "0", "--no-browser", "--only", "brick/brick-00", "--limit", "1", "--speed", "0.01"]
    pipes = {"stdout": subprocess.PIPE, "text": True}
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen([sys.executable, "-m", "eskin", *words], **pipes) as demo,  # type: ignore[call-overload]
        opened(Path(folder) / "profile") as browser,
    ):
        browser.size(1000, 812, 0.7)  # 700 pixels wide
        browser.open(re.search(r"http\S+", demo.stdout.readline())[0])
        browser.wait_for("last && last.events > 50")
        pictures = []
        for number in range(FRAMES):
            browser.wait_for(f"last.seconds > {(number + 0.5) / FRAMES} * last.window_s", 120)
            pictures.append(Image.open(io.BytesIO(browser.picture())).convert("RGB"))
        demo.terminate()
    # One palette for all frames, so that unchanged areas need no bytes.
    palette = Image.new("P", (1, 1))
    palette.putpalette([value for colour in shades() for value in colour])
    frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    times = [200] * (FRAMES - 1) + [2500]
    frames[0].save(OUT, save_all=True, append_images=frames[1:], duration=times, loop=0, optimize=True)
    print(f"{OUT}: {OUT.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
