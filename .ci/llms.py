"""Writes the list of the pages for language models (llmstxt.org), from the navigation and the first sentence of each page: `python3 .ci/llms.py PAGES`, the folder
of the pages of the site, where it becomes llms.txt."""

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def title_and_sentence(text):
    """The title of a page, and the first sentence of its first paragraph; none where it has none."""
    title = re.search(r"^# (.+)$", text, re.M)[1]
    paragraph = next((part for part in text.split("\n\n") if re.match(r"(?!```)[\w`\[]", part)), "")
    plain = re.sub(r"\[([^\]]+)\]\([^)]*\)", r"\1", " ".join(paragraph.split()))
    return title, re.split(r"(?<=[.:!]) (?=[A-Z`])", plain)[0]


def main(pages):
    site = tomllib.loads((ROOT / "zensical.toml").read_text())["project"]
    lines = [f"# {site['site_name']}", "", f"> {title_and_sentence((pages / 'index.md').read_text())[1]}"]
    for entry in site["nav"]:
        (room, paths), = entry.items()
        if isinstance(paths, str):
            continue
        lines += ["", f"## {room}", ""]
        for path in paths:
            title, sentence = title_and_sentence((pages / path).read_text())
            lines.append(f"- [{title}]({path.removesuffix('.md')}.html)" + (f": {sentence}" if sentence else ""))
    (pages / "llms.txt").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
