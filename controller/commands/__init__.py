"""The commands of `vvvaltr`, one file each: its arguments, and what it does with them."""
