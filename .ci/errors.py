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
# Crates without messages of the program: pages, broken files for tests, a library behind a solver, a tool that makes wetclutch.c.
OTHER = {"c99", "report", "fuzz", "lapack"}
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
        "the shift has no acceleration before its request",
    ],
}


# Names of a place or a kind, which stand in a message.
NAMES = {"the vehicle file", "date or time", "the frames of its bus"}
# What to do about messages whose hint the sources hold elsewhere, or which say in themselves what is expected.
CURES = {
    "wetclutch.c is in the archive of each release, and embedded/portable/build makes it from the sources of this version": [
        "it is not text",
        "it does not define HEAP, STACK_BYTES and IMAGE_VERSION",
        "it is not whole",
        "it takes images of version …",
    ],
    "an error in wetclutch: report it with the file that brings it about": [
        *NOT_PROVOKED["one part of the program that uses another wrongly"],
        "a cell repeats that of the row before",
        "the log was read already",
        "line …: a cell is not a number",
        "another gearbox than the simulated one",
    ],
    "the file is cut or damaged: copy it again from the recorder": [
        *NOT_PROVOKED["damage deep in a file, which the fuzz targets make"],
        "there is no object where one should begin",
        "an object has a stated size of",
        "object is cut",
        "the head of the file is cut",
        "a container unpacks to",
        "a container is packed by method",
        "in the container that ends here",
        "unpacked size is … bytes",
        "it unpacks to",
        "what is packed in it is damaged",
        "block at byte",
        "the column does not hold numbers",
    ],
    "the table has been changed or removed since it was written; make its runs again in another folder": [
        "contains … of … runs",
        "the row is of run",
        "the seed of run",
        "of run … is …, expected",
        "the numbers of the row have been changed",
        "do not go with its status",
        "the names of the columns are missing",
        "the line is not UTF-8 text",
        "the line ends with CR LF",
        "the columns are not those of this study",
    ],
    "use letters, digits, spaces and underscores, such as \"town 1\"": [
        "be longer than … bytes",
        "contain a line break",
        "contain a double quote",
        "begin with one of",
        "begin or end with a space",
    ],
    "give a value in the range that the message names": [
        "`…` is …, expected",
        "expected a number from",
        "expected a whole number from",
        "expected I/N with I",
        "expected two gears by their names",
        "such as [\"1-2\", \"2-1\"]",
        "\"…\", or a list of shifts",
    ],
    "the lines before name each file with its error and what to do": [
        "… files have errors",
        "logs have no estimate",
        "logs are not inspected",
    ],
    "the reason and its hint follow in the message": [
        "the converter cannot be fitted",
        "the first car that failed",
        "there is no shift to fit",
        "no shift can be used",
        "cannot be simulated",
        "continuing with the best certified gain",
    ],
    "[what to do when a fit keeps the file](../how-to/when-a-fit-keeps-the-file.md)": ["the given values are kept"],
    "`late_s` of the channel map: `fit --write-map` writes it": ["The values above are those with corrected times of the commands"],
    "set `channel.NAME.unit`, or use `--channel NAME=\"NAME [UNIT]\"`": ["… cannot be in …"],
    "set `channel.NAME.scale` to a negative number": ["its sign is the other way round", "an engine does not turn backwards"],
    "check that `channel.NAME.name` is this signal and that its sensor works": ["rad/s in all samples, and"],
    "times are numbers, `12:00:01.25` or `2024-03-31 12:00:01.25`, all in one form": ["rows have no time, the first is"],
    "correct the signal in the DBC: the log is read without it": ["expected 1 to 64 within 64 bytes", "expected 32 or 64"],
    "make a new observer with what was learnt of the car, and save that: it is valid for all versions": ["is of version …, and this is", "is of another gearbox"],
    "free memory, or give the process more": ["no thread could be started", "the search failed"],
    "use a system on which a process may handle signals": ["interrupts cannot be received"],
    "use a gain that the command `design` certifies, or a shorter sample time": ["the gains are unstable"],
    "use a shorter sample time, or discretisation = \"exact\"": ["is longer than the valve's time constant"],
    "use a longer sample time, or a shorter `sample_time_s` of the experiment": ["of the recorded signals"],
    "`--observer rigid` or `compliant`, with any method but `iss`; --shift 1-2 gives the gains of one shift": ["has no certificate…", "has no bound for a sample time"],
    "widen the requirement, or use another method: `design --page` shows what is reachable": ["in each of … programs"],
    "give the throttle fewer points": ["points to the … of the throttle", "give the throttle fewer points"],
    "remove the key; [the keys of each kind](../reference/keys.md)": ["has no effect with this kind"],
    "name two elements of the gearbox": ["has to name two elements"],
    "level = \"ratios\", \"shares\" or \"stick-diagram\"": ["there is no such level"],
    "begin with one of these tables; `wetclutch init` writes a vehicle file": ["expected a vehicle file"],
    "give a smaller number": ["the number is too large"],
    "the first line is \"time_s,speed_km_h\" (or speed_m_s, speed_mph), then one point in each line": ["has no comma", "the columns are \"", "fewer than two points"],
    "the hint lists the observers of the experiment: name one or more of them, each once": ["a study needs at least one observer", "the experiment has no observer `", "is in the list twice"],
    "the hint lists the elements of the gearbox": ["the gearbox has no clutch or brake"],
    "proportional: time_constant_s, gain_pa_a; pulse-width: flow_sqrt_pa_s, line_pressure_pa": ["has a key of another kind of valve"],
    "describe at least one": ["there are none"],
    "give the key in the vehicle file": ["the vehicle file has no numbers at"],
    "leave out those that no gear engages": ["at most … are possible"],
    "give the gearbox an output shaft of its own": ["input and output are the same shaft"],
    "check the unit: g m2 is 0.001 kg m2": ["what turns with it usually has"],
    "`wetclutch check` of the gearbox file lists its shifts, and the elements that open and close in each": ["there is no way from gear"],
    "the message itself says what to check": ["check the units of both speeds"],
    "copy the file to a path with fewer links": ["too many symbolic links"],
    "make room on the disk, then run it again": ["the thread that brings the file to the disk has ended"],
}


