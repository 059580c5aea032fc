"""Writes the pages of the Python and the Rust interface from their sources: `python3 .ci/api.py PAGES`, the folder of the pages of the site."""

import ast
import re
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def section(name, parts):
    """A section with all of one name, without colours: they take more bytes than the text."""
    return f"## `{name}`\n\n````text\n" + "\n\n".join(parts) + "\n````\n"


def signature(node):
    """The head of a function or a class, as Python writes it."""
    head = type(node)(**{field: getattr(node, field, None) for field in node._fields})
    head.body, head.decorator_list = [ast.Expr(ast.Constant(...))], []
    return ast.unparse(ast.fix_missing_locations(head)).removesuffix("...").strip().removesuffix(":")


def lines_of(text):
    """Lines of documentation of Rust as text."""
    return "\n".join(line.strip().removeprefix("///").removeprefix(" ") for line in text.splitlines())


# Lines of documentation, attributes, and the name of a class or a method that is written in Rust.
NATIVE = re.compile(r"((?:^ *///.*\n)+)(?:^ *#\[(?:[^\]]|\](?!\n))*\]\n)*^( *)(?:pub\(crate\) )?(?:struct|fn) (\w+)", re.M)


def native_texts():
    """The texts of the classes and methods that are written in Rust; a method has the name of the class of its file."""
    texts = {}
    for path in sorted((ROOT / "python" / "src").glob("*.rs")):
        source = path.read_text(encoding="utf-8")
        for text, indent, name in re.findall(NATIVE, source):
            texts.setdefault(f"{path.stem}.{name}" if indent else name, lines_of(text))
        for name in re.findall(r"#\[pyclass.*?struct (\w+)", source, re.S):
            texts.update({f"{name}.{key.split('.')[1]}": text for key, text in texts.items() if key.startswith(f"{path.stem}.")})
    return texts


def documented(node, name, native, indent=""):
    """Head and text of a definition; nothing where it has no text."""
    text = ast.get_docstring(node) or native.get(name)
    return [textwrap.indent(f"{signature(node)}\n{textwrap.indent(text.strip(), '    ')}", indent)] if text else []


def is_public(node):
    return isinstance(node, ast.FunctionDef) and not node.name.startswith("_")


def python_page():
    package = ROOT / "python" / "wetclutch"
    names = ast.literal_eval(re.search(r"__all__ = (\[.*?\])", (package / "__init__.py").read_text(encoding="utf-8"), re.S)[1])
    found, native = {}, native_texts()
    for path in [*sorted(package.glob("_*.py")), package / "_wetclutch.pyi"]:
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            # Of an overloaded function the last definition has the text.
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name in names and (ast.get_docstring(node) or node.name in native):
                found[node.name] = node
    missing = [name for name in names if name not in found and name != "__version__"]
    if missing:
        sys.exit(f"no text of {', '.join(missing)} in python/wetclutch")
    lines = ["# Python interface\n", "The package `wetclutch`, by its sources. How to use it: [from Python](../how-to/use-from-python.md).\n"]
    for name, node in sorted(found.items(), key=lambda entry: entry[0].lower()):
        parts = documented(node, name, native)
        for method in filter(is_public, node.body if isinstance(node, ast.ClassDef) else []):
            parts += documented(method, f"{name}.{method.name}", native, "    ")
        lines.append(section(name, parts))
    return lines


# Lines of documentation, attributes, and the head of an item up to its body.
ITEM = re.compile(r"((?:^ *///.*\n)+)(?:^ *#\[[^\n]*\n)*^( *)pub (fn|struct|enum|trait|type) (\w+)([^{;]*)", re.M)


def rust_items(path):
    """Name, head and text of the items of a file; of a method with the name of its type."""
    source = path.read_text(encoding="utf-8").split("#[cfg(test)]")[0]
    for match in ITEM.finditer(source):
        text, indent, kind, name, rest = match.groups()
        of = re.findall(r"^impl(?:<[^>]*>)? (?:\w+ for )?(\w+)", source[: match.start()], re.M)
        owner = f"{of[-1]}::" if indent and of else ""
        yield owner + name, f"pub {kind} {name}{rest.rstrip()}", lines_of(text)


def rust_page():
    crates = ROOT / "crates"
    used = re.findall(r"^pub use (::)?(\w+)::([^;]+);", (crates / "wetclutch" / "src" / "lib.rs").read_text(encoding="utf-8"), re.M)
    lines = [
        "# Rust interface\n",
        "The crate `wetclutch`, by its sources; `cargo doc -p wetclutch --open` has all types in full. Quantities are in SI units, and names end in their unit.\n",
    ]
    found = {}
    for outside, module, names in used:
        own = not outside and any((crates / "wetclutch" / "src" / name).exists() for name in (module, f"{module}.rs"))
        exported = set(re.findall(r"\w+", names))
        for path in sorted((crates / ("wetclutch" if own else module) / "src").rglob("*.rs")):
            for name, head, text in rust_items(path):
                if name.split("::")[0] in exported:
                    found.setdefault(name, (head, text))
    if len(found) < 60:
        sys.exit(f"{len(found)} items of the crate found: are they written as before?")
    for name in sorted({name.split("::")[0] for name in found}, key=str.lower):
        own = [entry for key, entry in sorted(found.items()) if key.split("::")[0] == name]
        lines.append(section(name, [f"{head}\n{textwrap.indent(text, '    ')}" for head, text in own]))
    return lines


def main(pages):
    for name, lines in [("python-api", python_page()), ("rust-api", rust_page())]:
        (pages / "reference" / f"{name}.md").write_text("\n".join(lines), encoding="utf-8")


main(Path(sys.argv[1]))
