"""The log's messages and the MCAP file that holds them."""
