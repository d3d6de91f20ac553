"""`python -m vvvaltr`: the same as the `vvvaltr` command."""

from vvvaltr.entry import main

if __name__ == "__main__":
    main()
