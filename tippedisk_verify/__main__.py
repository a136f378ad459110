"""``python -m tippedisk_verify`` and the console script: the command line, with an answer to Ctrl-C from the start."""

from tippedisk_verify.interrupts import answering


def entry() -> None:
    """Run the command line and end the process with its exit status."""
    with answering():
        from tippedisk_verify.cli import entry as run

        run()


if __name__ == "__main__":
    entry()
