"""`python -m kincompile`: the command line where the script `kincompile` is not on the path."""

from kincompile.cli import main

if __name__ == "__main__":
    main()
