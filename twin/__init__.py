"""The robot as physics: bodies, worlds, and the engines that move them."""
