"""Writes the pages of the reference that follow from the program: commands, keys, columns.

    python3 .ci/reference.py target/release/wetclutch           # write docs/reference/{commands,keys,columns}.md
    python3 .ci/reference.py target/release/wetclutch --check   # fail where they are stale

Ranges of keys are what `wetclutch check` says of a value that is far too large, and those of the JSON schemas (.ci/schemas.py, which is to be run
first) for keys that the shown files do not have; columns are those that the commands write.
"""

import csv
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

# No folder of compiled modules beside this file.
sys.dont_write_bytecode = True

from reference_columns import MEANINGS  # noqa: E402
from reference_keys import DEFAULTS, READERS  # noqa: E402

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
    ("Vehicle file with a gearbox", "car", "vehicles", ["eight_speed.toml", "eight_speed_stroke.toml"]),
    ("Vehicle file of one shift", "vehicle", "vehicles", ["two_speed_stroke.toml", "two_speed_pwm.toml"]),
    ("Gearbox file", "gearbox", "gearboxes", ["8hp.toml", "dual_clutch_7.toml"]),
    ("Drive file", "drive", "drives", ["city.toml", "wltc_3b.toml"]),
    ("Experiment file", "experiment", "experiments", ["bench.toml", "fill.toml"]),
    ("Study file", "study", "experiments", ["combined.toml"]),
    ("Study file of a car with a gearbox", "car_study", "experiments", ["eight_speed_ftp_75.toml"]),
    ("Channel map", "channel_map", "maps", ["genesis_at8.toml"]),
]
# Tables whose keys are listed elsewhere.
ALIKE = [
    (r"scenario\[\]\.sensors\.", ("scenario[].sensors", "keys of the [sensors](#sensors-file)")),
    (r"sensors\.", ("sensors", "keys of the [sensors](#sensors-file)")),
    (r"scenario\[\]\.off_nominal\.", ("scenario[].off_nominal", "keys of `off_nominal`")),
]
# Kinds of which no file is shipped: their keys are those of the schema.
OTHERS = [("Sensors file", "sensors"), ("File of what was learnt", "learnt")]
TITLES = ["| key | value | range | default | read by | |", "|---|---|---|---|---|---|"]
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
    listed = re.match(r"\[+\s*([-+0-9.eE_]+)\s*[,\]]", value)
    if listed:
        value, absurd = listed.group(1), "9e99"
    elif NUMBER.fullmatch(value):
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
    if float(text) == 0:
        return text
    return short if len(text) > 6 or "e" in text else text


def measured_defaults():
    """The defaults of vehicle files, by what `check` says of short ones with the numbers of the cars whose values they are."""
    car = WORK / "vehicles" / "short.toml"
    car.write_text('name = "short"\ngearbox = "../gearboxes/8hp.toml"\nfill = {}\n')
    one = WORK / "vehicles" / "short_one.toml"
    numbers = ["--mass-kg", "1500", "--wheel-radius-m", "0.3", "--final-ratio", "3", "--engine-torque-n-m", "190"]
    run("init", "--ratios", "2.5,1", *numbers, "--stroke", "-o", str(one))
    found = json.loads(run("check", "--json", str(car), str(one)).stdout)["files"]
    of = lambda file: {without_names(taken["key"]): taken["value"] for taken in file["defaults"]}
    return {"car": of(found[0]), "vehicle": of(found[1])}


def without_names(path):
    """A key without the names of a car's parts and places in lists."""
    path = re.sub(r"^clutch\.[^.]+\.", "clutch.NAME.", path)
    return re.sub(r"^(gear_train\.shaft)\.[^.]+\.", r"\1[].", path)


