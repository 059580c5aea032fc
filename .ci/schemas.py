"""Writes the JSON schemas of the TOML files, from what the program accepts: docs/schemas/*.json.

    python3 .ci/schemas.py target/release/wetclutch           # write them
    python3 .ci/schemas.py target/release/wetclutch --check   # fail where one is stale

The shipped files are read, and `wetclutch check` is asked for each key which types of values it takes, for each number which range, and for each table
which keys. A file that the program accepts fits its schema. A range that changes with other values of the file is in the description alone.
"""

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = Path(sys.argv[1]).resolve()
WORK = ROOT / "target" / "schemas"
FOLDERS = ["vehicles", "gearboxes", "drives", "experiments", "maps"]
UNKNOWN = "no_such_key_at_all"
REFUSED = ("invalid type", "invalid length", "invalid value", "data did not match")
# A value of each type, and what a schema calls the type.
TYPES = [(1.0, "number"), ("?", "string"), (True, "boolean"), ([1.0, 1.0], "array"), ([[1.0]], "array"), ([], "array"), ({}, "object")]
ALL = {name for _, name in TYPES}
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
RANGE = re.compile(f"({NUMBER.pattern}) to ({NUMBER.pattern})")
# A number outside every range.
ABSURD = 9e99
KINDS = {
    "a vehicle file of a car with a gearbox": ("car", "Vehicle file with a gearbox"),
    "a vehicle file of one shift": ("vehicle", "Vehicle file of one shift"),
    "a gearbox file": ("gearbox", "Gearbox file"),
    "a drive file": ("drive", "Drive file"),
    "an experiment file": ("experiment", "Experiment file"),
    "a study file": ("study", "Study file"),
    "a study file of a car with a gearbox": ("car_study", "Study file of a car with a gearbox"),
    "a sensors file": ("sensors", "Sensors file"),
    "a file with a part of a vehicle file, such as bounds": ("bounds", "Part of a vehicle file, such as bounds"),
    "a file of what was learnt of a car": ("learnt", "What the gearbox filter has learnt of a car"),
    "a channel map": ("channel_map", "Channel map"),
}