def cure_of(message):
    """What to do about a message without a hint beside it."""
    return next((cure for cure, parts in CURES.items() if any(part in plain(message) for part in parts)), "")


def sources():
    """The files with messages, each without its tests."""
    for path in sorted(ROOT.glob("crates/*/src/**/*.rs")):
        is_reader = "all_errors" in path.parts  # It looks into messages, and makes none.
        if path.name != "tests.rs" and "tests" not in path.parts and not is_reader and path.relative_to(ROOT).parts[1] not in OTHER:
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


def constant_hint(code, place, text):
    """The text of the constant that is the hint in the call after a message, if there is one."""
    for word in re.findall(r"\b[A-Z][A-Z_]{3,}\b", code[place : code.find(";", place)][:240]):
        value = re.search(rf"\bconst {word}: &str =\s*", code)
        value = value and next((literal for at, literal in literals(text) if at == value.end()), "")
        if value and is_prose(value):
            return value
    return ""


def messages(path, text):
    """Message, hint and variant of an error, of each literal that is a message. A hint of its own stands in the same function."""
    makes = MAKES if path.relative_to(ROOT).parts[1] not in REASONS else re.compile(MAKES.pattern.replace(r"\bErr\(|", ""))
    code = TOKEN.sub(lambda match: " " * len(match[0]), text)
    of_variants = hints_by_variant(code, text)
    # By function, in their order.
    functions = {}
    for place, literal in literals(text):
        begin = code.rfind("fn ", 0, place)
        statement = code[max(code.rfind(end, 0, place) for end in (";", "}\n", "fn ")) + 1 : place][-300:]
        found = functions.setdefault(begin, [])
        call = call_of(code, place)
        is_second = call and found and found[-1]["call"] == call
        if HINTS.search(statement) or is_second:
            # A hint with a name belongs to the message that stands before its use, any other one to the message before itself.
            is_named = re.search(r"\blet hint\b", statement)
            use = is_named and re.compile(r"\bhint\b").search(code, place)
            before = use.start() if use else place
            functions[begin].append({"hint": literal, "before": before, "place": place, "call": call})
            continue
        message, has_hint, hint = literal.partition("\\nhint: ")
        if message not in NAMES and is_prose(message) and (has_hint or literal.startswith("warning") or makes.search(statement)):
            variant = re.match(r"[^\]]*\]\s*(\w+)", code[place:]) if "#[error(" in statement else None
            variant = variant and variant[1]
            hint = hint or of_variants.get(variant) or ""
            found.append({"message": message, "hint": hint, "variant": variant, "place": place, "call": call})
    for found in functions.values():
        said = [piece for piece in found if "message" in piece]
        for hint in filter(lambda piece: "message" not in piece, found):
            last = max((piece for piece in said if piece["place"] < hint["before"]), key=lambda piece: piece["place"], default=None)
            if last and not last["hint"]:
                last["hint"] = hint["hint"]
        for piece in said:
            yield piece["message"], piece["hint"] or constant_hint(code, piece["place"], text), piece["variant"]


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
            found[cell(message)] = cell(hint) or found.get(cell(message), "") or cell(cure_of(message))
    if len(found) < 500:
        sys.exit(f"{len(found)} messages found: are they still written as before?")
    without = [message for message, hint in found.items() if not hint]
    if without:
        sys.exit("\n".join(["messages without a hint, and none in CURES:", *without]))
    rows = [f"| {message} | {hint} |" for message, hint in sorted(found.items(), key=lambda row: row[0].lower().lstrip("`…- "))]
    head = [
        "# Index of messages\n",
        "Each error and warning, in the order of its words; … is a value, a name or a file. What a message about a log means: [messages](messages.md).\n",
        "| message | what to do |",
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
