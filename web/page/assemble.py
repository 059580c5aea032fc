"""Puts the live page together: assemble.py WASM PAGE. Figures and style are those of the reports."""

import base64
import gzip
import sys
from pathlib import Path

# Bytes of the packed sensor, and of the page.
MOST_PACKED = 1_013_000
MOST_PAGE = 1_477_000

here = Path(__file__).parent
report = here.parent.parent / "crates" / "report"


def text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def main(wasm: Path, page: Path) -> None:
    packed = gzip.compress(wasm.read_bytes(), 9, mtime=0)
    uplot = report / "vendor" / "uplot"
    scripts = [report / "src" / "page" / f"{name}.js" for name in ("data", "figure", "files", "table", "start")]
    script = "".join(text(path) for path in [*scripts, here / "live.js", here / "log.js"])
    styles = [report / "templates" / "style.css", uplot / "uPlot.min.css", here / "live.css"]
    parts = {
        "/* style.css of the reports, uPlot.min.css, live.css */": "".join(text(path) for path in styles),
        "/* the sensor, packed */": base64.b64encode(packed).decode(),
        "/* uPlot.iife.min.js */": text(uplot / "uPlot.iife.min.js"),
        "/* the script of the reports, live.js */": f'(() => {{\n"use strict";\n{script}}})();',
    }
    html = text(here / "live.html")
    for place, part in parts.items():
        before, after = html.split(place)
        html = before + part + after
    page.write_text(html, encoding="utf-8")
    print(f"{page}: {page.stat().st_size} bytes; sensor {wasm.stat().st_size} bytes, {len(packed)} packed")
    if len(packed) > MOST_PACKED or page.stat().st_size > MOST_PAGE:
        sys.exit(f"the page is larger than {MOST_PAGE} bytes, or the packed sensor larger than {MOST_PACKED}")


main(*map(Path, sys.argv[1:]))
