"""The messages of the program, from the sources.

`python3 .ci/errors.py PAGE.md` writes their index, with what to do; the site has it, so that a search finds each message.
`python3 .ci/errors.py --untested` lists those that no test provokes, and fails if there are any.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# A comment, a character, or a literal with its text.
TOKEN = re.compile(r"""//[^\n]*|'(?:\\.|[^'\\])'|r#"(?P<raw>.*?)"#|"(?P<text>(?:[^"\\]|\\.)*)\"""", re.S)
# What makes an error or a warning of a literal in the same statement.
MAKES = re.compile(r"#\[error\(|\bErr\(|\w*[eE]rror(::\w+)?[({]|Failure::|\bmeaning\(|\bmessage(:| =) |\bwrong\(|\bdamaged\(")
# What makes a hint of it.
HINTS = re.compile(r"\bhint(: &str)?( =|:)\s*(Some\(\s*)?(&?format!\(\s*)?$|\bSome\(\s*(&?format!\(\s*)?$")
# Crates without messages: pages, broken files for tests, a library behind a solver.
OTHER = {"report", "fuzz", "lapack"}
# Crates in which the text of a bare `Err` is not an error, but the reason why a shift or a drive is left out.
REASONS = {"fit"}
# Messages of what no test can bring about, and why.
NOT_PROVOKED = {
    "a disk, a file system, threads or signals that fail": [
        "no thread could be started",
        "interrupts cannot be received",
        "this file system has no locks",
        "the thread that brings the file to the disk has ended",
        "make room on the disk",
        "the path is not UTF-8",
        "too many symbolic links",
    ],
    "damage deep in a file, which the fuzz targets make": [
        "it has … packed bytes, expected at most",
        "the data end after … of … records",
        "the frames of its bus",
        "a dictionary is shorter than its stated size",
        "a page needs a dictionary",
        "the levels of a page are longer",
        "lies outside the file",
        "a column has fewer rows than its group",
        "the pages of a column contradict themselves",
    ],
    "a solver that fails": [
        "the gain of the solver does not satisfy the inequalities",
        "the search failed",
        "the fit left the range in which the model",
    ],
    "what no input has brought about so far, and no rule excludes": [
        "the shift has no acceleration before its request",
        "does not end within … s",
    ],
    "one part of the program that uses another wrongly": [
        "this is an error in wetclutch",
        "a value comes behind its key",
        "the built-in bench has no sensors",
        "the path does not name a file",
        "a row of … cells for … columns",
        "a column has more than 255 words",
        "a cell is not of the kind of its column",
        "a row has not one cell of its kind for each column",
        "a column is not of its kind",
        "a row is too long",
        "line … has … cells",
        "the column does not hold numbers",
        "the mass is not fitted",
        "the vehicle file has no `gear_train.oncoming`",
        "is not made: …",
        "there are … of … runs",
    ],
}


def sources():
    """The files with messages, each without its tests."""
    for path in sorted(ROOT.glob("crates/*/src/**/*.rs")):
        if path.name != "tests.rs" and "tests" not in path.parts and path.relative_to(ROOT).parts[1] not in OTHER:
            yield path, path.read_text(encoding="utf-8").split("#[cfg(test)]")[0]


def literals(text):
    """Place and text of each literal; a backslash at the end of a line joins it with the next one."""
    for match in TOKEN.finditer(text):
        literal = match["raw"] if match["raw"] is not None else match["text"]
        if literal is not None:
            yield match.start(), re.sub(r"\\\n\s*", "", literal)


def is_prose(literal):
    words = re.sub(r"\{[^}]*\}", " ", literal).split()
    return sum(bool(re.search("[A-Za-z]{2}", word)) for word in words) >= 3


def hints_by_variant(code, text):
    """The hints of the variants of an error, in a function `hint`: of each literal the variants between the one before it and it."""
    found, before = {}, code.find("fn hint(&self)")
    for place, literal in literals(text) if before >= 0 else []:
        if place > before and is_prose(literal):
            for variant in re.findall(r"Self::(\w+)", code[before:place]):
                found.setdefault(variant, []).append(literal)
            before = place
    return {variant: "; or ".join(dict.fromkeys(hints)) for variant, hints in found.items()}


def call_of(code, place):
    """Where the call of `wrong` or `meaning` begins that has this place among its arguments."""
    depth = 0
    for at in range(place - 1, max(place - 600, 0), -1):
        depth += (code[at] == ")") - (code[at] == "(")
        if depth < 0:
            if re.search(r"\b(wrong|meaning)$", code[max(at - 8, 0) : at]):
                return at
            depth = 0
        if code[at] in ";}":
            return None
    return None


