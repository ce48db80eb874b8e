"""Where the command `crosscheck` and `python -m crosscheck` begin.

Workers import what their parent began with, so this file imports nothing: the command line would cost each a second.
"""


def main() -> None:
    """Entry point of the console script."""
    from crosscheck.cli import main as command

    command()


if __name__ == "__main__":
    main()