def default(kind, path, required, measured):
    """What a key counts as where it is left out."""
    plain = re.sub(r"^(clutch|channel)\.[^.]+\.", r"\1.NAME.", path.lstrip("."))
    # Files have no brackets after the name of a list of tables.
    in_lists = {re.sub(r"\[\]", "", key.lstrip(".")): key.lstrip(".") for key, _ in schema_keys(schema_of(kind))}
    plain = in_lists.get(plain, plain)
    value = measured.get(kind, {}).get(plain)
    if value is not None:
        return f"`{cell(value if len(value) <= 30 else '[...]')}`"
    if plain in {key.lstrip(".") for key in required}:
        return "required"
    fits = lambda pattern: re.match(pattern.replace(r"\[\]", r"(\[\])?"), plain.removeprefix("NAME."))
    found = next((text for pattern, text in DEFAULTS[kind] if fits(pattern)), None)
    if found is None:
        MISSING.append(f"{kind}: `{path}` has no default in .ci/reference_keys.py")
    return found


MISSING = []


def required_keys(schema, path=""):
    """The keys without which a table of a schema is not taken."""
    for one in schema.get("anyOf", [schema]):
        items = one.get("items")
        if isinstance(items, dict) and path:
            yield from required_keys(items, path + "[]")
        for key, of in one.get("properties", {}).items():
            whole = f"{path}.{key}" if path else key
            if key in one.get("required", []):
                yield whole
            yield from required_keys(of, whole)
        if isinstance(one.get("additionalProperties"), dict):
            yield from required_keys(one["additionalProperties"], f"{path}.NAME" if path else "NAME")


def schema_keys(schema, path=""):
    """Each key of a schema with what it says of its values."""
    for one in schema.get("anyOf", [schema]):
        if one.get("type") == "array" and "items" in one and path:
            items = one["items"]
            if "properties" in items or "anyOf" in items:
                yield from schema_keys(items, path + "[]")
                continue
        if "properties" not in one and not isinstance(one.get("additionalProperties"), dict):
            if path:
                yield path, one
            continue
        for key, of in one.get("properties", {}).items():
            yield from schema_keys(of, f"{path}.{key}" if path else key)
        if isinstance(one.get("additionalProperties"), dict):
            yield from schema_keys(one["additionalProperties"], path + ".NAME")


def values_of(schema):
    """The values that a key takes, in words: type and range."""
    if "enum" in schema:
        return "", ", ".join(f"`{word}`" for word in schema["enum"])
    types = schema.get("type", "")
    words = " or ".join([types] if isinstance(types, str) else types)
    items = schema
    while "items" in items:
        items = items["items"]
    if "minimum" in items:
        return words, " to ".join(shortened(NUMBER.match(f"{items[end]:.12g}")) for end in ("minimum", "maximum"))
    return words, items.get("description", "").removeprefix("expected ")


def reader(kind, path):
    """The commands that read a key."""
    found = next((by for pattern, by in READERS[kind] if re.match(pattern, path)), None)
    if found is None:
        sys.exit(f"{kind}: `{path}` has no reader in .ci/reference_keys.py")
    return found


def schema_of(kind):
    return json.loads((ROOT / "docs" / "schemas" / f"{kind}.json").read_text())


def rows_of_schema(kind, seen, measured):
    """Rows of the keys of a schema that are not among those."""
    schema = schema_of(kind)
    required = set(required_keys(schema))
    rows = {}
    for path, of in schema_keys(schema):
        alike = next((words for pattern, words in ALIKE if re.match(pattern, path)), None) if kind != "sensors" else None
        if alike is not None:
            name, words = alike
            rows[name] = f"| `{name}` | table | | {words} | {reader(kind, path)} | |"
        elif path not in seen and path not in rows:
            words, allowed = values_of(of)
            shown = f"sensors.{path.removeprefix('.NAME.')}" if kind == "sensors" else path
            rows[path] = f"| `{shown}` | {words} | {cell(allowed)} | {default(kind, path, required, measured)} | {reader(kind, path)} | |"
    return list(rows.values())