def messages(path, text):
    """Message, hint and variant of an error, of each literal that is a message. A hint of its own stands in the same function."""
    makes = MAKES if path.relative_to(ROOT).parts[1] not in REASONS else re.compile(MAKES.pattern.replace(r"\bErr\(|", ""))
    code = TOKEN.sub(lambda match: " " * len(match[0]), text)
    of_variants = hints_by_variant(code, text)
    found, function, waiting = [], None, None
    for place, literal in filter(lambda found: is_prose(found[1]), literals(text)):
        begin = code.rfind("fn ", 0, place)
        statement = code[max(code.rfind(end, 0, place) for end in (";", "}\n", "fn ")) + 1 : place][-300:]
        if function != begin:
            function, waiting = begin, None
            # Some functions have each hint before its message.
            is_behind = not HINTS.search(statement)
        if HINTS.search(statement):
            if not is_behind:
                waiting = (place, literal)
            elif found and found[-1][3] == begin and not found[-1][1]:
                found[-1][1] = literal
            continue
        call = call_of(code, place)
        if call and found and found[-1][4] == call:
            # The second text of a call is the hint.
            found[-1][1] = found[-1][1] or literal
            continue
        message, has_hint, hint = literal.partition("\\nhint: ")
        if not has_hint and not literal.startswith("warning") and not makes.search(statement):
            continue
        variant = re.match(r"[^\]]*\]\s*(\w+)", code[place:]) if "#[error(" in statement else None
        variant = variant and variant[1]
        if is_prose(message):
            # One that was used before is of another message.
            is_free = waiting and not re.search(r"\bhint\b", code[waiting[0] : place])
            found.append([message, hint or of_variants.get(variant) or (waiting[1] if is_free else ""), variant, begin, call])
            waiting = None
    return [(message, hint, variant) for message, hint, variant, *_ in found]


def plain(literal):
    """What a message says; a value that is put in is an ellipsis."""
    literal = re.sub(r"\{[^}]*\}", "…", literal.replace("{{", "\0").replace("}}", "\1"))
    return literal.replace("\0", "{").replace("\1", "}").replace("\\n", "\n").replace('\\"', '"').replace("\\\\", "\\")


def cell(literal):
    """A literal as a cell of a table."""
    text = plain(literal).replace("\n", " ")
    return text.strip().removeprefix("hint: ").replace("warning: ", "").replace("|", "\\|").replace("<", "&lt;").removeprefix("…: ").strip()


def write_index(page):
    """Writes the page with the index."""
    found = {}
    for path, text in sources():
        for message, hint, _ in messages(path, text):
            found[cell(message)] = cell(hint) or found.get(cell(message), "")
    if len(found) < 500:
        sys.exit(f"{len(found)} messages found: are they still written as before?")
    rows = [f"| {message} | {hint} |" for message, hint in sorted(found.items(), key=lambda row: row[0].lower().lstrip("`…- "))]
    head = [
        "# Index of messages\n",
        "Each error and warning, in the order of its words; … is a value, a name or a file. Where the hint is empty, it depends on what was found, or the message itself says what is expected. What a message about a log means: [messages](messages.md).\n",
        "| message | hint |",
        "|---|---|",
    ]
    Path(page).write_text("\n".join(head + rows) + "\n", encoding="utf-8")


def of_tests():
    """All that tests compare with, and the code of the tests."""
    said, code = [], []
    for path in [*ROOT.glob("crates/*/tests/**/*.rs"), *ROOT.glob("crates/*/src/**/*.rs"), *ROOT.glob("python/tests/*.py")]:
        text = path.read_text(encoding="utf-8")
        is_source = "src" in path.parts and path.name != "tests.rs" and "tests" not in path.parts
        text = "".join(text.split("#[cfg(test)]")[1:]) if is_source else text
        code.append(text)
        said += [plain(literal) for _, literal in literals(text)] if path.suffix == ".rs" else re.findall(r'"([^"\n]*)"', text)
    said = [" ".join(text.split()) for text in said]
    return [text for text in said if " " in text and len(text) >= 10], "\n".join(code)


def runs_of(message):
    """Patterns of a message: each run of its words with four that are no values, or all of a shorter one."""
    words = plain(message).replace("warning: ", "").split()
    real = [at for at, word in enumerate(words) if word.strip("…:,;.`\"()[]")]
    ends = [(real[at], real[at + 3]) for at in range(len(real) - 3)] or [(real[0], real[-1])]
    for first, last in ends:
        yield " ".join(re.escape(word).replace("…", "[^\\0]{0,60}?") for word in words[first : last + 1])


def is_tested(message, said, everything):
    """Whether a test compares with four words of a message in their order, or with a part of it."""
    if any(re.search(run, everything) for run in runs_of(message)):
        return True
    return any(text in part for part in plain(message).split("…") for text in said)


def list_untested():
    """Prints the messages that no test provokes."""
    said, code = of_tests()
    everything = "\0".join(said)
    excused = [words for of in NOT_PROVOKED.values() for words in of]
    count = 0
    for path, text in sources():
        for message, hint, variant in messages(path, text):
            is_excused = any(words in plain(message + hint) for words in excused)
            if not (is_excused or is_tested(message, said, everything) or variant and f"::{variant}" in code):
                count += 1
                print(f"{path.relative_to(ROOT)}: {cell(message)}")
    print(f"{count} messages that no test provokes")
    sys.exit(1 if count else 0)


list_untested() if sys.argv[1:] == ["--untested"] else write_index(sys.argv[1])
