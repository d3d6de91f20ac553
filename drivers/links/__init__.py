"""How bytes and frames travel, whatever they mean: serial lines, CAN buses, and the clocks at their far ends."""
