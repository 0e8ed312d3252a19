"""``python -m website.moving_picture``: docs/images/eclipse.webp, the moving picture of the README.

Eclipse tilts towards one direction after the other, up to its direct singularities; beside it a
mark runs over the map of its tilts. The robot is drawn by its own page in a headless Chromium.
"""

from __future__ import annotations

import base64
import io
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin
import xarray as xr
from PIL import Image

import closedchain as cc
from closedchain.robots.viewer import static_page

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "images" / "eclipse.webp"
SIDE = 400  # pixels of each half
FRAMES = 90
TOUCHES = 3  # of the singular curve, in one round
CLOSEST = 0.985  # share of the way to the curve there
STYLE = {"font.size": 9, "axes.titlesize": 10}
PROBE = """<pre id="photographs"></pre><script>
addEventListener("shown", () => {
  const told = QS.map((q) => {
    instrument.toPosture(q);
    viewer.render();
    return viewer.renderer.domElement.toDataURL("image/png");
  });
  document.getElementById("photographs").textContent = JSON.stringify(told);
});
</script></body>"""


def main() -> None:
    """Write the picture."""
    m = cc.load("eclipse")
    tilts, azimuths = np.linspace(0.0, 1.3, 53), np.linspace(-np.pi, np.pi, 145)
    over = {"tilt": tilts, "azimuth": azimuths}
    curve = cc.singularity_set(m, "direct", {**over, "tilt": tilts[1::2], "azimuth": azimuths[::2]})
    cells = cc.singularity_map(m, over, measures=["sigma_direct"], progress=False)
    around = np.linspace(0.0, 2.0 * np.pi, FRAMES, endpoint=False)
    swing = 0.5 - 0.5 * np.cos(TOUCHES * around)
    tilt = CLOSEST * limit(curve, around) * (0.45 + 0.55 * swing)
    q = postures(m, tilt, around)
    robots = photographed(static_page(m, controls=True, up="z"), q)
    maps = marked(cells, curve, tilt, around)
    images = [side_by_side(*pair) for pair in zip(robots, maps, strict=True)]
    images[0].save(
        PICTURE, save_all=True, append_images=images[1:], duration=80, loop=0, quality=55, method=6
    )
    print(f"{PICTURE}: {PICTURE.stat().st_size / 1e3:.0f} kB")


def limit(curve: cc.SingularitySet, azimuths: np.ndarray) -> np.ndarray:
    """Tilt (n,) of a curve that goes round once, towards each azimuth (n,) [rad]."""
    tilt, azimuth = (curve.coordinates[:, curve.over.index(name)] for name in ("tilt", "azimuth"))
    return np.interp(azimuths, azimuth, tilt, period=2.0 * np.pi)


def postures(m: cc.Mechanism, tilts: np.ndarray, azimuths: np.ndarray) -> np.ndarray:
    """Postures (n, nq) with the platform's middle at home and its axis tilted."""
    home = m.pose(m.home)
    axes = np.column_stack([-np.sin(azimuths), np.cos(azimuths), np.zeros_like(azimuths)])
    turns = [home.rotation @ pin.exp3(t * axis) for t, axis in zip(tilts, axes, strict=True)]
    found = cc.inverse(m, [pin.SE3(turn, home.translation) for turn in turns])
    if not found.converged.all():
        raise ValueError(f"not reached: {np.degrees(azimuths[~found.converged])} degrees")
    return found.q


def photographed(page: str, q: np.ndarray) -> list[Image.Image]:
    """The robot at each posture, as its page draws it."""
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        sys.exit("the picture needs chromium or google-chrome")
    page = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page)
    page = page.replace("</body>", PROBE.replace("QS", json.dumps(q.tolist())))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "page.html")
        file.write_text(page, encoding="utf-8")
        options = "--headless=new --no-sandbox --disable-gpu --use-gl=swiftshader --dump-dom"
        # as on a phone, where the controls stand below: the upper half is the scene
        window = f"--window-size={SIDE + 80},{2 * (SIDE + 80)}"
        command = [chromium, *options.split(), "--enable-unsafe-swiftshader", window]
        profile = ["--virtual-time-budget=20000", f"--user-data-dir={folder}/profile"]
        done = subprocess.run(
            [*command, *profile, file.as_uri()], capture_output=True, text=True, check=True
        )
    (told,) = re.findall(r'<pre id="photographs">(.*?)</pre>', done.stdout, re.S)
    urls = json.loads(told)
    pictures = [Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))) for url in urls]
    return [
        on_white(picture).resize((SIDE, SIDE), Image.Resampling.LANCZOS) for picture in pictures
    ]


def on_white(picture: Image.Image) -> Image.Image:
    """The square middle of a picture, without transparency."""
    white = Image.new("RGBA", picture.size, "white")
    white.alpha_composite(picture.convert("RGBA"))
    side = min(white.size)
    left, top = (white.width - side) // 2, (white.height - side) // 2
    return white.crop((left, top, left + side, top + side)).convert("RGB")


def marked(
    cells: xr.Dataset, curve: cc.SingularitySet, tilts: np.ndarray, azimuths: np.ndarray
) -> list[Image.Image]:
    """The map of tilts with a mark at each of them."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from closedchain.analysis.figures import draw_map

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(SIDE / 100, SIDE / 100), dpi=100)
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_subplot(projection="polar")
        draw_map(cells, [curve], measures="sigma_direct", axes=axes)
        trail = axes.plot([], [], color="#c02040", lw=1.5)[0]
        mark = axes.plot([], [], "o", color="#c02040", ms=9, mec="white", mew=1.5)[0]
        found = []
        for k in range(tilts.size):
            trail.set_data(azimuths[: k + 1], tilts[: k + 1])
            mark.set_data(azimuths[k : k + 1], tilts[k : k + 1])
            canvas.draw()
            found.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    return found


def side_by_side(left: Image.Image, right: Image.Image) -> Image.Image:
    """Two pictures of one height as one."""
    both = Image.new("RGB", (left.width + right.width, left.height), "white")
    both.paste(left, (0, 0))
    both.paste(right, (left.width, 0))
    return both


if __name__ == "__main__":
    main()
