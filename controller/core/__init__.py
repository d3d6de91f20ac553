"""Values, protocols, errors, seeds, clock and files that every room shares; imports nothing above."""
