"""Proofs in ball arithmetic: closed forms, limit cycles and the heteroclinic connection.

The package imports `numbers`, `display`, `model`, numpy and python-flint only. Importing it raises
InputError if python-flint is not installed.

A *claim* of a certificate is the statement that it proves. The paper's claims are in `audit`.
"""

import sys

from tippedisk_verify.errors import InputError

try:
    import flint  # noqa: F401
except ImportError:
    _LACKING = "proofs need python-flint: pip install '.[certify]'"
    # `python -m tippedisk_verify.proofs.kernel` imports this package before it runs the kernel
    if sys.argv[:1] == ["-m"]:
        print(_LACKING, file=sys.stderr)
        sys.exit(2)
    raise InputError(_LACKING) from None
