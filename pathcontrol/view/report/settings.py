"""The configuration of runs as a table a person can read, what differs between them marked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

_ELSEWHERE = ("versions", "experiment")  # told where it says how to make the run again
_MOST_VALUES, _MOST_LETTERS, _MOST_KINDS = 12, 160, 3
_ABSENT = "–"


class Setting(NamedTuple):
    """One setting of all runs."""

    name: str
    values: tuple[str, ...]

    @property
    def differs(self) -> bool:
        """Whether the runs do not all have the same."""
        return len(set(self.values)) > 1


class Group(NamedTuple):
    """Settings that belong together."""

    title: str
    settings: tuple[Setting, ...]


def settings(configs: Sequence[Mapping[str, Any]]) -> list[Group]:
    """The settings of all runs by what they are about: controller, path, plant, loop and the rest."""
    said = [dict(_said(config)) for config in configs]
    titles = dict.fromkeys(title for one in said for title, _ in one)
    return [Group(title, tuple(_of(title, said))) for title in titles]


def _of(title: str, said: Sequence[Mapping[tuple[str, str], str]]) -> Iterator[Setting]:
    for key in dict.fromkeys(key for one in said for key in one if key[0] == title):
        yield Setting(key[1], tuple(one.get(key, _ABSENT) for one in said))


def _said(config: Mapping[str, Any]) -> Iterator[tuple[tuple[str, str], str]]:
    """((group, name), text) of each setting."""
    for name, value in config.items():
        if name in _ELSEWHERE:
            continue
        if not isinstance(value, Mapping):
            yield ("simulation", name), text(value)
            continue
        laws = value["sequence"] if _are_tables(value.get("sequence")) else [value]
        paths = [law["task"] for law in laws if isinstance(law.get("task"), Mapping)]
        left = [{key: item for key, item in law.items() if key != "task" or not paths} for law in laws]
        own = _together(left) if value not in laws else _flat(left[0])
        yield from (((name, key), said) for key, said in own)
        yield from ((("path", key), said) for key, said in (_flat(paths[0]) if len(paths) == 1 else _together(paths)))


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, str]]:
    """(name, text) of what is in a value, names of nested values joined."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(item, _joined(name, key))
    elif _are_tables(value):
        yield from _listed(value, name)
    else:
        yield name, text(value)


def _listed(items: Sequence[Mapping[str, Any]], name: str) -> Iterator[tuple[str, str]]:
    """A list of tables: by their names where these differ, as the terms of friction, else what all of them say."""
    names = [str(next(iter(item.values()), "")) for item in items]
    if len(set(names)) == len(items) <= _MOST_VALUES:
        for own, item in zip(names, items, strict=True):
            yield from _flat(dict(list(item.items())[1:]), _joined(name, own))
    else:
        yield from _together(items, name)


def _together(items: Sequence[Mapping[str, Any]], name: str = "") -> Iterator[tuple[str, str]]:
    """How many tables there are, and what they say: once where they agree, else the first few and how many differ."""
    if items:
        yield _joined(name, "number"), str(len(items))
    said: dict[str, dict[str, None]] = {}
    for item in items:
        for key, value in _flat(item, name):
            said.setdefault(key, {})[value] = None
    for key, values in said.items():
        some = " | ".join(list(values)[:_MOST_KINDS])
        yield key, some if len(values) <= _MOST_KINDS else f"{some} | … ({len(values)} different)"


def _are_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, Mapping) for item in value)


def _joined(name: str, key: Any) -> str:
    return f"{name} · {key}" if name else str(key)


def text(value: Any) -> str:
    """A value in a few words."""
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
