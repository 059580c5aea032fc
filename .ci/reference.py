"""Writes the pages of the reference that follow from the program: commands, keys, columns.

    python3 .ci/reference.py target/release/wetclutch           # write docs/reference/{commands,keys,columns}.md
    python3 .ci/reference.py target/release/wetclutch --check   # fail where they are stale

Ranges of keys are what `wetclutch check` says of a value that is far too large; columns are those that the commands write.
"""

import csv
import re
import shutil
import subprocess
import sys
from pathlib import Path

# No folder of compiled modules beside this file.
sys.dont_write_bytecode = True

from reference_columns import MEANINGS  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = Path(sys.argv[1]).resolve()
WORK = ROOT / "target" / "reference"
HEAD = "<!-- Written by `python3 .ci/reference.py target/release/wetclutch`; do not edit. -->\n"


def run(*arguments, cwd=ROOT):
    return subprocess.run([PROGRAM, *arguments], cwd=cwd, capture_output=True, text=True)


def cell(text):
    return text.replace("|", "\\|")


# Commands


def commands():
    page = [HEAD, "# Commands\n", "| command | does |", "|---|---|"]
    overview = run("--help").stdout
    listed = re.search(r"Commands:\n(.*?)\n\n", overview, re.S).group(1)
    names = [line.split(maxsplit=1) for line in listed.splitlines()]
    names = [(name, does) for name, does in names if name != "help"]
    page += [f"| [`{name}`](#{name}) | {cell(does)} |" for name, does in names]
    page += ["", "Examples and exit codes:", "", "```", overview.split("Examples:\n", 1)[1].rstrip(), "```"]
    for name, _ in names:
        page += ["", f"## {name}", "", "```", run(name, "--help").stdout.rstrip(), "```"]
    return "\n".join(page) + "\n"


# Keys

KINDS = [
    ("Vehicle file with a gearbox", "vehicles", ["eight_speed.toml", "eight_speed_stroke.toml"]),
    ("Vehicle file of one shift", "vehicles", ["two_speed_stroke.toml", "two_speed_pwm.toml"]),
    ("Gearbox file", "gearboxes", ["8hp.toml", "dual_clutch_7.toml"]),
    ("Drive file", "drives", ["city.toml", "wltc_3b.toml"]),
    ("Experiment file", "experiments", ["bench.toml", "fill.toml"]),
    ("Study file", "experiments", ["combined.toml", "eight_speed_ftp_75.toml"]),
]
NUMBER = re.compile(r"[-+]?\d[\d_]*(\.\d+)?([eE][-+]?\d+)?")


def split_comment(line):
    """A line of TOML without its comment, and the comment."""
    quoted = False
    for i, sign in enumerate(line):
        if sign == '"':
            quoted = not quoted
        if sign == "#" and not quoted:
            return line[:i].rstrip(), line[i + 1 :].strip()
    return line.rstrip(), ""


def keys_of(text):
    """Line number, path, value and comment of each key of a TOML file."""
    table, above = "", []
    for number, line in enumerate(text.splitlines()):
        code, comment = split_comment(line)
        if not code.strip():
            above = above + [comment] if comment else []
            continue
        if code.startswith("["):
            table = code.strip("[]").strip() + "."
            above = [comment] if comment else above
            continue
        match = re.match(r"([A-Za-z0-9_.\"-]+)\s*=\s*(.*)$", code)
        if match:
            yield number, table + match.group(1), match.group(2), comment or " ".join(above)
            above = []


def allowed(folder, text, number, value):
    """What `check` expects of a value, by the error that an absurd one gets."""
    if NUMBER.fullmatch(value):
        absurd = "9e99" if "." in value or "e" in value.lower() else "999999999999"
    elif value.startswith('"'):
        absurd = '"?"'
    else:
        return ""
    lines = text.splitlines()
    lines[number] = lines[number].replace(value, absurd, 1)
    probe = WORK / folder / "probe.toml"
    probe.write_text("\n".join(lines) + "\n")
    said = run("check", str(probe)).stderr
    match = re.search(rf"probe\.toml:{number + 1}:.*?expected (?:one of )?(.+)", said)
    return NUMBER.sub(shortened, match.group(1).rstrip(".")) if match else ""


def shortened(number):
    """A number with many zeros in the way people write it."""
    text = number.group(0)
    short = f"{float(text):g}".replace("e+0", "e").replace("e-0", "e-").replace("e+", "e")
    return short if len(text) > 6 and float(text) != 0 else text


