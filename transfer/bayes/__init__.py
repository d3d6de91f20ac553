"""What the methods are built of: the Gaussian process, its scale, acquisition and search; knows no robot."""
