"""What the methods are built of: Gaussian process, scale, acquisition and search. Nothing here knows a robot."""