def keys():
    if WORK.exists():
        shutil.rmtree(WORK)
    for folder in ["vehicles", "gearboxes", "drives", "experiments"]:
        shutil.copytree(ROOT / folder, WORK / folder)
    page = [HEAD, "# Keys of the files\n"]
    page += [
        "The value is that of the shipped file that is named; the range is the one that `check` states. An empty range: other rules hold, which `check` names.",
        "What each table is for: [vehicle files](vehicle-file.md), [gearbox files](gearbox-file.md), [simulation files](simulation-files.md), [channel map](channel-map.md).",
    ]
    for title, folder, names in KINDS:
        page += ["", f"## {title}", "", "| key | value | range | |", "|---|---|---|---|"]
        seen = set()
        for name in names:
            text = (ROOT / folder / name).read_text()
            for number, path, value, comment in keys_of(text):
                if path in seen:
                    continue
                seen.add(path)
                shown = "[...]" if value == "[" else value if len(value) <= 40 else value[:36] + " ..."
                comment = comment if len(comment) <= 160 else comment[:157] + "..."
                page.append(f"| `{path}` | `{cell(shown)}` | {cell(allowed(folder, text, number, value))} | {cell(comment)} |")
        page += ["", "From " + ", ".join(f"[`{folder}/{name}`](../../{folder}/{name})" for name in names) + "."]
    return "\n".join(page) + "\n"


# Columns


def header(path):
    with open(path, newline="") as file:
        return next(csv.reader(file))


def columns():
    out = WORK / "out"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    drive = (ROOT / "drives/city.toml").read_text()
    (WORK / "drives").mkdir(exist_ok=True)
    (WORK / "drives" / "town.toml").write_text(drive.replace("repetitions = 20", "repetitions = 1"))
    demo, car = ROOT / "vehicles/two_speed_at.toml", ROOT / "vehicles/eight_speed.toml"
    steps = [
        ("demo", "-o", str(out / "demo")),
        ("simulate", str(WORK / "drives/town.toml"), "--vehicle", str(car), "-o", str(out)),
        ("estimate", str(out / "demo/measured.csv"), "--vehicle", str(demo), "-o", str(out / "one.csv")),
        ("estimate", str(out / "city_measured.csv"), "--vehicle", str(car), "-o", str(out / "car.csv")),
    ]
    for step in steps:
        done = run(*step)
        if done.returncode != 0:
            sys.exit(f"{step}: {done.stderr}")
    tables = [
        ("`estimate`, vehicle file with a gearbox", "car.csv"),
        ("Its shifts (`OUT_shifts.csv`)", "car_shifts.csv"),
        ("`estimate`, vehicle file of one shift", "one.csv"),
        ("Its shifts (`OUT_shifts.csv`)", "one_shifts.csv"),
        ("`simulate`, drive of a car with a gearbox", "city.csv"),
        ("`simulate`, car of one shift", "demo/trace.csv"),
    ]
    page = [HEAD, "# Columns of the outputs\n"]
    page.append("Units are in the names ([suffixes](conventions.md#units)). `NAME` is an element of the gearbox in lower case. How they come about: [outputs of `estimate`](estimates.md).")
    unknown = []
    for title, name in tables:
        page += ["", f"## {title}", "", "| column | |", "|---|---|"]
        seen = set()
        for column in header(out / name):
            column = re.sub(r"^element_[a-z0-9]+_", "element_NAME_", column)
            if column in seen:
                continue
            seen.add(column)
            meaning = next((text for pattern, text in MEANINGS if re.search(pattern, column)), None)
            if meaning is None:
                unknown.append(column)
            page.append(f"| `{column}` | {meaning} |")
    if unknown:
        sys.exit("columns without a meaning in .ci/reference_columns.py: " + ", ".join(dict.fromkeys(unknown)))
    # Titles of two tables are alike: each heading is one of its own.
    text = "\n".join(page) + "\n"
    return text.replace("## Its shifts (`OUT_shifts.csv`)", "## Shifts of a car with a gearbox (`OUT_shifts.csv`)", 1).replace(
        "## Its shifts (`OUT_shifts.csv`)", "## Shifts of one shift's vehicle file (`OUT_shifts.csv`)", 1
    )


def main():
    stale = []
    for name, page in [("commands.md", commands()), ("keys.md", keys()), ("columns.md", columns())]:
        path = ROOT / "docs" / "reference" / name
        if "--check" in sys.argv:
            if not path.exists() or path.read_text() != page:
                stale.append(f"docs/reference/{name} is stale: run `python3 .ci/reference.py target/release/wetclutch`")
        else:
            path.write_text(page)
    if stale:
        sys.exit("\n".join(stale))


main()
