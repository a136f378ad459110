"""``python -m tippedisk_verify.proofs.kernel FILE`` checks a certificate of ``certify``.

Exit status 0 means proved; 1 not proved, with a line that names the failure; 2 that FILE is not a
readable certificate.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from io import TextIOWrapper

from tippedisk_verify.proofs.kernel.certificates import NotACertificate, Unproved, check


def main(arguments: Sequence[str] | None = None) -> int:
    """Check one certificate file, print what it proves or why it fails, and return the
    exit status.
    """
    named = sys.argv[1:] if arguments is None else list(arguments)
    try:
        if len(named) != 1:
            raise NotACertificate("give the name of one certificate")
        print(f"proved: {check(named[0])}")
    except NotACertificate as fault:
        print(f"not a certificate: {fault}"[:1000], file=sys.stderr)
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
        # A terminal or a locale that cannot show a character
        sys.stdout.reconfigure(errors="replace")
    sys.exit(main())
