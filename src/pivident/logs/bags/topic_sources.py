"""The sources of one topic: messages that contradict each other come from different publishers.

A driver sends positions, speeds and efforts; beside it a node for a display sends positions of the
same joints, often zeros, in an order of its own. A bag does not say who sent a message. Messages
with the same columns in the same order are taken for one source. Two of these are separate where
they fill other arrays of the same joint, or say other values of it; joints that come in turns, or
that change places, are not.
"""

from __future__ import annotations

import warnings
from collections import defaultdict
from collections.abc import Sequence
from itertools import chain

import numpy as np

from pivident.text.lists import listed, plural

#: Columns of messages of one structure, their rows in the topic, numbers, and stamps or None.
Part = tuple[tuple[str, ...], np.ndarray, np.ndarray, np.ndarray | None]

#: Share of the messages of the largest source from which on another can be the one that is used.
SUBSTANTIAL = 0.05

#: Median difference of two sources that agree, as share of the range of their values.
AGREE = 0.05

#: Most sources that are compared; messages that are built in more ways are left together.
MAX_SOURCES = 32


def one_source(parts: Sequence[Part], received: np.ndarray) -> tuple[list[Part], str]:
    """The parts without what contradicts a better source, and what was left out in words.

    Args:
        parts: of one topic.
        received: when each message was received, shape (messages,) [ns].
    """
    sources: dict[tuple[str, ...], list[Part]] = defaultdict(list)
    for part in parts:
        sources[part[0]].append(part)
    if not 1 < len(sources) <= MAX_SOURCES:
        return list(parts), ""
    sizes = {names: sum(len(part[1]) for part in own) for names, own in sources.items()}
    few = SUBSTANTIAL * max(sizes.values())

    def merit(names: tuple[str, ...]) -> tuple[bool, int, int]:
        changing = _fields(_changing(sources[names]))
        return sizes[names] >= few, len(changing), sizes[names] * len(names)

    taken: list[list[Part]] = []
    left_out: list[str] = []
    for names in sorted(sources, key=merit, reverse=True):
        others = [own for own in taken if not _alike(own, sources[names], received)]
        rest = [k for k, name in enumerate(names) if not any(name in own[0][0] for own in others)]
        if len(rest) < len(names):
            what = listed(sorted(_fields(names)), 4)
            left_out.append(f"{sizes[names]} ({what} of {plural(_joints(names), 'joint')})")
        if rest:
            own = tuple(names[k] for k in rest)
            taken.append([(own, rows, x[:, rest], t) for _, rows, x, t in sources[names]])
    if not left_out:
        return list(parts), ""
    return list(chain.from_iterable(taken)), (
        f"{listed(left_out, 4)} of {len(received)} messages come from other sources of the same "
        "joints and are left out"
    )


def _changing(parts: Sequence[Part]) -> list[str]:
    """The columns whose finite values are not all the same."""
    names, numbers = parts[0][0], [numbers for _, _, numbers, _ in parts]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a column may have no number at all
        low = np.nanmin([np.nanmin(x, axis=0) for x in numbers], axis=0)
        high = np.nanmax([np.nanmax(x, axis=0) for x in numbers], axis=0)
    return [name for name, changes in zip(names, low < high, strict=True) if changes]


def _fields(names: Sequence[str]) -> set[str]:
    """The arrays that are filled."""
    return {name.rpartition("/")[0] or name for name in names}


def _joints(names: Sequence[str]) -> int:
    return len({name.rpartition("/")[2] for name in names})


def _alike(first: Sequence[Part], second: Sequence[Part], received: np.ndarray) -> bool:
    """Whether two sources fill the same arrays of the joints that both have, with values alike."""
    one, other = first[0][0], second[0][0]
    shared = sorted(set(one) & set(other))
    joints = {name.rpartition("/")[2] for name in shared}
    if any(n.rpartition("/")[2] in joints for n in set(one) ^ set(other)):
        return False
    agreeing = 0
    for name in shared:
        (t, x), (s, y) = (_values(parts, name, received) for parts in (first, second))
        if not (t.size and s.size):
            agreeing += 1
            continue
        span = max(float(x.max()), float(y.max())) - min(float(x.min()), float(y.min()))
        agreeing += float(np.median(np.abs(np.interp(s, t, x) - y))) <= AGREE * span
    return 2 * agreeing >= len(shared)


def _values(
    parts: Sequence[Part], name: str, received: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Times and finite values of a column, in the order of time."""
    t = np.concatenate([received[rows] for _, rows, _, _ in parts]).astype(float)
    x = np.concatenate([numbers[:, names.index(name)] for names, _, numbers, _ in parts])
    order = np.argsort(t, kind="stable")
    order = order[np.isfinite(x[order])]
    return t[order], x[order]
