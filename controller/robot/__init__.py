"""From a name or a robot's file to an open robot, and the mock devices that stand in for one."""
