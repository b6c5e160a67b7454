"""Which key was meant, by what words mean: `viscous_damping` for `damping_n_m_s_rad`."""

import re
from collections.abc import Mapping

# words of one meaning, beside those that the keys' descriptions share with a user's
ALIKE = (
    {"mass", "weight"},
    {"speed", "velocity", "rate", "omega"},
    {"friction", "coulomb", "dry"},
    {"stiffness", "spring"},
    {"damping", "damper", "viscous"},
    {"duration", "time", "length"},
    {"heading", "orientation", "theta", "angle", "yaw"},
    {"latency", "delay"},
    {"width", "track"},
    {"gain", "alpha"},
)
UNITS = frozenset("m s n kg rad m2 s2 v a ohm px hz deg share".split())
IN_NAME, IN_TEXT, ENOUGH = 2.0, 1.0, 2.0  # worth of a word; what a key needs to be suggested


def best_by_meaning(word: str, keys: Mapping[str, str]) -> str:
    """The key that shares most words with one that is unknown; empty: none shares enough.

    Args:
        word: the unknown key.
        keys: key, perhaps within a table, → its description.
    """
    asked = _words(word)
    worth = {key: _worth(asked, key, text) for key, text in keys.items()}
    best = max(worth, key=lambda key: (worth[key], -len(key)), default="")
    return best if best and worth[best] >= ENOUGH else ""


def _worth(asked: set[str], key: str, text: str) -> float:
    name, described = _words(key.rpartition(".")[2]), _words(text)
    return sum(
        IN_NAME if _means(word, name) else IN_TEXT * _means(word, described) for word in asked
    )


def _means(word: str, others: set[str]) -> bool:
    if word in others:
        return True
    return any(word in alike and alike & others for alike in ALIKE)


def _words(text: str) -> set[str]:
    """Lower-case words without units and numbers."""
    found = re.findall(r"[a-z]+[0-9]?", text.lower())
    return {word.rstrip("0123456789") for word in found if word not in UNITS}
