"""``python -m tippedisk_verify`` is the command line."""

import sys

from tippedisk_verify.cli import main

sys.exit(main())
