"""Parts shared by all mock devices: the port, the fault script, the twin that the motors move."""
