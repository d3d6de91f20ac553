"""ODrive axes on a CAN bus."""
