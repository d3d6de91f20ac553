"""Learning: Gaussian processes, Bayesian optimisation and transfer between conditions."""