def toml(value):
    """A value on one line of TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {toml(of)}" for key, of in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)


def check(*files):
    done = subprocess.run([PROGRAM, "check", "--json", *files], capture_output=True, text=True)
    return json.loads(done.stdout)["files"]


def scaled(value, factor):
    """A value whose decimal numbers are all multiplied."""
    if isinstance(value, dict):
        return {key: scaled(of, factor) for key, of in value.items()}
    if isinstance(value, list):
        return [scaled(of, factor) for of in value]
    return value * factor if isinstance(value, float) else value


class File:
    """A shipped file, of which parts are replaced."""

    def __init__(self, path, root=None):
        self.path, self.root = path, root or tomllib.loads(path.read_text())
        self.others = scaled(self.root, 0.97)

    def changed(self, place, value):
        """The file with another value at a place."""
        return File(self.path, self.replaced(place, value))

    def fixed_range(self, place, value):
        """The range of a number, by the error of an absurd one, and its ends if it is the same with other values of the file."""
        errors = self.errors(self.replaced(place, value), self.replaced(place, value, self.others))
        expected, with_others = map(expected_of_absurd, errors)
        ends = RANGE.fullmatch(expected or "")
        is_fixed = ends and with_others == expected
        return expected, [float(ends.group(1)), float(ends.group(2))] if is_fixed else None

    def replaced(self, place, value, root=None):
        """The tables of the file, or other ones, with another value at a place."""
        root = json.loads(json.dumps(root or self.root))
        inner = root
        for step in place[:-1]:
            inner = inner[step]
        inner[place[-1]] = value
        return root

    def without(self, place):
        """The tables of the file without the key at a place."""
        root = json.loads(json.dumps(self.root))
        inner = root
        for step in place[:-1]:
            inner = inner[step]
        del inner[place[-1]]
        return root

    def errors(self, *roots):
        """The errors of files with these tables, beside the file; the program starts once for all, which is most of the time."""
        probes = [self.path.with_name(f"probe_{at}.toml") for at in range(len(roots))]
        for probe, root in zip(probes, roots):
            probe.write_text("".join(f"{json.dumps(key)} = {toml(of)}\n" for key, of in root.items()))
        return [found["errors"] for found in check(*map(str, probes))]


def expected_of_absurd(errors):
    """The range that an error names of a number outside every range; none where no error does."""
    return next((error["expected"] for error in errors if error["expected"] and error["value"] == ABSURD), None)


def quoted(message):
    return message.split("`")[1::2]


def keys_of(file, place):
    """The keys that a table may have; none where any name is a key."""
    [errors] = file.errors(file.replaced([*place, UNKNOWN], 1))
    for error in errors:
        found = quoted(error["message"])
        if error["message"].startswith("unknown ") and UNKNOWN in found:
            return [key for key in found if key != UNKNOWN] or None
    return None


def with_range(schema, found):
    """The schema of a number with its range."""
    expected, ends = found
    if ends:
        return {**schema, "minimum": ends[0], "maximum": ends[1]}
    if expected:
        return {**schema, "description": f"expected {NUMBER.sub(lambda number: f'{float(number.group()):g}', expected)}"}
    return schema


def numbers_of(file, place, value):
    """The schema of a list of numbers, or of lists of them."""
    if value and all(type(item) in (int, float) for item in value):
        found = file.fixed_range(place, [ABSURD, *value[1:]])
        return {"type": "array", "items": with_range({"type": "number"}, found)} if found[0] else None
    if value and all(isinstance(item, list) for item in value):
        # The first list stands for all.
        inner = numbers_of(file, [*place, 0], value[0])
        return {"type": "array", "items": inner} if inner else None
    return None


def schema_of_value(file, place, value):
    types, words = set(), []
    for (_, name), errors in zip(TYPES, file.errors(*(file.replaced(place, probe) for probe, _ in TYPES))):
        refused = [error["message"] for error in errors if error["message"].startswith(REFUSED)]
        variants = [quoted(error["message"])[1:] for error in errors if error["message"].startswith("unknown variant `?`")]
        words += variants[0] if variants else []
        if not refused:
            types.add(name)
    if value is not None:
        types.add({int: "number", float: "number", str: "string", bool: "boolean", list: "array", dict: "object"}[type(value)])
    # What takes every type is read by rules of its own.
    schema = {} if types == ALL or not types else {"type": sorted(types) if len(types) > 1 else types.pop()}
    if words and schema.get("type") == "string":
        schema = {"enum": sorted(set(words))}
    if schema == {"type": "object"} and value is None:
        # A table that no shipped file has.
        return schema_of_table([(file.changed(place, {}), place, {})])
    if schema.get("type") == "number":
        return with_range(schema, file.fixed_range(place, ABSURD))
    numbers = numbers_of(file, place, value) if isinstance(value, list) and schema.get("type") == "array" else None
    return numbers or schema


def schema_of_table(places):
    """The schema of a table that stands at these places: `(file, place, value)`."""
    known, is_open, values = {}, False, {}
    for file, place, table in places:
        keys = keys_of(file, place)
        is_open |= keys is None
        for key in keys or []:
            known.setdefault(key, (file, [*place, key], None))
        for key, value in table.items():
            values.setdefault(key, []).append((file, [*place, key], value))
    # Keys that no shipped file has.
    properties = {key: schema_of_value(*found) for key, found in known.items() if key not in values}
    for key, found in values.items():
        properties[key] = schema_of(found)
    if is_open and all(isinstance(value, dict) for found in values.values() for _, _, value in found) and values:
        # Tables with names of their own, such as those of clutches.
        return {"type": "object", "additionalProperties": schema_of([one for found in values.values() for one in found])}
    required = sorted(key for key, found in values.items() if has_required(places) and is_required(key, found, len(places)))
    schema = {"type": "object", "properties": dict(sorted(properties.items())), "additionalProperties": is_open}
    return {**schema, "required": required} if required else schema


def has_required(places):
    """Whether what is missing in a file of this kind is not taken: vehicle and gearbox files may be short or of another level."""
    return all(file.path.parent.name not in ("vehicles", "gearboxes") for file, _, _ in places)


def is_required(key, found, tables):
    """Whether a key is in every table, and none can be without it."""
    if len(found) < tables:
        return False
    for file, place, _ in found[:4]:
        [errors] = file.errors(file.without(place))
        if not any(f"missing `{key}`" in error["message"] or f"missing key `{key}`" in error["message"] for error in errors):
            return False
    return True


def schema_of(found):
    tables = [one for one in found if isinstance(one[2], dict)]
    lists = [one for one in found if isinstance(one[2], list) and one[2] and isinstance(one[2][0], dict)]
    others = [one for one in found if one not in tables and one not in lists]
    schemas = []
    if tables:
        schemas.append(schema_of_table(tables))
    if lists:
        items = [(file, [*place, at], item) for file, place, value in lists for at, item in enumerate(value)]
        schemas.append({"type": "array", "items": schema_of(items)})
    if others:
        # One of each type of value.
        kinds = {type(one[2]): one for one in reversed(others)}
        schemas += [schema_of_value(*one) for one in kinds.values()]
    unique = [schema for at, schema in enumerate(schemas) if schema not in schemas[:at]]
    # What takes anything takes the others too; that with a description first.
    anything = sorted((schema for schema in unique if not schema.keys() - {"description"}), key=len, reverse=True)
    return anything[0] if anything else unique[0] if len(unique) == 1 else {"anyOf": unique}


def fits(schema, value):
    """Whether a value fits a schema of the forms above."""
    if "anyOf" in schema:
        return any(fits(one, value) for one in schema["anyOf"])
    if "enum" in schema:
        return value in schema["enum"]
    if "type" not in schema:
        return True
    name = {bool: "boolean", int: "number", float: "number", str: "string", list: "array", dict: "object"}[type(value)]
    if name not in ([schema["type"]] if isinstance(schema["type"], str) else schema["type"]):
        return False
    if name == "number":
        return schema.get("minimum", value) <= value <= schema.get("maximum", value)
    if isinstance(value, list):
        return all(fits(schema.get("items", {}), item) for item in value)
    if isinstance(value, dict):
        if any(key not in value for key in schema.get("required", [])):
            return False
        other = schema.get("additionalProperties", True)
        of = lambda key: schema.get("properties", {}).get(key, other)
        return all(of(key) is True or (of(key) is not False and fits(of(key), item)) for key, item in value.items())
    return True


def write_parts():
    """Files of the kinds of which none is shipped, from parts of those that are."""
    for path in (WORK / "experiments").glob("*.toml"):
        table = tomllib.loads(path.read_text())
        if "sensors" in table and "shift" in table:
            sensors = {**table["sensors"], "acceleration": {"noise_m_s2": 0.05}}
            path.with_name(f"sensors_of_{path.name}").write_text(f"sensors = {toml(sensors)}\n")
    for path in (WORK / "vehicles").glob("two_speed*.toml"):
        parts = {key: of for key, of in tomllib.loads(path.read_text()).items() if isinstance(of, dict) and key != "gear_train"}
        path.with_name(f"part_of_{path.name}").write_text("".join(f"{key} = {toml(of)}\n" for key, of in parts.items()))
    # A car with a lock-up clutch, which stands in comments of the shipped file, and with bounds of one element.
    car = (WORK / "vehicles" / "eight_speed.toml").read_text()
    begin, end = car.index("# [lock_up]"), car.index("[hydraulics]")
    lock_up = re.sub("(?m)^# ", "", car[begin:end])
    more = "[clutch.A]\ndrag_n_m = 1.0\n[clutch.A.error_bounds]\nfriction_factor = [0.9, 1.1]\n"
    (WORK / "vehicles" / "more_of_eight_speed.toml").write_text(f"{car[:begin]}{lock_up}{car[end:]}\n{more}")
    # Cars with other valves and with all bounds of an element.
    bounds = "friction_factor = [0.9, 1.1]\nvalve_lag_factor = [0.8, 1.2]\nvalve_gain_factor = [0.9, 1.1]\nvalve_delay_s = [0.0, 0.03]\n"
    duty = re.search(r"(?ms)^\[clutch\.b\.valve\].*?(?=^\[)", (WORK / "vehicles" / "two_speed_pwm.toml").read_text()).group(0)
    duty = re.sub(r"(?m)^\[.*\]$", "[valve]", duty, count=1)
    (WORK / "vehicles" / "pwm_of_eight_speed.toml").write_text(
        f"name = \"c\"\ngearbox = \"../gearboxes/8hp.toml\"\nhydraulics = {{ line_pressure_pa = 1.0e6 }}\n{duty}\n[clutch.A.error_bounds]\nduty_percent = 1.0\n"
    )
    (WORK / "vehicles" / "bounds_of_eight_speed.toml").write_text(
        f"name = \"c\"\ngearbox = \"../gearboxes/8hp.toml\"\n[clutch.A.error_bounds]\ncurrent_a = 0.01\nvalve_hysteresis_pa = 1e4\n{bounds}"
        "[clutch.A.friction]\nslip_rad_s = [0.0, 10.0]\ncoefficient = [0.12, 0.13]\n"
    )
    # Drives and studies with sensors, and with every fault.
    bench = tomllib.loads((WORK / "experiments" / "bench.toml").read_text())
    sensors = f"sensors = {toml({**bench['sensors'], 'acceleration': {'noise_m_s2': 0.05}})}\n"
    faults = [
        {"kind": "weak-clutch", "element": "A", "friction_factor": 0.5},
        {"kind": "stuck-solenoid", "element": "A", "command": 0.5},
        {"kind": "swapped-solenoids", "elements": ["A", "B"]},
        {"kind": "leaking-piston", "element": "A", "pressure_fraction": 0.5},
        {"kind": "aeration", "lag_factor": 3.0},
        {"kind": "line-pressure", "pressure_pa": 8e5},
        {"kind": "wrong-fluid", "friction_factor": 0.7},
        {"kind": "glazed-plates", "element": "A", "friction_factor": 0.5},
        {"kind": "speed-sensor", "sensor": "turbine", "reading": "zero"},
    ]
    for at, fault in enumerate(faults):
        city = tomllib.loads((WORK / "drives" / "city.toml").read_text())
        city["fault"] = [{**fault, "from_s": 10.0}]
        (WORK / "drives" / f"fault_{at}_of_city.toml").write_text("".join(f"{key} = {toml(of)}\n" for key, of in city.items()))
    (WORK / "drives" / "sensors_of_city.toml").write_text(sensors + (WORK / "drives" / "city.toml").read_text())
    (WORK / "drives" / "list_of_city.toml").write_text(
        "name = \"d\"\nstart = { gear = \"1\", vehicle_m_s = 3.0 }\nshift = [{ time_s = 3.0, gear = \"2\" }]\n"
        "[[segment]]\nduration_s = 6\nthrottle = [0.1, 0.2]\nbrake = [0.0, 0.1]\ngrade_rad = [0.0, 0.01]\n"
    )
    study = (WORK / "experiments" / "eight_speed_ftp_75.toml").read_text()
    (WORK / "experiments" / "sensors_of_study.toml").write_text(sensors + study)
    learnt = {"gearbox": "8hp", "elements": ["A"], "shifts": 3, "refused": 0, "oil_temperature_degc": 80.0, "mean": [0.0], "covariance": [[1.0]]}
    (WORK / "vehicles" / "learnt.toml").write_text("".join(f"{key} = {toml(of)}\n" for key, of in learnt.items()))


def main():
    shutil.rmtree(WORK, ignore_errors=True)
    for folder in FOLDERS:
        shutil.copytree(ROOT / folder, WORK / folder)
    write_parts()
    paths = [path for folder in FOLDERS for path in sorted((WORK / folder).glob("*.toml"))]
    files = {kind: [] for kind in KINDS}
    for path, found in zip(paths, check(*map(str, paths))):
        if found["describes"] in files and not found["errors"]:
            files[found["describes"]].append(File(path))
    stale = []
    for kind, (name, title) in KINDS.items():
        schema = {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": title,
            **schema_of_table([(file, [], file.root) for file in files[kind]]),
        }
        for file in files[kind]:
            if not fits(schema, file.root):
                sys.exit(f"{file.path.name} does not fit the schema of {name}")
            if fits(schema, {**file.root, UNKNOWN: 1}):
                sys.exit(f"the schema of {name} takes a key that does not exist")
        path, text = ROOT / "docs" / "schemas" / f"{name}.json", json.dumps(schema, indent=2) + "\n"
        if "--check" not in sys.argv:
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
        elif not path.exists() or path.read_text() != text:
            stale.append(f"docs/schemas/{name}.json is stale: run `python3 .ci/schemas.py target/release/wetclutch`")
    if stale:
        sys.exit("\n".join(stale))


main()
