"""``python -m tippedisk_verify`` and the console script: the command line, with an answer to Ctrl-C from the start."""

import signal

from tippedisk_verify.interrupts import answer_interrupts


def entry() -> None:
    """Run the command line and end the process with its exit status."""
    answer_interrupts()
    try:
        from tippedisk_verify.cli import entry as run

        run()
    finally:
        # All is done and said. What Python tears down now should neither be cut short nor complain.
        signal.signal(signal.SIGINT, signal.SIG_IGN)


if __name__ == "__main__":
    entry()
