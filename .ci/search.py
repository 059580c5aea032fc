"""Searches the built site for the questions of a newcomer, and for each word of the glossary, each key, column, option and message: `python3 .ci/search.py target/site`. Fails where the page is not found."""

import html
import json
import re
import sys
from pathlib import Path

SITE = Path(sys.argv[1])
PAGES = SITE.parent / "site-pages" / "reference"


# Questions of a newcomer, in the words that one would type, and the page that answers each.
QUESTIONS = [
    ("install", "how-to/install.html"),
    ("record log channels", "how-to/record-a-log.html"),
    ("accuracy after fit", "explanation/results.html"),
    ("filter or valve maps", "how-to/choose-an-observer.html"),
    ("M11", "how-to/describe-a-gearbox.html"),
    ("plates kiss point spring", "how-to/describe-a-gearbox.html"),
    ("python pip install", "how-to/use-from-python.html"),
    ("matlab", "how-to/use-from-matlab.html"),
    ("simulink", "how-to/use-from-matlab.html"),
    ("good bad report", "how-to/read-ranges-and-certificates.html"),
    ("fit keeps given file", "how-to/when-a-fit-keeps-the-file.html"),
    ("not identifiable", "explanation/fit.html"),
    ("sample rate hz", "how-to/record-a-log.html"),
    ("freewheels", "reference/gearbox-file.html"),
    ("sprags", "reference/gearbox-file.html"),
    ("no wheel speed", "explanation/limits.html"),
    ("ecu", "how-to/put-on-a-controller.html"),
    ("tcu", "how-to/put-on-a-controller.html"),
    ("cite", "index.html"),
]


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
    yield from QUESTIONS
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
