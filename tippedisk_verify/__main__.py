"""The command line as ``python -m tippedisk_verify`` and as the console script.

Ctrl-C is answered from the first moment, before anything else is imported.
"""

from tippedisk_verify.support.interrupts import handle_ctrl_c


def entry() -> None:
    """Run the command line and end the process with its exit status."""
    with handle_ctrl_c():
        from tippedisk_verify.cli import entry as run

        run()


if __name__ == "__main__":
    entry()
