"""Learning as pure mathematics: Gaussian processes, acquisition, and transfer between conditions."""
