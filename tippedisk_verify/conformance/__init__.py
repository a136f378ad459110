"""The grading of another implementation in digits, with a diagnosis of its mistakes.

- `sheet` writes questions and reads answers.
- `grading` counts digits.
- `diagnosis` finds the fewest changes of the right equations that give the wrong answers.
- `grade_pages` shows the result.
- `gate` decides whether grades pass, and compares them with earlier ones.
- `clients` has programs to copy.
"""

from pathlib import Path

__all__ = ["CLIENTS_FOLDER", "client_text"]

CLIENTS_FOLDER = Path(__file__).resolve().parent / "clients"


def client_text(name: str) -> str:
    """Return the source of a client program, with its further parts appended.

    client.py has the further part client_orbits.py.

    Args:
        name: The name of a file in `CLIENTS_FOLDER`.
    """
    parts = (CLIENTS_FOLDER / name, *sorted(CLIENTS_FOLDER.glob(name.replace(".", "_*."))))
    return "\n\n".join(part.read_text(encoding="utf-8") for part in parts)
