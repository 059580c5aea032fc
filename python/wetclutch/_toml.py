"""Files in TOML: keys that are replaced, and tables as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ._errors import InputError


def replaced(text: str, values: Mapping[str, Any] | None, keys: Mapping[str, Any]) -> str:
    """The text of a file with other values of its keys; in `keys` two underscores stand for the dot."""
    import tomllib

    table = tomllib.loads(text)
    if values is not None and not isinstance(values, Mapping):
        raise InputError(f"a {type(values).__name__} is no mapping from keys to values", hint='give {"vehicle.mass_kg": 1900.0}')
    for key, value in {**(values or {}), **{key.replace("__", "."): value for key, value in keys.items()}}.items():
        if not isinstance(key, str):
            raise InputError(f"{key!r} is no key", hint='give words, such as "vehicle.mass_kg"')
        parts = key.split(".")
        at = table
        for part in parts[:-1]:
            at = at.setdefault(part, {})
            if not isinstance(at, dict):
                raise InputError(f"`{key}`: `{part}` is no table of the file", key=key)
        try:
            _value(value)
        except InputError as error:
            raise InputError(f"`{key}`: {error.message}", hint=error.hint, key=key) from None
        at[parts[-1]] = value
    return toml(table)


def leaves(table: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """The keys of a table that are no tables themselves, with their values."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def without(name: str, table: Mapping[str, Any]) -> dict[str, Any]:
    """A table without the tables of this name in it."""
    kept = {key: value for key, value in table.items() if key != name}
    return {key: without(name, value) if isinstance(value, dict) else value for key, value in kept.items()}


def toml(table: Mapping[str, Any], path: str = "") -> str:
    """A table as text."""
    plain = {key: value for key, value in table.items() if not isinstance(value, dict)}
    lines = [f"{_key(key)} = {_value(value)}\n" for key, value in plain.items()]
    if path and (lines or not table):
        lines.insert(0, f"\n[{path}]\n")
    for key, value in table.items():
        if isinstance(value, dict):
            lines.append(toml(value, f"{path}.{_key(key)}" if path else _key(key)))
    return "".join(lines)


def _key(key: str) -> str:
    is_plain = key.isascii() and key.replace("_", "").replace("-", "").isalnum()
    return key if is_plain else _value(key)


def _value(value: Any) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case int():
            return str(value)
        case float():
            # A float of NumPy has another one.
            return float.__repr__(value)
        case str():
            escaped = value.replace("\\", "\\\\").replace('"', '\\"')
            return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
        case list() | tuple():
            return "[" + ", ".join(_value(item) for item in value) + "]"
        case dict():
            return "{ " + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + " }"
        case _ if hasattr(value, "tolist"):
            # Of NumPy.
            return _value(value.tolist())
        case _:
            raise InputError(f"a {type(value).__name__} is no value of a file in TOML")
