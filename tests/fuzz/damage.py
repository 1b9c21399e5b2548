"""Hostile texts and numbers, and how a text or a tree of JSON is damaged with them."""

from __future__ import annotations

import random
import re
from typing import Any

HOSTILE = (
    *("WO[/b]", "[link=http://x]a[/link]", "[conceal]x", "[/]", "[red]", "\x1b[2J", "\x1b]0;t\x07"),
    *("\x9b31m", "\u202eabc", "=HYPERLINK(1)", "x;=1+1", "'; __import__('os')", "a\nb"),
    *("{{ 7*7 }}", "</script>", "<img onerror=x>", "\x00", "\ud800", "../../etc/x", "/", "\\", '"'),
    *("'", "%s%n", "\u200b" * 50, "x" * 5000, "", " ", "\u2028", "\U000e0001", "nan", "NaN"),
    *("_xD800_", "1" * 5000, "\u0301" * 9000),
)
NUMBERS = (
    *("nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "0", "-1", "true", "false", '"0.003"'),
    *("[]", "[[[[[[]]]]]]", "{}", "9" * 5000, "1_000", "0x10", "0x" + "f" * 5000, "'x'"),
    *("2026-01-01", "[1, 2, 3]"),
    *("[nan, nan]", "-0.0", "0.5", "1000000", "1.0e99"),
)


def damaged(text: str, rng: random.Random) -> bytes:
    """The text with a few values, names or bytes exchanged."""
    for _ in range(rng.choice((0, 1, 1, 1, 2, 3))):
        what = rng.random()
        if what < 0.4:
            text = _exchanged(text, r"(?<=[= \[,:])-?\d+\.?\d*", rng.choice(NUMBERS), rng)
        elif what < 0.75:
            text = _exchanged(text, r"[A-Za-z_][\w-]{1,20}", rng.choice(HOSTILE), rng)
        elif what < 0.9:
            lines = text.split("\n")
            place = rng.randrange(len(lines))
            lines[place : place + rng.randint(0, 2)] = rng.sample(lines, min(2, len(lines)))
            text = "\n".join(lines)
        else:
            place = rng.randrange(len(text) + 1)
            text = (
                text[:place]
                + rng.choice(("[" * 5000, "\x00", "\ufeff", "a.b" * 200, text[:200]))
                + text[place:]
            )
    data = bytearray(text.encode("utf-8", "surrogatepass"))
    if rng.random() < 0.1 and data:
        data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data)


def _exchanged(text: str, pattern: str, new: str, rng: random.Random) -> str:
    found = list(re.finditer(pattern, text))
    if not found:
        return text
    match = rng.choice(found)
    return text[: match.start()] + new + text[match.end() :]


def damaged_tree(tree: Any, rng: random.Random) -> Any:
    """The JSON with one value, name or branch exchanged."""
    place = tree
    while isinstance(place, dict | list) and place:
        keys = list(place) if isinstance(place, dict) else range(len(place))
        key = rng.choice(list(keys))
        if not isinstance(place[key], dict | list) or not place[key] or rng.random() < 0.3:
            _exchange(place, key, rng)
            return tree
        place = place[key]
    return rng.choice(WRONG)


def _exchange(place: Any, key: Any, rng: random.Random) -> None:
    what = rng.random()
    if what < 0.6:
        place[key] = rng.choice(WRONG)
    elif what < 0.8:
        del place[key]
    elif isinstance(place, dict):
        place[rng.choice(HOSTILE)] = place.pop(key)
    else:
        place.append(place[key])


def _nested(depth: int) -> list[Any]:
    inner: list[Any] = []
    for _ in range(depth):
        inner = [inner]
    return inner


# What stands in a tree of JSON instead of what belongs there.
WRONG = (
    *(
        None,
        True,
        "",
        "x",
        "nan",
        "N\x1b[2J",
        "\ud800",
        "x" * 5000,
        [],
        {},
        [[]],
        {"x": 1},
        [None] * 50,
    ),
    *(
        *(0, -1, -5.0, 99, 1e300, -1e300, 1e-320, 10**400, "1e308", "9999-99-99", "0001-01-01"),
        *("LH", _nested(400)),
    ),
)
