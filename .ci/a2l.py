"""Checks a description for calibration tools: pya2l reads all of it, without a warning, and finds each object in a group.

python3 .ci/a2l.py FILE.a2l
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

path = Path(sys.argv[1])
with tempfile.TemporaryDirectory() as folder:
    tree = Path(folder) / "tree.json"
    command = [Path(sys.executable).parent / "pya2l", "-v", "-c", path, "to_json", "-o", tree]
    said = subprocess.run(command, capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    warnings = [line for line in (said.stdout + said.stderr).splitlines() if "warning" in line.lower()]
    assert not warnings, warnings[:5]
    module = json.loads(tree.read_text())["PROJECT"]["MODULE"][0]


def names(objects):
    return [thing["Name"]["Value"] for thing in objects]


def grouped(kind):
    return [name["Value"] for group in module["GROUP"] for name in group.get(kind, {}).get("Identifier", [])]


parameters, estimates = names(module["CHARACTERISTIC"]), names(module["MEASUREMENT"])
text = path.read_text()
assert len(parameters) == text.count("/begin CHARACTERISTIC ") > 100
assert len(estimates) == text.count("/begin MEASUREMENT ") > 50
assert sorted(grouped("REF_CHARACTERISTIC")) == sorted(set(parameters))
assert sorted(grouped("REF_MEASUREMENT")) == sorted(set(estimates))
addresses = [thing["Address"].get("Value", 0) for thing in module["CHARACTERISTIC"]]
known = sum(int(str(address), 0) != 0 for address in addresses)
print(f"{path.name}: {len(parameters)} parameters and {len(estimates)} estimates, {known} parameters with addresses")
