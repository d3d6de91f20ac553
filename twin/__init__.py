"""The robot as physics: bodies, worlds, and the engines that move them. Nothing here knows a task or a score."""