def keys():
    if WORK.exists():
        shutil.rmtree(WORK)
    for folder in ["vehicles", "gearboxes", "drives", "experiments", "maps"]:
        shutil.copytree(ROOT / folder, WORK / folder)
    page = [HEAD, "# Keys of the files\n"]
    page += [
        "The value is that of the shipped file that is named; the range is the one that `check` states. An empty range: other rules hold, which `check` names. The default holds where the key is left out; that of a vehicle file is of a car of 1500 kg and 190 N m, and scaled for others. `[]` is any entry of a list of tables, `NAME` any name.",
        "Read by: the commands whose results depend on the key. `simulate` stands for all that simulate: `demo`, `bench`, `study`, `worst-case`, `error-bound`; `estimate` also for `fit`, `export`, `sensitivity` and the estimates of those. `check` reads every key.",
        "What each table is for: [vehicle files](vehicle-file.md), [gearbox files](gearbox-file.md), [simulation files](simulation-files.md), [channel map](channel-map.md).",
    ]
    measured = measured_defaults()
    for title, kind, folder, names in KINDS:
        page += ["", f"## {title}", "", *TITLES]
        seen, required = set(), set(required_keys(schema_of(kind)))
        for name in names:
            text = (ROOT / folder / name).read_text()
            for number, path, value, comment in keys_of(text):
                if path in seen:
                    continue
                seen.add(path)
                shown = "[...]" if value == "[" else value if len(value) <= 40 else value[:36] + " ..."
                comment = comment if len(comment) <= 160 else comment[:157] + "..."
                page.append(f"| `{path}` | `{cell(shown)}` | {cell(allowed(folder, text, number, value))} | {default(kind, path, required, measured)} | {reader(kind, path)} | {cell(comment)} |")
        page += ["", "From " + ", ".join(f"[`{folder}/{name}`](../../{folder}/{name})" for name in names) + "."]
        others = rows_of_schema(kind, seen, measured)
        if others:
            page += ["", "Other keys of such a file:", "", *TITLES, *others]
    for title, kind in OTHERS:
        page += ["", f"## {title}", "", *TITLES, *rows_of_schema(kind, set(), measured)]
    if MISSING:
        sys.exit("\n".join(MISSING))
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
    # With all sensors that there are: those of the bench, and an accelerometer.
    bench = (ROOT / "experiments/bench.toml").read_text()
    sensors = bench[bench.index("[sensors]") : bench.index("[[observer]]")] + "[sensors.acceleration]\nnoise_m_s2 = 0.05\n"
    (WORK / "drives" / "town.toml").write_text(drive.replace("repetitions = 20", "repetitions = 1") + "\n" + sensors)
    demo, car = ROOT / "vehicles/two_speed_at.toml", ROOT / "vehicles/eight_speed.toml"
    steps = [
        ("demo", "-o", str(out / "demo")),
        ("simulate", str(WORK / "drives/town.toml"), "--vehicle", str(car), "-o", str(out)),
        ("estimate", str(out / "demo/measured.csv"), "--vehicle", str(demo), "-o", str(out / "one.csv")),
        ("estimate", str(out / "city_measured.csv"), "--vehicle", str(car), "-o", str(out / "car.csv")),
        ("fit", str(out / "city_measured.csv"), "--vehicle", str(car), "-o", str(out / "fitted.toml"), "--adaptation-table", str(out / "adaptations.csv")),
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
        ("`fit --adaptation-table`", "adaptations.csv"),
        ("`simulate`, drive of a car with a gearbox", "city.csv"),
        ("`simulate`, car of one shift", "demo/trace.csv"),
    ]
    page = [HEAD, "# Columns of the outputs\n"]
    page.append("Units are in the names ([suffixes](conventions.md#units)). `NAME` is an element of the gearbox in lower case. How they come about: [outputs of `estimate`](estimates.md). The columns of an accelerometer are there where the log or the drive has one.")
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
    return text.replace("## Its shifts (`OUT_shifts.csv`)", "## Shifts of a car with a gearbox (`OUT_shifts.csv`; without estimates `NAME_shifts.csv` of `simulate`)", 1).replace(
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
