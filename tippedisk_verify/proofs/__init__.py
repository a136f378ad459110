"""Proofs in ball arithmetic: closed forms, limit cycles and the heteroclinic connection.

The package imports `model`, numpy and python-flint only. Importing it raises InputError if
python-flint is not installed.
"""

import sys

from tippedisk_verify.errors import InputError

try:
    import flint  # noqa: F401
except ImportError:
    _LACKING = "proofs need python-flint: pip install '.[certify]'"
    # What Python imports for `python -m tippedisk_verify.proofs.kernel`, before it runs it
    if sys.argv[:1] == ["-m"]:
        print(_LACKING, file=sys.stderr)
        sys.exit(2)
    raise InputError(_LACKING) from None
