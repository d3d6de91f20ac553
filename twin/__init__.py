"""The interchangeable physics twin."""
