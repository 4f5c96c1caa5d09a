"""`python -m lighting` is the command line."""

from lighting.cli import main

if __name__ == "__main__":
    main()
