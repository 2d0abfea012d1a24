"""The configuration of runs as a table for a reader, with differences marked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

_ELSEWHERE = ("versions", "experiment")  # shown where the page says how to make the run again
_MOST_VALUES, _MOST_LETTERS, _MOST_KINDS = 12, 160, 3
_ABSENT = "–"


class Setting(NamedTuple):
    """One setting of all runs."""

    name: str
    values: tuple[str, ...]

    @property
    def differs(self) -> bool:
        """True if the runs do not all have the same."""
        return len(set(self.values)) > 1


class Group(NamedTuple):
    """Settings that belong together."""

    title: str
    settings: tuple[Setting, ...]


def settings(configs: Sequence[Mapping[str, Any]]) -> list[Group]:
    """Return the settings of all runs by subject: controller, path, plant, loop and the rest."""
    said = [dict(_list_settings(config)) for config in configs]
    titles = dict.fromkeys(title for one in said for title, _ in one)
    return [Group(title, tuple(_select_settings(title, said))) for title in titles]


def _select_settings(title: str, said: Sequence[Mapping[tuple[str, str], str]]) -> Iterator[Setting]:
    """Yield the settings of one subject."""
    for key in dict.fromkeys(key for one in said for key in one if key[0] == title):
        yield Setting(key[1], tuple(one.get(key, _ABSENT) for one in said))


def _list_settings(config: Mapping[str, Any]) -> Iterator[tuple[tuple[str, str], str]]:
    """Yield ((group, name), text) of each setting."""
    for name, value in config.items():
        if name in _ELSEWHERE:
            continue
        if not isinstance(value, Mapping):
            yield ("simulation", name), text(value)
            continue
        laws = value["sequence"] if _are_tables(value.get("sequence")) else [value]
        paths = [law["task"] for law in laws if isinstance(law.get("task"), Mapping)]
        left = [{key: item for key, item in _unwrap(law).items() if key != "task" or not paths} for law in laws]
        own = _summarize_tables(left) if value not in laws else _flatten(left[0])
        yield from (((name, key), said) for key, said in own)
        yield from (
            (("path", key), said) for key, said in (_flatten(paths[0]) if len(paths) == 1 else _summarize_tables(paths))
        )


def _unwrap(law: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the settings of a law with those of each wrapper under its name, which may be called the same."""
    wrappers, inside = law.get("wrappers"), law.get("law")
    if not _are_tables(wrappers) or not isinstance(inside, Mapping):
        return law
    kept = {key: law[key] for key in ("controller", "robot", "task") if key in law}
    return {**inside, **kept, "wrappers": wrappers}


def _flatten(value: Any, name: str = "") -> Iterator[tuple[str, str]]:
    """Yield (name, text) of the parts of a value, with names of nested values joined."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flatten(item, _join_names(name, key))
    elif _are_tables(value):
        yield from _list_tables(value, name)
    else:
        yield name, text(value)


def _list_tables(items: Sequence[Mapping[str, Any]], name: str) -> Iterator[tuple[str, str]]:
    """Yield a list of tables, by their names where these differ, as the terms of friction, else in summary."""
    names = [str(next(iter(item.values()), "")) for item in items]
    if len(set(names)) == len(items) <= _MOST_VALUES:
        for own, item in zip(names, items, strict=True):
            yield from _flatten(dict(list(item.items())[1:]), _join_names(name, own))
    else:
        yield from _summarize_tables(items, name)


def _summarize_tables(items: Sequence[Mapping[str, Any]], name: str = "") -> Iterator[tuple[str, str]]:
    """Yield the number of tables, and their entries: once where they agree, else the first few and the count."""
    if items:
        yield _join_names(name, "number"), str(len(items))
    said: dict[str, dict[str, None]] = {}
    for item in items:
        for key, value in _flatten(item, name):
            said.setdefault(key, {})[value] = None
    for key, values in said.items():
        some = " | ".join(list(values)[:_MOST_KINDS])
        yield key, some if len(values) <= _MOST_KINDS else f"{some} | … ({len(values)} different)"


def _are_tables(value: Any) -> bool:
    """Return whether a value is a list of tables."""
    return isinstance(value, list) and bool(value) and all(isinstance(item, Mapping) for item in value)


def _join_names(name: str, key: Any) -> str:
    """Return the name of a nested value."""
    return f"{name} · {key}" if name else str(key)


def text(value: Any) -> str:
    """Return a value in a few words."""
    match value:
        case None:
            return _ABSENT
        case bool():
            return "yes" if value else "no"
        case float():
            return f"{value:.6g}"
        case list() if len(value) > _MOST_VALUES and all(item == value[0] for item in value):
            return f"{text(value[0])} ({len(value)} times)"
        case list() if len(value) > _MOST_VALUES:
            return f"{text(value[0])}, {text(value[1])}, … {text(value[-1])} ({len(value)} values)"
        case list():
            return ("; " if any(isinstance(item, list) for item in value) else ", ").join(map(text, value)) or "none"
    words = str(value)
    return words if len(words) <= _MOST_LETTERS else words[:_MOST_LETTERS] + " …"
