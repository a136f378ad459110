"""``python -m tippedisk_verify`` is the command line."""

from tippedisk_verify.cli import entry

entry()
