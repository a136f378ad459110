"""What is proved: closed forms, limit cycles and the heteroclinic connection in ball arithmetic.

Imports `model` and python-flint only. Raises InputError where python-flint is not installed.
"""

from tippedisk_verify.errors import InputError

try:
    import flint  # noqa: F401
except ImportError:
    raise InputError("proofs need python-flint: pip install '.[certify]'") from None
