"""Levels 6 to 10: whether orbits and cycles are those of a mended program, and the method that an orbit's errors show."""

from __future__ import annotations

from typing import Any

from tippedisk_verify.conformance.diagnosis.entries import Table

__all__ = ["method", "motions"]


def motions(table: Table, definitions: dict[str, Any]) -> None:
    pass


def method(table: Table, definitions: dict[str, Any]) -> str:
    return ""
