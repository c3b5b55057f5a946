"""Damage of files at random: of their bytes, or of the JSON in them."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from typing import Any

JUNK = (
    *(None, True, False, -1, 0, 1, 2**63, 2**64, -(2**63), 10**30, 0.5, -0.0, 1e308, 5e-324, 1e-300),
    *("", "x", "☃", "\x00", "a\nb", "../..", "/dev/full", "water", "x" * 3000, [], [[]], [1, "a", None], {}, {"a": {}}),
    *([0, 0], [1e308, -1e308], list(range(300)), ["water", "water"], {"self": 1}, {"__class__": "x"}, [[[[1]]]]),
)


def twisted(content: bytes, rng: random.Random) -> bytes:
    """Bytes changed, lost, repeated or strewn in."""
    changed = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 8, 64))):
        at, length = rng.randrange(len(changed) + 1), rng.choice((1, 1, 4, 50))
        kind = rng.randrange(5)
        if kind == 0:
            changed[at : at + length] = rng.randbytes(length)
        elif kind == 1:
            del changed[at : at + length]
        elif kind == 2:
            changed[at:at] = rng.randbytes(length)
        elif kind == 3:
            changed[at:at] = changed[at : at + length]
        elif changed:
            changed[at % len(changed)] ^= 1 << rng.randrange(8)
    if rng.random() < 0.1:
        del changed[rng.randrange(len(changed) + 1) :]
    return bytes(changed)


def places(content: Any) -> Iterator[tuple[Any, Any]]:
    """Every container of a JSON value with each of its keys or indices."""
    keys = (
        list(content) if isinstance(content, dict) else list(range(len(content))) if isinstance(content, list) else []
    )
    for key in keys:
        yield content, key
        yield from places(content[key])


def copied(content: Any) -> Any:
    """A JSON value that shares nothing with the original."""
    return json.loads(json.dumps(content))


def changed(content: Any, rng: random.Random) -> Any:
    """A JSON value with some parts replaced, renamed, removed or moved."""
    content = copied(content)
    for _ in range(rng.choice((1, 1, 2, 5))):
        found = list(places(content))
        if not found:
            return copied(rng.choice(JUNK))
        (owner, key), (other, place) = rng.choice(found), rng.choice(found)
        kind = rng.random()
        if kind < 0.6:
            owner[key] = copied(rng.choice(JUNK))
        elif kind < 0.75:
            del owner[key]
        elif kind < 0.85 and isinstance(owner, dict):
            owner[str(rng.choice(JUNK))[:50]] = owner.pop(key)
        else:
            owner[key] = copied(other[place])
    return content
