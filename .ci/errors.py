"""Writes the index of the messages with a hint, from the sources: `python3 .ci/errors.py PAGE.md`. The site has it, so that a search finds each message."""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LITERAL = re.compile(r'"((?:[^"\\]|\\.)*)"', re.S)


def messages(text):
    """The string literals with a hint, of what is no comment and no test."""
    text = text.split("#[cfg(test)]")[0]
    text = re.sub(r"^\s*//.*$", "", text, flags=re.M)
    for match in LITERAL.finditer(text):
        # A backslash at the end of a line joins it with the next one.
        literal = re.sub(r"\\\n\s*", "", match.group(1))
        message, found, hint = literal.partition("\\nhint: ")
        if found and re.search(r"[a-z]{3}", re.sub(r"\{[^}]*\}", "", message)):
            yield message, hint


def cell(literal):
    """A literal as a cell of a table: a value that is put in is an ellipsis."""
    literal = literal.replace("{{", "\0").replace("}}", "\1")
    literal = re.sub(r"\{[^}]*\}", "…", literal).replace("\0", "{").replace("\1", "}")
    literal = literal.replace("\\n", " ").replace('\\"', '"').replace("\\\\", "\\")
    return literal.replace("warning: ", "").replace("|", "\\|").replace("<", "&lt;").removeprefix("…: ").strip()


def main():
    found = {}
    for path in sorted(ROOT.glob("crates/*/src/**/*.rs")):
        if path.name != "tests.rs" and "tests" not in path.parts:
            found.update({cell(message): cell(hint) for message, hint in messages(path.read_text())})
    if len(found) < 100:
        sys.exit(f"{len(found)} messages found: is a hint still written as before?")
    rows = [f"| {message} | {hint} |" for message, hint in sorted(found.items(), key=lambda row: row[0].lower().lstrip("`…- "))]
    head = [
        "# Index of messages\n",
        "Each error and warning with a hint, in the order of its words; … is a value, a name or a file. What a message about a log means: [messages](messages.md).\n",
        "| message | hint |",
        "|---|---|",
    ]
    Path(sys.argv[1]).write_text("\n".join(head + rows) + "\n")


main()
