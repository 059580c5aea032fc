"""Writes the parts of the program as CycloneDX 1.5, from what Cargo knows: `release/parts.py TARGET`.

Crates of tests and of the build alone are not in the program and left out; the sums are those of Cargo.lock.
"""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = "wetclutch-cli"


def main():
    cargo = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", sys.argv[1]]
    metadata = json.loads(subprocess.run(cargo, cwd=ROOT, check=True, capture_output=True).stdout)
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text())
    sums = {(package["name"], package["version"]): package.get("checksum") for package in lock["package"]}

    macros = {of for of, package in packages.items() if any("proc-macro" in target["kind"] for target in package["targets"])}

    def linked(node):
        """What a crate links: not what only its tests or its build need, as a macro does."""
        deps = nodes[node]["deps"]
        used = {dep["pkg"] for dep in deps if any(kind["kind"] is None for kind in dep["dep_kinds"])}
        return sorted(used - macros)

    root = next(of for of, package in packages.items() if package["name"] == PROGRAM)
    parts, waiting = set(), [root]
    while waiting:
        part = waiting.pop()
        if part not in parts:
            parts.add(part)
            waiting += linked(part)

    def purl(part):
        return f"pkg:cargo/{packages[part]['name']}@{packages[part]['version']}"

    def component(part, kind):
        package = packages[part]
        shown = {"type": kind, "bom-ref": purl(part), "name": package["name"], "version": package["version"], "purl": purl(part)}
        if package["license"]:
            # An old form of `OR`.
            shown["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
        if checksum := sums.get((package["name"], package["version"])):
            shown["hashes"] = [{"alg": "SHA-256", "content": checksum}]
        return shown

    others = sorted(parts - {root}, key=purl)
    document = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": component(root, "application")},
        "components": [component(part, "library") for part in others],
        "dependencies": [{"ref": purl(part), "dependsOn": [purl(dep) for dep in linked(part)]} for part in [root, *others]],
    }
    print(json.dumps(document, indent=2))


main()
