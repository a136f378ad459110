"""``python -m tippedisk_verify`` is the command line."""

import os
import signal


def _early(number: int, frame: object) -> None:
    """Ctrl-C while the command line is still being imported: nothing has begun, so nothing is to be ended."""
    os.write(2, b"tippedisk-verify: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, _early)

    from tippedisk_verify.cli import entry

    entry()
