# SPDX-License-Identifier: Apache-2.0
"""Draw the README's moving picture: the plan page of a published slew, frame by frame.

    python docs/moving_picture.py PAGE PICTURE

PAGE is a page of `riem_plan --html`; PICTURE an animated GIF, which it writes. Needs Chromium.
"""

import base64
import io
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "test/page"))

from browser import Browser  # noqa: E402  the driver of the page's tests

FRAMES, HOLD = 50, 10  # pictures of the slew, and of its end
WIDTH, COLOURS, MILLISECONDS = 380, 48, 80


def main(page: Path, picture: Path) -> None:
    """Step through the page and write the picture."""
    with tempfile.TemporaryDirectory() as folder:
        browser = Browser(folder)
        try:
            browser.open(page.resolve())
            frames = [frame(browser, k / (FRAMES - 1)) for k in range(FRAMES)]
        finally:
            browser.close()
    frames += [frames[-1]] * HOLD
    frames[0].save(
        picture, save_all=True, append_images=frames[1:], duration=MILLISECONDS, loop=0,
        optimize=True,
    )  # fmt: skip
    print(f"{picture}: {picture.stat().st_size / 1e3:.0f} kB")


def frame(browser: Browser, share: float) -> Image.Image:
    """The sphere at a share of the duration, on white, in few colours."""
    browser.value(f"setTime({share} * duration)")
    url = browser.value("document.querySelector('canvas#view').toDataURL()")
    drawn = Image.open(io.BytesIO(base64.b64decode(url.split(",", 1)[1]))).convert("RGBA")
    paper = Image.new("RGBA", drawn.size, "white")
    paper.alpha_composite(drawn)
    small = paper.convert("RGB").resize((WIDTH, WIDTH), Image.Resampling.LANCZOS)
    return small.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
