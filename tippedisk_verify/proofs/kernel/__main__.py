"""``python -m tippedisk_verify.proofs.kernel FILE``: checks a certificate of ``certify ... --certificate FILE``.

Exit status 0: proved; 1: not proved, and the line says what fails; 2: no certificate can be read.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from io import TextIOWrapper

from tippedisk_verify.proofs.kernel.certificates import Refused, Unproved, check


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the one file named; returns the exit status."""
    named = sys.argv[1:] if arguments is None else list(arguments)
    try:
        if len(named) != 1:
            raise Refused("give the name of one certificate")
        print(f"proved: {check(named[0])}")
    except Refused as fault:
        print(f"no certificate: {fault}"[:1000], file=sys.stderr)
        return 2
    except Unproved as fault:
        print(f"not proved: {fault}"[:1000], file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal or a locale that cannot show a character
    sys.exit(main())
