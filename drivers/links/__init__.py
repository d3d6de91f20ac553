"""Transport of bytes and frames, whatever they mean: serial lines, CAN buses, and the clocks of remote devices."""
