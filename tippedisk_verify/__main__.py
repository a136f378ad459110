"""``python -m tippedisk_verify`` and the console script: the command line, with an answer to Ctrl-C from the start."""

from tippedisk_verify.interrupts import answer_interrupts, answer_no_more


def entry() -> None:
    """Run the command line and end the process with its exit status."""
    answer_interrupts()
    try:
        from tippedisk_verify.cli import entry as run

        run()
    finally:
        answer_no_more()


if __name__ == "__main__":
    entry()
