"""Searches the built site for each word of the glossary, each key, column, option and message: `python3 .ci/search.py target/site`. Fails where the page is not found."""

import html
import json
import re
import sys
from pathlib import Path

SITE = Path(sys.argv[1])
PAGES = SITE.parent / "site-pages" / "reference"


def terms(text, separator):
    """The words of a text as the search of the site takes them."""
    text = html.unescape(re.sub(r"<[^>]+>", " ", text))
    return {word for word in re.split(separator, text.lower()) if word}


def first_cells(page):
    """The first cell of each row of the tables of a page, as plain words."""
    for line in (PAGES / f"{page}.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("| ") and not line.startswith(("| ---", "|---")):
            yield re.split(r"(?<!\\) \|", line[2:])[0].replace("\\|", "|").strip()


def asked():
    """What is searched for, and the page that has to be found."""
    for cell in first_cells("glossary"):
        yield from ((word.strip("` *"), "") for word in cell.split(", ") if word != "word")
    for page in ("keys", "columns"):
        for cell in first_cells(page):
            yield from ((name, f"reference/{page}.html") for name in re.findall(r"`([^`]+)`", cell))
    for option in re.findall(r"^ +(?:-\w, )?(--[a-z0-9-]+)", (PAGES / "commands.md").read_text(encoding="utf-8"), re.M):
        yield option, "reference/commands.html"
    for cell in first_cells("message-index"):
        if cell != "message":
            yield re.sub(r"\S*…\S*|`|\[\[|\]\]", " ", cell), "reference/message-index.html"


def main():
    index = json.loads((SITE / "search.json").read_text(encoding="utf-8"))
    separator = index["config"]["separator"]
    found = [(item["location"], terms(item["title"] + " " + item["text"], separator)) for item in index["items"]]
    queries = sorted(set(asked()))
    if len(queries) < 1000:
        sys.exit(f"{len(queries)} words to search for: are the tables of the reference as before?")

    def finds(words, page):
        return any(location.startswith(page) and words <= has for location, has in found)

    missing = [f"{query!r} does not find {page or 'a page'}" for query, page in queries if not finds(terms(query, separator), page)]
    print("\n".join(missing))
    print(f"search: {len(queries) - len(missing)} of {len(queries)} find their page")
    sys.exit(1 if missing else 0)


main()
