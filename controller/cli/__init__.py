"""What talks to the person: one file for each command of `vvvaltr`."""
