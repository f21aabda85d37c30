"""Prefixes for the names of exported files and of what they declare.

This module imports nothing heavy, so that errors in a prefix are instant.
"""

import re

PREFIX = "attjax"
LONGEST = 18
"""With ``_torque_table`` that makes the 31 characters by which C99 tells external names apart."""

KEYWORDS = """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t
    char32_t class co_await co_return co_yield compl concept const const_cast consteval constexpr
    constinit continue decltype default delete do double dynamic_cast else enum explicit export
    extern false float for friend goto if inline int long mutable namespace new noexcept not not_eq
    nullptr operator or or_eq private protected public register reinterpret_cast requires restrict
    return short signed sizeof static static_assert static_cast struct switch template this
    thread_local throw true try typedef typeid typename typeof typeof_unqual union unsigned using
    virtual void volatile wchar_t while xor xor_eq
"""
"""Of C23 and C++20."""


def check(prefix: str) -> str:
    """The prefix as it is, if C and C++ take names of it.

    Only lower case, as macros have the prefix in capitals; no two underscores together, which C++
    keeps for itself.

    Raises:
        ValueError: it is none, or too long.

    Example:
        >>> check("slow_rate")
        'slow_rate'
    """
    is_name = re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", prefix, re.ASCII)
    if not is_name or prefix in KEYWORDS.split() or len(prefix) > LONGEST:
        raise ValueError(
            f"{prefix!r} cannot begin names in C; it must be of a-z, 0-9 and single underscores "
            f"between them, begin with a letter, have at most {LONGEST} characters and be no "
            f"keyword of C or C++"
        )
    return prefix


def renamed(text: str, prefix: str) -> str:
    """Text in which the names that begin with PREFIX begin with another."""
    lower = text.replace(PREFIX + "_", prefix + "_")
    return lower.replace(PREFIX.upper() + "_", prefix.upper() + "_")
