"""What all mock devices share: their port, their faults, the twin that they move."""
