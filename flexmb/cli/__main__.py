"""`python -m flexmb.cli`."""

from flexmb.cli import main

if __name__ == "__main__":
    main()
