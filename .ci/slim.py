"""Takes what no browser shows out of a built site: slim.py FOLDER. Line breaks with the blanks after them outside of code, anchors of lines of code, and blanks in
schemas."""

import json
import re
import sys
from pathlib import Path

# As they are: code, and the text of scripts.
KEPT = re.compile(r"(<pre.*?</pre>|<script.*?</script>|<textarea.*?</textarea>)", re.DOTALL)


LINE_ANCHOR = re.compile(r'<a id="__codelineno[^>]*></a>')


def slim(page: str) -> str:
    parts = KEPT.split(LINE_ANCHOR.sub("", page))
    return "".join(part if KEPT.fullmatch(part) else re.sub(r"\s*\n\s*", "\n", part) for part in parts)


def main(site: Path) -> None:
    for path in site.rglob("*.html"):
        path.write_text(slim(path.read_text(encoding="utf-8")), encoding="utf-8")
    for path in site.rglob("schemas/*.json"):
        schema = json.loads(path.read_text(encoding="utf-8"))
        path.write_text(json.dumps(schema, separators=(",", ":"), ensure_ascii=False), encoding="utf-8")


main(Path(sys.argv[1]))
